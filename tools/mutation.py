"""Mutation score of the tests: single mistakes at random places of the sources, each tried against the tests.

    nice python tools/mutation.py contact --mutants 60 --seed 1

Needs `pip install cosmic-ray`, whose operators make the mistakes. The working tree is copied; all tests of the group
run once, with coverage. Then one operator or number of a file is changed at a time, and tests run until one fails:
first those that reach the line, the shortest first, then the others of their files; for a line in a kernel, or one that
runs at import, all. Kernels that the mistake is compiled into are compiled anew, no others. What survives is printed as
a difference, and has to be read: some change nothing. Pins of hashes are not among the tests: they would find
everything and tell nothing.
"""

import argparse
import ast
import difflib
import importlib
import json
import multiprocessing
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from coverage import CoverageData

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (
    *("afm_model", "afm_predictive", "afm_node_common", "afm_sim_node", "afm_controller_node", "afm_recorder_node"),
    *("afm_bringup", "afm_nanonis"),
)
SIGNS = "Add", "Sub", "Mul", "Div"
OTHERS = "Comparison", "Number", "Boolean", "ReplaceAnd", "ReplaceOr", "ReplaceTrue", "ReplaceFalse", "AddNot", "ZeroIt"
NO_PLACE = {"annassign", "tfpdef", "param", "decorator", "fstring", "raise_stmt"}
"""Annotations, defaults, messages."""
KERNELS = {"kernel", "routine", "inlined"}
LONGEST = 1800.0
"""Tests that wait for so long [s] with a mistake have found it; so have those that compute for ten times as long."""
COMPILING = 100.0
"""Processor time that kernels may need to be compiled anew. [s]"""
LARGE = "numba", "scipy.optimize", "scipy.signal", "scipy.interpolate", "hypothesis", "xarray", "h5py", "PIL.Image"
"""Imported once: each run of tests is a fork of this process, which imports nothing of the project."""
_M, _T = "afm_model/afm_model", "tests/model"
_CONTACT = f"{_T}/contact {_T}/plant/test_lateral.py {_T}/plant/test_paper.py"
_CODEC = " ".join(f"tests/nodes/test_{name}.py" for name in "codec block_encoder drive_codec direct verbs".split())
GROUPS = {
    "contact": (f"{_M}/contact", "jkr friction maugis contact_table", _CONTACT),
    "analysis": (
        f"{_M}/analysis",
        "force_curves friction_load loops estimate modulus contact_problem regions step_heights thermal wedge "
        "identification",
        f"{_T}/analysis {_T}/test_identification.py",
    ),
    "law": (f"{_M}/law", "lyapunov paper paper_tracking pid observer sampled", f"{_T}/law"),
    "sample": (f"{_M}/sample", "*", f"{_T}/sample"),
    "plant": (f"{_M}/plant", "* lever/*", f"{_T}/plant"),
    "microscope": (f"{_M}/microscope", "* verbs/*", f"{_T}/microscope"),
    "files": (f"{_M}/files", "*", f"{_T}/files"),
    "codec": ("afm_node_common/afm_node_common", "codec drive_codec direct verb_codec", _CODEC),
}
"""Folder, sources and tests of a group."""


class Mutant(NamedTuple):
    path: str
    line: int
    operator: str
    occurrence: int


def wanted(name: str) -> bool:
    """Whether an operator makes mistakes that a person might make."""
    kind = name.removeprefix("core/")
    if kind.startswith("ReplaceBinaryOperator_"):
        _, before, after = kind.split("_")
        return before in SIGNS and after in SIGNS
    return kind.startswith(OTHERS) and not kind.startswith("ReplaceComparisonOperator_Is")


def mutants(path: str) -> list[Mutant]:
    """All of a file, but for those that change no result."""
    tree, found = get_ast((ROOT / path).read_text()), []
    for name in filter(wanted, operator_names()):
        operator, count = get_operator(name)(), 0
        for node in ast_nodes(tree):
            for start, _ in operator.mutation_positions(node):
                if not any(node.search_ancestor(place) or node.type == place for place in NO_PLACE):
                    found.append(Mutant(path, start[0], name, count))
                count += 1
    return found


def statement(source: str, line: int) -> tuple[range, bool]:
    """Lines of the statement at a line, without what is indented below it, and whether it is in a kernel."""
    lines, compiled = range(line, line + 1), False
    for node in ast.walk(ast.parse(source)):  # outer ones first
        if not isinstance(node, ast.stmt) or not node.lineno <= line <= (node.end_lineno or 0):
            continue
        body = getattr(node, "body", None)
        lines = range(node.lineno, body[0].lineno if body else (node.end_lineno or 0) + 1)
        compiled |= any(getattr(each, "id", "") in KERNELS for each in getattr(node, "decorator_list", []))
    return (lines if line in lines else range(line, line + 1)), compiled


class Chosen:
    """A plugin of pytest: runs some tests in a given order, notes how long each takes and which one fails."""

    def __init__(self, order: list[str] | None, notes: Path) -> None:
        self.order, self.notes, self.failed, self.seconds = order, notes, "", dict[str, float]()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        if self.order is not None:
            named = {item.nodeid: item for item in items}
            items[:] = [named[test] for test in self.order if test in named]

    def pytest_runtest_logreport(self, report: Any) -> None:
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed = self.failed or f"{report.nodeid}: {str(report.longrepr).splitlines()[-1]}"

    def pytest_sessionfinish(self) -> None:
        self.notes.write_text(json.dumps([self.failed, self.seconds]))


def file_of(test: str) -> str:
    """Of tests by their name."""
    return test.partition("::")[0]


