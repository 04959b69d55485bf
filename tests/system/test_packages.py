"""The packages agree with one another, and `colcon test` runs the tests."""

import email
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from support import ROOT

PACKAGES = sorted(path.parent for path in ROOT.glob("*/package.xml"))
IN_PYTHON = [package for package in PACKAGES if (package / package.name / "__init__.py").exists()]


def test_all_packages_are_here() -> None:
    assert len(PACKAGES) == 11
    assert len(IN_PYTHON) == 8


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_manifests_of_a_package_say_the_same(package: Path) -> None:
    """One version and one maintainer for all: they are released together, with one CHANGELOG.md."""
    root = ElementTree.parse(package / "package.xml").getroot()
    said = {name: root.findtext(name) for name in ("version", "maintainer", "license", "description")}
    first = ElementTree.parse(PACKAGES[0] / "package.xml").getroot()
    assert [said[name] for name in ("version", "maintainer", "license")] == [
        first.findtext(name) for name in ("version", "maintainer", "license")
    ]
    if (package / "setup.py").exists():
        setup = (package / "setup.py").read_text()
        assert dict(re.findall(r'^ {4}(version|maintainer|license|description)="(.*)",$', setup, re.MULTILINE)) == said


def test_version_is_the_one_of_the_manifests_in_the_command_and_in_the_citation() -> None:
    version = ElementTree.parse(PACKAGES[0] / "package.xml").getroot().findtext("version")
    said = subprocess.run([sys.executable, "-m", "afm_model", "--version"], capture_output=True, text=True, check=True)
    assert said.stdout == f"afm {version}\n"
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()


@pytest.mark.parametrize("package", IN_PYTHON, ids=lambda path: path.name)
def test_types_of_an_installed_package_are_found(package: Path) -> None:
    spec = find_spec(package.name)
    assert spec
    assert spec.origin
    assert Path(spec.origin).with_name("py.typed").exists()
    assert 'package_data={NAME: ["py.typed"' in (package / "setup.py").read_text()  # what a wheel takes along


def test_colcon_test_runs_the_tests(tmp_path: Path) -> None:
    # One module, so that it does not run itself, found in one folder: loading all of them takes longer than the rest.
    command = [sys.executable, "-m", "colcon", "--log-base", tmp_path / "log", "test"]
    command += ["--test-result-base", tmp_path, "--pytest-args", "-k", "test_scheduling"]
    # With a blank, or colcon takes them for options of its own.
    command += [
        " --ignore=model",
        " --ignore=nanonis",
        " --ignore=predictive",
        " --ignore=system",
        " --ignore-glob=*/test_[!s]*",
    ]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    done = subprocess.run(command, cwd=ROOT / "ros2_ws", env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (result,) = tmp_path.rglob("pytest.xml")
    suite = ElementTree.parse(result).getroot().find("testsuite")
    assert suite is not None
    assert (suite.get("failures"), suite.get("errors")) == ("0", "0")
    assert int(suite.get("tests", "0")) >= 4


def test_workflow_runs_what_continuous_integration_runs_on_every_python_promised() -> None:
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "test.yml").read_text())["jobs"]
    assert jobs["wheels"]["strategy"]["matrix"]["python"] == ["3.11", "3.12", "3.13"]
    for job in jobs.values():
        assert any(".ci/run" in step.get("run", "") for step in job["steps"])


def test_hooks_of_pre_commit_are_the_tools_of_the_lint_script() -> None:
    (repository,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    entries = " ".join(hook["entry"] for hook in repository["hooks"])
    lint = (ROOT / "tools" / "lint.sh").read_text().splitlines()
    for line in lint[lint.index("ruff check .") :]:
        assert line.removesuffix(" .").removesuffix(" --check") in entries


def test_every_requirement_is_locked_in_its_version_with_hashes_and_no_address() -> None:
    folder = ROOT / "requirements"
    locks = [folder / f"{name}.lock" for name in ("ros-jazzy", "extras", "test")]
    lock = "".join(path.read_text() for path in locks)
    assert not re.search(r"https?:|file:|index-url|find-links", lock + (folder / "uv.lock").read_text())
    locked: dict[str, str] = {}
    for entry in re.split(r"\n(?=\S)", lock.strip()):
        found = re.match(r"([A-Za-z0-9_.-]+)==([^\s;]+)(?: ;[^\\\n]*)? \\\n", entry)
        assert found, entry
        assert re.fullmatch(r"(\s+--hash=sha256:[0-9a-f]{64}(?: \\)?)+", entry[found.end() - 1 :]), entry
        assert locked.setdefault(found[1].lower(), found[2]) == found[2] or ";" in entry, "in two sets, in two versions"
    wanted = re.findall(
        r"^([A-Za-z0-9_.-]+)(?:\[\w+\])?==(\S+)",
        "".join((folder / f"{name}.txt").read_text() for name in ("base", "ros-jazzy", "extras", "test")),
        re.MULTILINE,
    )
    assert len(wanted) > 100
    assert {name.lower().replace("_", "-"): version for name, version in wanted}.items() <= locked.items()


def test_notices_name_every_locked_package_in_its_version() -> None:
    notices = (ROOT / "THIRD-PARTY.md").read_text()
    for name in ("ros-jazzy", "extras", "test"):
        lock = (ROOT / "requirements" / f"{name}.lock").read_text()
        # Of two versions for two Pythons the last one.
        locked = dict(re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;]+)", lock, re.MULTILINE))
        assert not [package for package, version in locked.items() if f" {package} {version}" not in notices]


