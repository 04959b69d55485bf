"""Texts in a recording of somebody else are read by the strict reader: one that is none is refused in a sentence."""

from contextlib import closing
from pathlib import Path

import pytest
import rerun as rr
from recorded import Run

from afm_bringup import identify_command, replay_command
from afm_recorder_node import inspect_command, layout
from afm_recorder_node.reader import read_recording
from afm_recorder_node.writer import RecordingWriter

BOMB = "a0: &a0 [0, 0]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 31))
UNREADABLE = {
    "a list": "[1, 2]",
    "null": "null",
    "nothing": "",
    "text": "hello",
    "a section that is null": "afm_sim_node: null",
    "parameters that are null": "afm_sim_node: {ros__parameters: null}",
    "a value that is null": "afm_sim_node: {ros__parameters: {a: null}}",
    "deep": "a: " + "[" * 200_000,
    "deep sections": "".join(" " * i + "a:\n" for i in range(1000)),
    "a bomb": BOMB,
    "a bomb below": "afm_sim_node:\n ros__parameters:\n" + "".join(f"  {line}\n" for line in BOMB.splitlines()),
    "huge": "afm_sim_node: {ros__parameters: {a: " + "x" * 2_000_000 + "}}",
    "a long number": "afm_sim_node: {ros__parameters: {a: " + "9" * 10_000 + "}}",
    "a tag": "afm_sim_node: !!python/object/apply:os.system ['true']",
    "twice": "afm_sim_node: {ros__parameters: {a: 1}}\nafm_sim_node: {ros__parameters: {a: 2}}",
    "control characters": "a: \x01",
    "not YAML": "{a: [",
}


@pytest.mark.parametrize(
    ("entity", "what"),
    [
        *((entity, what) for entity in (layout.PARAMETERS, layout.SCORE) for what in UNREADABLE),
        *(("change", what) for what in UNREADABLE if what != "nothing"),
    ],
)
def test_texts_of_a_recording_that_no_recorder_writes_are_refused_in_a_sentence(
    entity: str, what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, text = tmp_path / "run.rrd", UNREADABLE[what]
    with closing(RecordingWriter(path)) as writer:
        Run(20).write(writer, 0, 20)
        if entity == "change":
            writer._sink.event(10, "changed", change=text)
        else:
            writer._sink.static(entity, rr.TextDocument(text))
    commands = [
        (inspect_command.main, [str(path)]),
        (replay_command.main, [str(path)]),
        (identify_command.main, [str(path)]),
    ]
    for main, arguments in commands:
        assert main(arguments) in (1, 2)
        told = capsys.readouterr().err
        assert told.startswith("error: ") and told.count("\n") == 1 and len(told) < 1000, told
        assert str(path) in told and "cannot be read" in told
    assert inspect_command.main([str(path), "--table"]) == 1
    assert "cannot be read" in " ".join(capsys.readouterr().out.split())  # a table wraps its lines


def test_every_value_that_a_parameter_of_a_node_has_comes_back(tmp_path: Path) -> None:
    same = [1.5, 2.5]
    values = {"1e5": "1e5", "a": "1:30", "b": [], "c": same, "d": same, "e": True, "f": -(2**63), "g": float("inf"),
              "h": "no", "i": "a\nb\x1b", "j": ["1", "x"]}  # fmt: skip
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        writer.parameters("/my/node", values | {"bytes": [b"\x01", b"\xff"]})
        Run(20).write(writer, 0, 20)
    assert read_recording(tmp_path / "run.rrd").parameters == {"/my/node": values | {"bytes": [1, 255]}}
