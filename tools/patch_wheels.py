"""Repair the ROS 2 wheels' CMake files: they name the include folders of the machine that built the wheels.

Run once after installing, by the Python of the environment itself.
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy

PATTERNS = (
    (re.compile(r'/opt/python/[^;"]*?/include/python3\.\d+'), sysconfig.get_path("include")),
    (re.compile(r'/[^;"]*?/numpy/_?core/include'), numpy.get_include()),
)


def main() -> None:
    """Rewrite every exported CMake target file of the environment that needs it."""
    for file in (Path(sys.prefix) / "share").glob("*/cmake/*Export.cmake"):
        text = repaired = file.read_text()
        for pattern, folder in PATTERNS:
            repaired = pattern.sub(lambda _, folder=folder: folder, repaired)
        if repaired != text:
            file.write_text(repaired)


if __name__ == "__main__":
    main()
