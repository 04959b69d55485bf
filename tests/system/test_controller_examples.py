"""Claims about the controllers of docs/controllers.md that no other test runs: the one in C++."""

import os
import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "cpp_controller"
STAND_IN = Path(__file__).resolve().parent / "stand_in"
COMPILER = shutil.which("c++") or shutil.which("g++")


def message_headers() -> list[str]:
    """Folders with the headers of the messages, as `-I` options."""
    folders: list[Path] = []
    for prefix in os.environ["AMENT_PREFIX_PATH"].split(os.pathsep):
        folders += [each for each in (Path(prefix) / "include").glob("*") if each.is_dir()]
    return [f"-I{folder}" for folder in folders]


def compile_cpp(*arguments: str | Path) -> None:
    assert COMPILER, "a C++ compiler is needed to build the workspace, and here"
    command = [COMPILER, "-std=c++17", "-Wall", "-Werror", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_node_in_cpp_compiles_against_the_messages_of_this_workspace():
    source = EXAMPLE / "src" / "cpp_controller.cpp"
    compile_cpp("-fsyntax-only", f"-I{EXAMPLE / 'include'}", f"-I{STAND_IN}", *message_headers(), source)


def test_law_in_cpp_gives_the_numbers_of_the_node_in_python(tmp_path):
    (tmp_path / "main.cpp").write_text(
        '#include <cstdio>\n#include "pd_law.hpp"\n'
        "int main() {\n  double r, x, v, w;\n"
        '  while (std::scanf("%la %la %la %la", &r, &x, &v, &w) == 4) std::printf("%a\\n", PdLaw()(r, x, v, w));\n}\n'
    )
    compile_cpp(f"-I{EXAMPLE / 'include'}", tmp_path / "main.cpp", "-o", tmp_path / "law")
    cases = np.random.default_rng(5).normal(size=(20, 4)) * [5e-9, 5e-9, 1e-6, 1e-6]
    lines = "\n".join(" ".join(float(each).hex() for each in case) for case in cases)
    done = subprocess.run([tmp_path / "law"], input=lines, capture_output=True, text=True, check=True)
    answered = [float.fromhex(line) for line in done.stdout.split()]
    # As in examples/pd_controller.py.
    assert answered == pytest.approx([3e10 * (r - x) + 6e5 * (v - w) for r, x, v, w in cases], rel=1e-12)
    gains = runpy.run_path(str(EXAMPLE.parent / "pd_controller.py"), run_name="read")["GAINS"]
    assert gains["x"] == gains["y"] == (3e10, 6e5)
    assert (
        f"height_{{{gains['z'][0] / 1e8:g}e8, {gains['z'][1] / 1e4:g}e4}}"
        in (EXAMPLE / "src" / "cpp_controller.cpp").read_text()
    )


def test_package_in_cpp_says_that_it_needs_a_full_ros_2(tmp_path):
    prefixes = os.environ["AMENT_PREFIX_PATH"].split(os.pathsep)
    if any((Path(prefix) / "share" / "rclcpp").is_dir() and ".venv" not in prefix for prefix in prefixes):
        pytest.skip("there is a full ROS 2")
    done = subprocess.run(["cmake", "-S", EXAMPLE, "-B", tmp_path], capture_output=True, text=True)
    assert done.returncode != 0
    assert "cpp_controller needs the rclcpp of a full ROS 2: source its setup.bash" in " ".join(done.stderr.split())
