"""What the launch file needs is there where `ros2 launch` runs: in a Python that has ROS 2 and perhaps nothing else."""

import ast
import subprocess
import sys

from support import ROOT

LAUNCH_FILE = ROOT / "afm_bringup" / "launch" / "instrument.launch.py"


def test_launch_file_imports_nothing_beyond_ros() -> None:
    imported = [
        f"from {node.module} import {', '.join(alias.name for alias in node.names)}"
        for node in ast.parse(LAUNCH_FILE.read_text()).body
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("afm_")
    ]
    assert imported
    # None in sys.modules: as if it were not installed.
    absent = (
        "import sys; sys.modules |= dict.fromkeys(('numpy', 'numba', 'scipy', 'pydantic', 'rerun', 'rich', 'yaml'))"
    )
    program = "\n".join([absent, *imported, "print(find_scenario('open_loop').name)"])
    end = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (end.returncode, end.stdout) == (0, "open_loop.yaml\n"), end.stderr
