"""Compile the kernels of the shipped scenarios for any processor of this architecture, and put them into the package.

    python tools/make_kernels.py            # into afm_model/afm_model/kernels, which wheels and images take along

They belong to these sources and to this version of Python, numba and llvmlite. With others, and for all that is not
among them, kernels are compiled when they are needed.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from afm_model.compiled.cache import ANY_PROCESSOR, SHIPPED


def use() -> None:
    """Do once what first sessions do: the shipped scenarios, and each verb that the first pages name."""
    from afm_model import PartError, ScenarioError, changed, load_scenario, scenario_names, simulate
    from afm_model.microscope import Microscope

    for name in scenario_names():
        try:
            scenario = load_scenario(name)
        except (PartError, ScenarioError):  # its law stands in another package
            continue
        if scenario.sim.reference.kind != "verbs":
            simulate(
                changed(scenario.sim, {"run.duration": 50 * scenario.sim.plant.control_period}), scenario.controller
            )
    for name in ("two_materials", "step_grating"):
        with Microscope(name) as microscope:
            microscope.approach()
            microscope.scan(size_x=50e-9, pixels=4, lines=1, line_rate=10.0)
            microscope.force_curve()
            microscope.withdraw()
    with Microscope("tapping", plant={"kind": "averaged", "gap": 500e-9, "dt": 2e-6}) as microscope:
        microscope.tune(free_amplitude=20e-9)
        microscope.approach(rate=5e-6)


def main() -> None:
    """Run `use` in a process that compiles for any processor, and keep what it has compiled."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--use", action="store_true", help=argparse.SUPPRESS)
    if parser.parse_args().use:
        use()
        return
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | ANY_PROCESSOR | {"NUMBA_CACHE_DIR": folder}
        subprocess.run([sys.executable, __file__, "--use"], env=environment, check=True)
        # What stands there already belongs to other sources, or to another version of Python.
        ignored = shutil.ignore_patterns("sources.json", "cleaned", "*.lock")
        shutil.copytree(Path(folder) / "afm_model", SHIPPED, ignore=ignored, dirs_exist_ok=True)


if __name__ == "__main__":
    main()
