"""What a session refuses, it refuses in one sentence with the value and what is allowed, before anything is written."""

import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from support import assert_nothing_left, session

from afm_bringup.scenario_input import read_scenario
from afm_model import ScenarioError, scenario_names

SIMULATOR = "/**/afm_sim_node"
CONTROLLER = "/**/afm_controller_node"

PORT_LEFT = re.compile(r"RTPS_TRANSPORT_SHM.*Failed init_port fast\w+_port7[0-3]\d\d: open_and_lock_file failed")
"""What Fast DDS prints where two nodes want the port of a killed one: docs/reliability.md, Shared memory."""


def section(name: str, *lines: str) -> str:
    """Text of a scenario with one section."""
    return f"{name}:\n  ros__parameters:\n" + "".join(f"    {line}\n" for line in lines)


# Files, as they are read.

NOT_ALLOWED = {
    "unknown section": (
        section("/**/afm_simulator", "run.duration: 1.0"),
        ("unknown section /**/afm_simulator", "afm_sim_node, afm_controller_node"),
    ),
    "section of another instrument's node": (
        section("/elsewhere/afm_sim_node", "run.duration: 1.0"),
        ("section /elsewhere/afm_sim_node",),
    ),
    "section that no node reads because the namespace is missing": (
        section("afm_sim_node", "run.duration: 1.0"),
        ("section afm_sim_node", "/**/afm_sim_node"),
    ),
    "section without ros__parameters": (
        f"{SIMULATOR}:\n  run.duration: 1.0\n",
        (f"section {SIMULATOR} must hold ros__parameters",),
    ),
    "unknown parameter": (
        section(CONTROLLER, "law.alfa: 3.0"),
        ("unknown parameter law.alfa: did you mean law.alpha?",),
    ),
    "parameter out of range": (
        section(CONTROLLER, "law: {alpha: -1.0}"),
        ("law.alpha = -1.0 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",),
    ),
    "parameter that is no number": (
        section(CONTROLLER, "law.alpha: .nan"),
        ("law.alpha = nan is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",),
    ),
    "yes for a number": (
        section(CONTROLLER, "law.alpha: yes"),
        ("law.alpha = True is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",),
    ),
    "parameter that is no choice": (
        section(CONTROLLER, "law.kind: lqr"),
        ("law.kind = lqr is not allowed: there is no law lqr: it must be one of open_loop, sgn, tanh",),
    ),
    "parameter of the recorder": (
        section("/**/afm_recorder_node", "exchanges: 3"),
        ("exchanges = 3 is not allowed: it must be true or false",),
    ),
    "negative duration": (section(SIMULATOR, "run.duration: -1.0"), ("run.duration = -1.0 s is not allowed",)),
    "step that does not divide the period": (
        section(SIMULATOR, "plant.control_period: 2.5e-6"),
        ("plant.control_period = 2.5e-06 s is not allowed: it must be a multiple of detector.sample_period = 1e-06 s",),
    ),
    "step that would take longer than anybody lives": (
        section(SIMULATOR, "plant.dt: 1.0e-14"),
        (
            "plant.dt = 1e-14 s is not allowed with plant.control_period = 2e-06 s",
            "a control tick would have 2e+08 integration steps, and 10000000 are the most",
        ),
    ),
    "period with more samples than there is memory": (
        section(SIMULATOR, "plant.control_period: 1.0e+9", "plant.dt: 1.0e-6"),
        ("plant.control_period = 1e+09 s: a control tick would have 1e+15 integration steps",),
    ),
    "period beyond every instrument": (
        section(SIMULATOR, "plant.control_period: 1.0e+10"),
        ("plant.control_period = 10000000000.0 s is not allowed: it must be a finite number >= 1e-15 and <= 1e+09",),
    ),
    "period with more samples than are kept": (
        section(SIMULATOR, "plant.control_period: 0.2"),
        ("detector.sample_period = 1e-06 s is not allowed", "would have 2e+05 samples, and 100000 are the most"),
    ),
    "sample that the tip cannot touch in one point": (
        section(SIMULATOR, "contact.R: 1.0e-5"),
        ("the tip cannot touch the sample in one point", "contact.R = 1e-05 m", "must be > 0"),
    ),
    "no YAML": (f"{SIMULATOR}: [1, 2", ("is no readable YAML file",)),
    "no parameter file": ("- 1\n- 2\n", ("is no parameter file",)),
    "no text": ("\udcff\udcfe", ("is no readable YAML file",)),
}


@pytest.mark.parametrize("name", NOT_ALLOWED)
def test_scenario_that_is_not_allowed_is_refused_with_the_file_the_value_and_what_is_allowed(
    name: str, tmp_path: Path
) -> None:
    text, told = NOT_ALLOWED[name]
    path = tmp_path / "scenario.yaml"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ScenarioError) as refused:
        read_scenario(str(path))
    sentence = str(refused.value)
    assert "\n" not in sentence
    for part in (str(path), *told):
        assert part in sentence


# Sessions, as they are started.


@dataclass(frozen=True)
class Case:
    """A session that must be refused; `told` are parts of its sentence.

    What is refused before any node is started is refused in one process, by the entry point of the session, one after
    the other; one that gets as far as `starts_nodes`, and the one with `alone`, in a process of its own.
    """

    told: tuple[str, ...]
    text: str | None = None
    name: str = "closed_loop_tanh"
    out: str = "out"
    controller: str | None = None
    code: int = 2
    starts_nodes: bool = False
    alone: bool = False
    options: tuple[str, ...] = ()