def test_audit_has_a_date_for_every_locked_package_in_its_version() -> None:
    rows = [line.split("\t") for line in (ROOT / "requirements" / "audit.tsv").read_text().splitlines()[1:]]
    locked = [
        (*found, name)
        for name in ("ros-jazzy", "extras", "test")
        for found in re.findall(
            r"^([A-Za-z0-9_.-]+)==([^\s;]+)", (ROOT / "requirements" / f"{name}.lock").read_text(), re.MULTILINE
        )
    ]
    assert [tuple(row[:3]) for row in rows] == locked
    assert not [row[0] for row in rows if not re.fullmatch(r"20\d\d-\d\d-\d\d", row[3])]


def test_nothing_under_the_gpl_is_installed_to_run_the_instrument() -> None:
    for name in ("base.txt", "ros-jazzy.lock", "extras.txt", "extras.lock"):
        assert "gwyddionpy" not in (ROOT / "requirements" / name).read_text()
    assert "gwyddionpy-converter" in (ROOT / "requirements" / "test.lock").read_text()
    sources = [path for package in ROOT.glob("afm_*") for path in package.rglob("*.py")]
    assert len(sources) > 100
    assert not [path for path in sources if "gwyddionpy" in path.read_text()]


@pytest.mark.parametrize("package", IN_PYTHON, ids=lambda path: path.name)
def test_wheel_of_a_package_states_its_licence_and_what_it_needs(package: Path, tmp_path: Path) -> None:
    """Made by `setup.py` itself, of a copy: nothing is downloaded."""
    source = shutil.copytree(package, tmp_path / package.name, symlinks=False)
    command = [sys.executable, "setup.py", "-q", "dist_info"]
    subprocess.run(command, cwd=source, capture_output=True, check=True)
    (folder,) = source.glob("*.dist-info")
    stated = email.message_from_string((folder / "METADATA").read_text())
    assert stated["Requires-Python"] == ">=3.11"
    assert stated["License-File"] == "LICENSE"
    assert stated.get_payload().strip()  # twine check --strict
    needed = stated.get_all("Requires-Dist")
    assert needed and all(re.search(r"[=>]=", each) for each in needed)  # a bound, or the same version
    commands = (folder / "entry_points.txt").read_text() if (folder / "entry_points.txt").exists() else ""
    assert ("afm = afm_model.__main__:main" in commands) == (package.name == "afm_model")


def test_demo_is_set_up_without_what_only_tests_and_studies_need() -> None:
    locked = (ROOT / "requirements" / "ros-jazzy.lock").read_text()
    for name in ("hypothesis", "pandas", "xarray", "h5py", "dask", "distributed", "afmformats", "control", "mypy"):
        assert f"\n{name}==" not in locked
    plan = subprocess.run(["make", "-n", "-C", ROOT, "demo"], capture_output=True, text=True, check=True).stdout
    assert "bootstrap.sh" in plan and "add.sh" not in plan


def test_pydantic_1_is_told_in_a_sentence_at_import(tmp_path: Path) -> None:
    """As rosdep installs it on Ubuntu 24.04: names that pydantic 2 brought are missing in it."""
    (tmp_path / "pydantic.py").write_text('VERSION = "1.10.14"\n')
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    command = [sys.executable, "-c", "import afm_model"]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("ImportError: afm_model needs pydantic 2, and this is 1.10.14 (")
    assert 'pip install --user --break-system-packages "pydantic>=2"' in done.stderr


def test_build_tells_each_package_and_each_quarter_of_the_messages() -> None:
    output = "Starting >>> afm_msgs\n[  1%] Built\n[ 26%] Built\n[ 27%] Built\n[100%] Built\nStarting >>> afm_tests\n"
    script = (ROOT / "tools" / "build.sh").read_text()
    progress = "show_progress() {" + script.partition("show_progress() {")[2].partition("\n}\n")[0] + "\n}\n"
    command = ["bash", "-euc", f"count=8\n{progress}\nshow_progress"]
    told = subprocess.run(command, input=output, capture_output=True, text=True, check=True).stdout
    quarters = ["    messages: 25 %", "    messages: 100 %"]
    assert told.splitlines() == ["  package 1 of 8: afm_msgs", *quarters, "  package 2 of 8: afm_tests"]


def test_build_tells_how_far_it_is() -> None:
    script = (ROOT / "tools" / "build.sh").read_text()
    show = script[script.index("show_progress() {") : script.index("\n}\n") + 3]
    said = ["Starting >>> afm_msgs", "[  4%] one", "[ 26%] two", "[ 31%] three", "[100%] all", "Starting >>> afm_tests"]
    command = ["bash", "-c", f"count=2\n{show}show_progress"]
    told = subprocess.run(command, input="\n".join([*said, ""]), capture_output=True, text=True, check=True, timeout=60)
    packages = ["  package 1 of 2: afm_msgs", "  package 2 of 2: afm_tests"]
    assert told.stdout.splitlines() == [packages[0], "    messages: 25 %", "    messages: 100 %", packages[1]]
