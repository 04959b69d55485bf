"""Other programs that read our files."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import gwyfile
import numpy as np
import pytest


def gwyddion(path: Path, folder: Path) -> Any:
    """What Gwyddion itself reads from a file: it writes all of it into a file of its own, which gwyfile reads.

    Its code comes with the package gwyddionpy-converter (requirements/test.lock, Linux on x86-64); elsewhere the
    program on the PATH is used.
    """
    written = folder / f"{path.stem}_{path.suffix[1:]}_by_gwyddion.gwy"
    try:
        from gwyddionpy_converter import binary_path

        command = [binary_path(), path, written]
    except ImportError:
        program = shutil.which("gwyddion")
        if program is None:
            pytest.skip("there is no Gwyddion for this machine")
        command = [program, f"--convert-to-gwy={written}", path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0 and written.exists(), done.stdout + done.stderr
    return gwyfile.load(str(written))


def titles(container: Any) -> dict[str, str]:
    """Number of each channel by its title."""
    return {value: key.split("/")[1] for key, value in container.items() if key.endswith("/data/title")}


def field(container: Any, title: str) -> tuple[np.ndarray, dict[str, Any]]:
    """Values of the channel of this title, row 0 at the top, and its size, place and units."""
    found = container[f"/{titles(container)[title]}/data"]
    numbers = {name: found[name] for name in ("xreal", "yreal")} | {"xoff": found.xoff, "yoff": found.yoff}
    # Gwyddion leaves a unit out that has no name.
    units = {name: "" if found.get(name) is None else found.get(name).unitstr for name in ("si_unit_xy", "si_unit_z")}
    return found.data, numbers | units
