"""Mutation score of the tests: single mistakes at random places of the sources, each tried against the tests.

    python tools/mutation.py contact --mutants 60 --seed 1

Needs `pip install cosmic-ray`, whose operators make the mistakes. The working tree is copied; in the copy one operator
or number of a file is changed at a time, and the tests of its group run until one fails. Kernels are compiled anew each
time. What survives is printed as a difference, and has to be read: some change nothing. Pins of hashes are not among
the tests: they would find everything and tell nothing.
"""

import argparse
import difflib
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = "afm_model", "afm_node_common", "afm_sim_node", "afm_controller_node", "afm_recorder_node", "afm_bringup"
SIGNS = "Add", "Sub", "Mul", "Div"
OTHERS = "Comparison", "Number", "Boolean", "ReplaceAnd", "ReplaceOr", "ReplaceTrue", "ReplaceFalse", "AddNot", "ZeroIt"
LONGEST = 900.0
"""Tests that go on for so long [s] with a mistake have found it: it is an endless loop."""
_M, _T, _N = "afm_model/afm_model", "tests/model", "afm_node_common/afm_node_common"
GROUPS = {
    "contact": {
        f"{_M}/contact/jkr.py": f"{_T}/contact/test_jkr.py {_T}/contact/test_surface.py",
        f"{_M}/contact/friction.py": f"{_T}/contact/test_disc.py {_T}/plant/test_lateral.py {_T}/plant/test_paper.py",
        f"{_M}/contact/maugis.py": f"{_T}/contact/test_maugis.py",
        f"{_M}/contact/contact_table.py": f"{_T}/contact/test_maugis.py",
    },
    "analysis": {
        f"{_M}/analysis/force_curves.py": f"{_T}/analysis/test_curves.py",
        f"{_M}/analysis/friction_load.py": f"{_T}/analysis/test_friction_load.py",
        f"{_M}/analysis/loops.py": f"{_T}/analysis/test_loops.py {_T}/analysis/test_coverage.py",
        f"{_M}/analysis/estimate.py": f"{_T}/analysis/test_loops.py {_T}/analysis/test_coverage.py",
        f"{_M}/analysis/modulus.py": f"{_T}/analysis/test_modulus.py",
        f"{_M}/analysis/contact_problem.py": f"{_T}/analysis/test_modulus.py",
        f"{_M}/analysis/regions.py": f"{_T}/analysis/test_images.py",
        f"{_M}/analysis/step_heights.py": f"{_T}/analysis/test_images.py",
        f"{_M}/analysis/thermal.py": f"{_T}/analysis/test_thermal.py",
        f"{_M}/analysis/wedge.py": f"{_T}/analysis/test_wedge.py",
        f"{_M}/analysis/identification.py": f"{_T}/test_identification.py",
    },
    "law": {
        f"{_M}/law/{name}.py": f"{_T}/law/test_{test}.py"
        for name, test in (
            ("lyapunov", "lyapunov"),
            ("paper", "paper"),
            ("paper_tracking", "paper"),
            ("pid", "sampled_laws"),
            ("observer", "sampled_laws"),
            ("sampled", "sampled_laws"),
        )
    },
    "sample": {f"{_M}/sample/*.py": f"{_T}/sample"},
    "plant": {f"{_M}/plant/*.py": f"{_T}/plant", f"{_M}/plant/lever/*.py": f"{_T}/plant"},
    "microscope": {f"{_M}/microscope/*.py": f"{_T}/microscope", f"{_M}/microscope/verbs/*.py": f"{_T}/microscope"},
    "files": {f"{_M}/files/*.py": f"{_T}/files"},
    "codec": {
        f"{_N}/codec.py": "tests/nodes/test_codec.py tests/nodes/test_block_encoder.py",
        f"{_N}/drive_codec.py": "tests/nodes/test_drive_codec.py",
        f"{_N}/direct.py": "tests/nodes/test_direct.py",
        f"{_N}/verb_codec.py": "tests/nodes/test_verbs.py",
    },
}
"""Sources of a group, and the tests of each."""


class Mutant(NamedTuple):
    """One mistake."""

    path: str
    line: int
    operator: str
    occurrence: int
    tests: str


def wanted(name: str) -> bool:
    """Whether an operator makes mistakes that a person might make."""
    kind = name.removeprefix("core/")
    if kind.startswith("ReplaceBinaryOperator_"):
        _, before, after = kind.split("_")
        return before in SIGNS and after in SIGNS
    return kind.startswith(OTHERS) and not kind.startswith("ReplaceComparisonOperator_Is")


def mutants(path: str, tests: str) -> list[Mutant]:
    """All of a file, but in annotations and defaults."""
    tree = get_ast((ROOT / path).read_text())
    found = []
    for name in filter(wanted, operator_names()):
        operator, count = get_operator(name)(), 0
        for node in ast_nodes(tree):
            for start, _ in operator.mutation_positions(node):
                parents, each = set(), node
                while each is not None:
                    parents.add(each.type)
                    each = each.parent
                if not parents & {"annassign", "tfpdef", "param", "decorator"}:
                    found.append(Mutant(path, start[0], name, count, tests))
                count += 1
    return found


class Copy:
    """The working tree in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.changes = folder, 0
        order = ["git", "ls-files", "-co", "--exclude-standard"]
        for name in subprocess.run(order, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines():
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        paths = os.pathsep.join(str(folder / name) for name in PACKAGES)
        self.environment = os.environ | {"PYTHONPATH": paths + os.pathsep + os.environ.get("PYTHONPATH", "")}

    def write(self, path: str, text: str) -> None:
        """Bytecode is known by the time of its source: no two versions have the same one."""
        (self.folder / path).write_text(text)
        self.changes += 1
        os.utime(self.folder / path, (1e9 + self.changes,) * 2)

    def passes(self, tests: str) -> bool:
        """Whether all of these tests pass."""
        order = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests.split()]
        try:
            done = subprocess.run(order, cwd=self.folder, env=self.environment, capture_output=True, timeout=LONGEST)
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


def main() -> None:
    """Print the survivors and the score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("group", choices=GROUPS)
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="numbers of the sample, as 3,17: these alone")
    given = parser.parse_args()
    every = [
        mutant
        for pattern, tests in GROUPS[given.group].items()
        for path in sorted(ROOT.glob(pattern))
        for mutant in mutants(str(path.relative_to(ROOT)), tests)
    ]
    sample = random.Random(given.seed).sample(every, min(given.mutants, len(every)))
    chosen = [int(number) for number in given.only.split(",") if number] or range(1, len(sample) + 1)
    print(f"{given.group}: {len(sample)} of {len(every)} mutants", flush=True)
    killed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for number in chosen:
            mutant = sample[number - 1]
            source = (copy.folder / mutant.path).read_text()
            changed = mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence)
            copy.write(mutant.path, changed)
            survives = copy.passes(mutant.tests)
            copy.write(mutant.path, source)
            killed += not survives
            print(f"{number:3} {'SURVIVES' if survives else 'killed'} {mutant.path}:{mutant.line}", flush=True)
            if survives:
                lines = difflib.unified_diff(source.splitlines(), changed.splitlines(), lineterm="", n=0)
                print("\n".join(list(lines)[3:]), flush=True)
    print(f"{given.group}: {killed} of {len(chosen)} killed")


if __name__ == "__main__":
    main()
