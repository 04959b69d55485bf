"""The hardware component for ros2_control: what it does without ROS, and what its package says of what it needs."""

import re
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from support import ROOT
from system.test_controller_examples import compile_cpp

PACKAGE = ROOT / "afm_ros2_control"
CASES = Path(__file__).with_name("exchange_cases.cpp")


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("exchange") / "cases"
    warnings = ("-Wextra", "-Wconversion", "-O1")
    compile_cpp(*warnings, "-pthread", f"-I{PACKAGE / 'include'}", CASES, "-o", program)
    return program


@pytest.mark.parametrize("name", re.findall(r'^  \{"(\w+)", ', CASES.read_text(), re.MULTILINE))
def test_exchange(cases: Path, name: str) -> None:
    done = subprocess.run([cases, name], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout


def test_package_without_ros2_control_says_that_the_component_is_not_built_and_installs_the_rest(
    tmp_path: Path,
) -> None:
    build, installed = tmp_path / "build", tmp_path / "installed"
    configure = ["cmake", "-S", PACKAGE, "-B", build, f"-DCMAKE_INSTALL_PREFIX={installed}"]
    done = subprocess.run(
        [*configure, "-DCMAKE_DISABLE_FIND_PACKAGE_hardware_interface=ON"], capture_output=True, text=True, check=True
    )
    assert "hardware_interface is not installed: the component for ros2_control is not built" in done.stdout
    subprocess.run(["cmake", "--install", build], capture_output=True, check=True)
    assert (installed / "include" / "afm_ros2_control" / "afm_ros2_control" / "exchange.hpp").exists()


def test_description_names_the_library_and_the_class_that_are_built() -> None:
    described = ElementTree.parse(PACKAGE / "afm_ros2_control.xml").getroot()
    (each,) = described
    source = (PACKAGE / "src" / "instrument_system.cpp").read_text()
    assert f"PLUGINLIB_EXPORT_CLASS({each.get('type')}, {each.get('base_class_type')})" in source
    assert each.get("type", "").split("::")[0] == described.get("path") == PACKAGE.name