class Copy:
    """The working tree in a folder of its own, with compiled kernels of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.changes, self.notes = folder / "tree", 0, folder / "notes"
        order = ["git", "ls-files", "-co", "--exclude-standard"]
        for name in subprocess.run(order, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines():
            if (ROOT / name).is_file():
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, self.folder / name)
        kept = Path(os.environ.get("NUMBA_CACHE_DIR") or Path.home() / ".cache") / "afm_model"
        (folder / "cache").mkdir()
        subprocess.run(["cp", "-al", kept, folder / "cache"], check=False, stderr=subprocess.DEVNULL)
        self.paths = [str(self.folder / name) for name in PACKAGES]
        path = os.pathsep.join([*self.paths, os.environ.get("PYTHONPATH", "")])
        os.environ |= {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / "cache")}

    def write(self, path: str, text: str) -> None:
        """Bytecode is known by the time of its source: no two versions have the same one."""
        (self.folder / path).write_text(text)
        self.changes += 1
        os.utime(self.folder / path, (1e9 + self.changes,) * 2)

    def _run(self, tests: list[str], order: list[str] | None, seconds: float) -> None:
        os.chdir(self.folder)
        os.setsid()
        sys.path[:] = [*self.paths, *(path for path in sys.path if path != str(ROOT / "tools"))]
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 10))
        log = os.open(self.notes.with_name("log"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1), os.dup2(log, 2)
        flags = ["-x"] if order else [f"--cov={name}" for name in PACKAGES] + ["--cov-context=test", "--cov-report="]
        sys.exit(int(pytest.main(["-q", "-p", "no:cacheprovider", *flags, *tests], [Chosen(order, self.notes)])))

    def run(self, tests: list[str], order: list[str] | None, seconds: float) -> tuple[str, dict[str, float]]:
        """Why these tests fail, or nothing; and how long each takes."""
        self.notes.unlink(missing_ok=True)
        process = multiprocessing.get_context("fork").Process(target=self._run, args=(tests, order, seconds))
        process.start()
        process.join(LONGEST)
        code = process.exitcode
        if code is None:
            os.killpg(process.pid or 0, signal.SIGKILL)
        endless = {None: "waits without end", -signal.SIGXCPU: "computes without end"}
        reason = endless.get(code, f"ends with {code}" if code else "")
        failed, seconds_of = json.loads(self.notes.read_text()) if self.notes.exists() else ("", {})
        return failed or reason, seconds_of


class Tests:
    """Which tests are to be run for a mutant, in which order."""

    def __init__(self, copy: Copy, tests: str) -> None:
        self.copy = copy
        failed, self.seconds = copy.run(tests.split(), None, 1e5)
        if failed:
            sys.exit(f"without a mistake: {failed}\n{copy.notes.with_name('log').read_text()}")
        self.reached = CoverageData(str(copy.folder / ".coverage"))
        self.reached.read()
        self.texts = {file: (copy.folder / file).read_text() for file in map(file_of, self.seconds)}

    def of(self, mutant: Mutant) -> list[str]:
        """In their order."""
        lines, compiled = statement((self.copy.folder / mutant.path).read_text(), mutant.line)
        contexts = self.reached.contexts_by_lineno(str(self.copy.folder / mutant.path))
        reaching = {each.rpartition("|")[0] for line in lines for each in contexts.get(line, ())} - {""}
        # Others of their files may use what one of them has computed for all.
        files = {file_of(test) for test in reaching} if reaching and not compiled else self.texts.keys()
        name = Path(mutant.path).stem
        every = [test for test in self.seconds if file_of(test) in files]
        far = {test: test not in reaching and name not in self.texts[file_of(test)] for test in every}
        return sorted(every, key=lambda test: (far[test], self.seconds[test]))


def main() -> None:
    """Print the survivors and the score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("group", choices=GROUPS)
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="numbers of the sample, as 3,17: these alone")
    parser.add_argument("--tests", default="", help="files of tests, in place of those of the group")
    given = parser.parse_args()
    room, names, every_test = GROUPS[given.group]
    paths = [path for name in names.split() for path in sorted((ROOT / room).glob(f"{name}.py"))]
    every = [mutant for path in paths for mutant in mutants(str(path.relative_to(ROOT)))]
    sample = random.Random(given.seed).sample(every, min(given.mutants, len(every)))
    chosen = [int(number) for number in given.only.split(",") if number] or range(1, len(sample) + 1)
    print(f"{given.group}: {len(sample)} of {len(every)} mutants", flush=True)
    for name in LARGE:
        importlib.import_module(name)
    killed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        tests = Tests(copy, given.tests or every_test)
        print(f"{len(tests.seconds)} tests, {sum(tests.seconds.values()):.0f} s", flush=True)
        for number in chosen:
            mutant = sample[number - 1]
            source = (copy.folder / mutant.path).read_text()
            changed = mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence)
            order = tests.of(mutant)
            copy.write(mutant.path, changed)
            limit = COMPILING + 10.0 * sum(tests.seconds[test] for test in order)
            failed, _ = copy.run(sorted(set(map(file_of, order))), order, limit)
            copy.write(mutant.path, source)
            killed += bool(failed)
            print(f"{number:3} {'killed' if failed else 'SURVIVES'} {mutant.path}:{mutant.line} {failed}", flush=True)
            if not failed:
                lines = difflib.unified_diff(source.splitlines(), changed.splitlines(), lineterm="", n=0)
                print("\n".join(list(lines)[3:]), flush=True)
    print(f"{given.group}: {killed} of {len(chosen)} killed")


if __name__ == "__main__":
    main()
