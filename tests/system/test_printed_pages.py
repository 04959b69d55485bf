"""What the pages print is run: commands in a terminal, programs in one Python, in the order of the page."""

import os
import re
import textwrap
from dataclasses import replace
from pathlib import Path

import pytest
from printed.page_run import PageRun, Terminal, copy_clone
from printed.pieces import PAGES, Piece, pieces
from printed.plan import LONG, SHORT, fate

from afm_model import load_scenario

NAMED = {"docs/first_run.md": "mine.yaml", "docs/rank.md": "mine.yaml"}
"""Names that pages give their parameter files, for commands that follow."""
SHORTER = {
    SHORT: {
        r"\bsession closed_loop_tanh\b": "session short.yaml --composed --no-picture",
    },
    LONG: {
        r"\brun\.duration: 0\.126\b": "run.duration: 0.0126",
        r"(?= --out out/rank)": " --cycles 0.7 --workers 1",
        r"\bsession (realtime_\w+)": r"session \1 --overrides seconds.yaml",
        r"--periods [\d e.-]+ --delays [\d ]+": "--periods 5e-5 --delays 0 --cycles 0.7 ",
        r"--pixels 256 --lines 256": "--pixels 32 --lines 16",
        r"(bringup scan (?!.*--pixels).*)": r"\1 --pixels 16 --lines 8",
        r"line_rate=5\.0\)": "line_rate=5.0, pixels=32, lines=8)",
        r"pixels=64, lines=64": "pixels=32, lines=4",
        r"^(?=.*{verb: lift)": 'ros2 action send_goal /afm/approach afm_msgs/action/Approach "{}" && ',
    },
}
"""What is run in place of what a page prints."""
INSIDE = load_scenario("two_materials").path.read_text().replace("    plant:", "    law: {kind: pid}\n    plant:")
FILES = {
    # Two periods of a reference that is ten times as fast.
    "short.yaml": load_scenario("closed_loop_tanh")
    .path.read_text()
    .replace("duration: 0.12566370614359174", "duration: 0.025")
    .replace("reference:", "reference:\n      omega_x: 500.0\n      omega_y: 500.0"),
    "seconds.yaml": "/**/afm_sim_node:\n  ros__parameters: {run.duration: 2.0}\n",
    "mine.yaml": INSIDE,
    "tapping.yaml": load_scenario("tapping").path.read_text(),
    "scenario.yaml": "/**/afm_sim_node:\n  ros__parameters: {run.duration: 0.03}\n"
    '/**/afm_controller_node:\n  ros__parameters: {law.kind: "OWN"}\n',
    "my_microscope.yaml": load_scenario("two_materials").path.read_text(),
}
"""Files that pages take for granted, and those of `SHORTER`."""
DEMO = "[ -e out/demo ] || ros2 run afm_bringup session short.yaml --composed --no-picture --out out/demo"
IMAGE = "ros2 run afm_bringup scan --pixels 16 --lines 4 --line-rate 10 --out out/scan"
LOOP = "ros2 run afm_sim_node afm_sim_node --ros-args -p law.kind:=tanh -p run.duration:=0.0"
MICROSCOPE = "ros2 run afm_sim_node afm_sim_node --ros-args -p law.kind:=pid --params-file "
BEFORE = {
    "docs/first_run.md": [DEMO],
    "docs/figure.md": [DEMO],
    "docs/faults.md": [LOOP],
    "docs/recording.md": [
        *(DEMO, IMAGE),
        *(f"cp out/scan/recording.{each} out/run.{each}" for each in ("mcap", "rrd")),
        "ln -s out/demo my_bag",
    ],
    "docs/tapping.md": [MICROSCOPE + "tapping.yaml"],
    "docs/dynamic.md": [MICROSCOPE + "tapping.yaml"],
    "docs/scan.md": [IMAGE, MICROSCOPE + "my_microscope.yaml"],
    "docs/topics.md": [
        "ros2 run afm_bringup session realtime_250us --overrides seconds.yaml --out out/realtime_250us",
        LOOP,
    ],
}
"""Commands for what a page takes for granted."""


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_clone(tmp_path_factory.mktemp("printed") / "clone")


def ranked(done: PageRun) -> None:
    (said,) = (said for command, said in done.printed.items() if " compare " in command)
    order = re.findall(r"^ *(observer|pid|mine:PD slowness=2|mine:PD)  ", said, re.MULTILINE)
    assert order == ["observer", "pid", "mine:PD slowness=2", "mine:PD"]
    assert (done.folder / "out" / "rank" / "comparison.html").is_file()


