"""Take out of a built workspace what only its build needs; files that are there several times become links.

`core`: also what only recorder and pictures need. Run once, behind `tools/build.sh`, by a Python outside of .venv.
"""

import hashlib
import re
import shutil
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV, WORKSPACE = ROOT / ".venv", ROOT / "ros2_ws"
MESSAGES = WORKSPACE / "build" / "afm_msgs"
TOOLS = re.compile(
    r"colcon-.*|ros-(ament-(cmake.*|package)|fastrtps-cmake-module|python-cmake-module|rmw-implementation-cmake"
    r"|domain-coordinator|test-msgs|rosidl-(adapter|cli|cmake|core-.*|default-.*|generator-(c|cpp|type-description)"
    r"|pycommon))|argcomplete|catkin-pkg|coverage|distlib|docutils|empy|iniconfig|lark-parser|ninja|notify2"
    r"|pip|pluggy|pytest.*|setuptools"
)
"""Packages that make messages and packages, with what only they need."""
PICTURES = re.compile(
    r"rerun-sdk|pyarrow|matplotlib|attrs|contourpy|cycler|fonttools|kiwisolver|pillow|psutil|pyparsing"
)
"""Packages of recorder and pictures, with what only they need."""
ALIKE = 100_000
"""Least size of a file that becomes a link where it stands twice [bytes]."""


def size() -> float:
    """Of the workspace [MB], each file once."""
    found = {each.stat().st_ino: each.stat().st_blocks for each in ROOT.rglob("*") if not each.is_symlink()}
    return 512 * sum(found.values()) / 1e6


def unlink_from_the_build() -> None:
    """What is installed as a link into what goes becomes a copy."""
    for link in list((WORKSPACE / "install").rglob("*")):
        if link.is_symlink():
            target = link.resolve()
            if target.is_relative_to(MESSAGES) or target.is_relative_to(VENV):
                link.unlink()
                (shutil.copytree if target.is_dir() else shutil.copy2)(target, link)
    shutil.rmtree(MESSAGES)


def uninstall(pattern: re.Pattern[str]) -> None:
    """Take packages out of the environment."""
    site = next((VENV / "lib").glob("python3*/site-packages"))
    names = {re.sub(r"[-_.]+", "-", each.metadata["Name"]).lower() for each in distributions(path=[str(site)])}
    chosen = sorted(each for each in names if pattern.fullmatch(each))
    subprocess.run([VENV / "bin" / "python", "-m", "pip", "uninstall", "--quiet", "--yes", *chosen], check=True)


def link_what_is_alike() -> None:
    """Wheels hold no links: a library stands under each of its names, and in each package that needs it."""
    first: dict[tuple[int, str], Path] = {}
    for file in sorted(VENV.rglob("*.so*")):
        if file.is_symlink() or file.stat().st_size < ALIKE:
            continue
        found = first.setdefault((file.stat().st_size, hashlib.sha256(file.read_bytes()).hexdigest()), file)
        if found != file:
            file.unlink()
            file.symlink_to(found)


def main() -> None:
    """Tell the size before and after."""
    before = size()
    unlink_from_the_build()
    if sys.argv[1:] == ["core"]:
        uninstall(PICTURES)
        for package in ("afm_recorder_node", "afm_bringup"):  # but for the profile of the network in the latter
            for folder in (ROOT / package, WORKSPACE / "build", WORKSPACE / "install"):
                shutil.rmtree(folder / package)
    uninstall(TOOLS)
    for folder in [VENV / "include", *VENV.rglob("tests")]:
        shutil.rmtree(folder, ignore_errors=True)
    link_what_is_alike()
    # Tables of symbols are for debuggers, and 92 MB.
    for pattern in ("libllvmlite.so", "rerun_bindings*.so", "rerun_cli/rerun"):
        for file in VENV.rglob(pattern):
            subprocess.run(["strip", "--strip-unneeded", file], check=True)
    print(f"{ROOT}: {before:.0f} MB before, {size():.0f} MB after")


if __name__ == "__main__":
    main()