CASES = {
    "unknown scenario": Case(
        ("unknown scenario closed_loop_tahn", ", ".join(scenario_names())),
        name="closed_loop_tahn",
        alone=True,
    ),
    "folder as scenario": Case(("unknown scenario /tmp", "it must be one of", "or a file"), name="/tmp"),
    "parameter out of range": Case(
        ("law.alpha = -1.0 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",),
        section(CONTROLLER, "law.alpha: -1.0"),
    ),
    "no duration": Case(("run.duration = 0", "it must be > 0 s"), section(CONTROLLER, "law.alpha: 3.0")),
    "sample that the tip does not reach": Case(
        ("the tip does not touch the sample at rest", "cantilever.a", "must be >"),
        section(SIMULATOR, "run.duration: 0.001", "cantilever.W: -1.0e-6"),
    ),
    "out below a file": Case(("--out", "a_file/out", "must be a folder"), out="a_file/out", code=1),
    "out is a file": Case(("--out", "a_file", "must be a folder"), out="a_file", code=1),
    "folder where the recording goes": Case(
        ("used/recording.rrd is a folder: it must be a file, or not be there",), out="used", code=1
    ),
    "stall timeout below zero": Case(
        ("--stall-timeout -1 s is not allowed: it must be >= 0 s",), options=("--stall-timeout", "-1")
    ),
    "section given twice": Case(
        ("the name run.duration is given twice (line 4)",), section(SIMULATOR, "run.duration: 0.1", "run.duration: 0.2")
    ),
    "controller that does not exist": Case(
        ("controller could not be started: no_such_program", "No such file"),
        controller="no_such_program",
        code=1,
        starts_nodes=True,
    ),
    "controller that ends by itself": Case(
        ('controller ended with code 1; last line it printed: "nothing to say"',),
        controller="sh -c 'echo nothing to say; exit 1'",
        code=1,
        starts_nodes=True,
    ),
    "controller that is no command": Case(("--controller", "'unbalanced"), controller="python 'unbalanced"),
    "controller of blanks": Case(("--controller",), controller="  "),
}


@dataclass(frozen=True)
class End:
    code: int
    printed: str
    folder: Path
    before: set[str]


def listing(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


IN_TURN = """
import contextlib, io, json, sys
from afm_bringup.session_command import main

ends = []
for arguments in json.loads(sys.argv[1]):
    sys.argv[1:] = arguments
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            code = main()
        except SystemExit as end:
            code = end.code
    ends.append((code, printed.getvalue()))
print(json.dumps(ends))
"""


def refused_in_turn(arguments: list[list[str]]) -> list[tuple[int, str]]:
    """Exit code and output of the session's entry point for each of several command lines."""
    command = [sys.executable, "-c", IN_TURN, json.dumps(arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    return [(code, printed) for code, printed in json.loads(done.stdout)]


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, End]:
    """All cases."""
    base = tmp_path_factory.mktemp("bad_input")
    arguments, found = {}, {}
    for name, case in CASES.items():
        folder = base / name
        folder.mkdir()
        (folder / "a_file").write_text("")
        (folder / "used" / "recording.rrd").mkdir(parents=True)
        scenario = case.name
        if case.text is not None:
            (folder / "scenario.yaml").write_text(case.text)
            scenario = str(folder / "scenario.yaml")
        options = [*case.options, *([] if case.controller is None else ["--controller", case.controller])]
        arguments[name] = [scenario, "--out", str(folder / case.out), *options]
        found[name] = End(-1, "", folder, listing(folder))
    together = [name for name, case in CASES.items() if not (case.starts_nodes or case.alone)]
    refused = dict(zip(together, refused_in_turn([arguments[name] for name in together]), strict=True))
    for name in CASES:
        if name not in refused:
            scenario, _, out, *options = arguments[name]
            printed = base / f"printed: {name}"
            printed.mkdir()
            with session(scenario, Path(out), *options, folder=printed) as command:
                try:
                    refused[name] = (command.wait(), command.text)
                except TimeoutError:  # taken for good: one test has to fail, not all
                    refused[name] = (-1, command.text)
    return {name: End(*refused[name], end.folder, end.before) for name, end in found.items()}


@pytest.mark.parametrize("name", CASES)
def test_session_is_refused_in_one_sentence_and_nothing_is_written(ends: dict[str, End], name: str) -> None:
    case, end = CASES[name], ends[name]
    lines = [line for line in end.printed.strip().splitlines() if not PORT_LEFT.search(line)]
    assert [line for line in lines if not line.startswith("error: ")] == [], end.printed
    assert len(lines) == 1, end.printed
    for part in case.told:
        assert part in lines[0]
    assert end.code == case.code
    written = {path for path in listing(end.folder) - end.before if "/logs" not in path}
    # The folder and the logs of the nodes may stay, to look at.
    assert written <= ({"out"} if case.starts_nodes else set())


def test_no_refused_session_leaves_anything_running(ends: dict[str, End]) -> None:
    assert len(ends) == len(CASES)
    assert_nothing_left()