def drawn(done: PageRun) -> None:
    assert done.printed["figure"] == "(501, 3) V\n"
    assert any("friction, half the width: " in said for said in done.printed.values())
    assert {"figure.pdf", "loop.pdf", "error.png", "error.csv"} <= {each.name for each in done.folder.iterdir()}


CLAIMS = {"docs/rank.md": ranked, "docs/figure.md": drawn}
"""What a page says of its results."""
NEAR = """
from afm_model.microscope import Microscope
microscope = Microscope("two_materials")
microscope.approach(rate=20e-6)
"""
DRIVEN = """
from afm_model.microscope import Microscope
driven = {"kind": "dynamic", "drive_amplitude": 2e-13}
lever = {"lever": "ppp_fmr", "Q": 80.0, "modes": 3, "dt": 5e-8, "gap": 10e-9, "contact": "dmt", "K": 4.5e9}
microscope = Microscope("two_materials", plant=lever, onboard=driven, detector={"sample_period": 5e-7})
"""
GIVEN = {
    "docs/scan.md": NEAR,
    "docs/extending.md": NEAR,
    "docs/dynamic.md": DRIVEN,
    "docs/sweep.md": "from afm_model import load_scenario, simulate_many",
}
"""Names that the programs of a page take for granted."""


def run_page(page: str, how: str, clone: Path, monkeypatch: pytest.MonkeyPatch) -> PageRun:
    """Run the pieces of a page that are run here."""
    for name, text in FILES.items():
        (clone / name).write_text(text.replace("OWN", "kalman:KALMAN" if "extending" in page else "pd_law:PD"))
    for folder in (clone / "examples" / "parts", clone / "examples" / "controllers"):
        monkeypatch.syspath_prepend(str(folder))
        monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    done, terminal, block = PageRun(clone), Terminal(clone), 0
    try:
        for command in BEFORE.get(page, []):
            terminal.run(command)
        done.assume(GIVEN.get(page, ""))
        for piece in pieces(page):
            if piece.block != block:
                block = piece.block
                terminal.go_home()
            if piece.kind == "file" and piece.mark:
                done.file(piece, f"{piece.mark}.yaml")
            elif fate(piece) == how:
                run_piece(replace(piece, text=shorter(piece, how)), done, terminal)
    finally:
        terminal.close()
    return done


def shorter(piece: Piece, how: str) -> str:
    """Return what is run in place of a piece."""
    text = piece.text
    for pattern, replacement in SHORTER[how].items():
        text = re.sub(pattern, replacement, text)
    return text


def run_piece(piece: Piece, done: PageRun, terminal: Terminal) -> None:
    """Run a command or a program; load a file, whole or a part of it."""
    if piece.kind == "command":
        # As `diff` does: the page compares what differs.
        done.printed[piece.text] = terminal.run(piece.text, 1 if " --compare " in piece.text else 0)
    elif piece.kind == "program":
        done.program(piece)
    elif name := NAMED.get(piece.page):
        done.file(piece, name)
    else:
        part = "/**/afm_sim_node:\n  ros__parameters:\n" + textwrap.indent(piece.text, "    ")
        done.file(piece if piece.text.startswith("/") else replace(piece, text=part), "loaded.yaml")
        load_scenario(done.folder / "loaded.yaml")


def run_here(how: str) -> list[str]:
    """Pages of which something is run here."""
    return [page for page in PAGES if any(fate(piece) == how for piece in pieces(page))]


def claim(done: PageRun, page: str) -> None:
    """Hold what a page has made against what it says of it."""
    if page in CLAIMS:
        CLAIMS[page](done)


@pytest.mark.parametrize("page", run_here(SHORT))
def test_page_runs_as_it_is_printed(page: str, clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    claim(run_page(page, SHORT, clone, monkeypatch), page)


@pytest.mark.long
@pytest.mark.timeout(0)
@pytest.mark.parametrize("page", run_here(LONG))
def test_long_page_runs_as_it_is_printed(page: str, clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    claim(run_page(page, LONG, clone, monkeypatch), page)


def test_nothing_that_is_given_to_a_page_is_left_over() -> None:
    for given in (NAMED, BEFORE, GIVEN, CLAIMS):
        assert set(given) <= {*run_here(SHORT), *run_here(LONG)}
    for how, changes in SHORTER.items():
        texts = [piece.text for page in PAGES for piece in pieces(page) if fate(piece) == how]
        assert [change for change in changes if not any(re.search(change, text) for text in texts)] == []
