"""Records that no recorder writes are refused in a sentence, whatever is in them."""

from pathlib import Path
from typing import Any

import pytest
import recorded
from afm_msgs.msg import ControlTrace, Event, Parameters
from rcl_interfaces.msg import Parameter, ParameterValue
from recorded import Run

from afm_bringup import identify_command, replay_command
from afm_recorder_node import inspect_command
from afm_recorder_node.definitions import definition, serialized
from afm_recorder_node.growing import GrowingFile
from afm_recorder_node.reader import read_recording
from afm_recorder_node.record_writer import RecordWriter

EVENT = serialized(Event(run_id=1, text="x" * 8))
TRACE = "afm_msgs/msg/ControlTrace"
KINDS = {
    "a type of parameter that does not exist": [
        ("parameters", Parameters(parameters=[Parameter(name="a", value=ParameterValue(type=200))]))
    ],
    "columns of different lengths": [("control_trace", ControlTrace(control_period=1e-3, deflection=[0.0] * 3))],
    "a period below 0": [("deflection", recorded.waveform(0, [1.0], period=-1e-6))],
    "two units": [("deflection", recorded.waveform(k, [1.0], unit)) for k, unit in enumerate(("m", "N"))],
    "a line without channels": [("scan_line", recorded.line_message(recorded.lines_of()[0])[1].__class__())],
}
BYTES = {
    "text that is none": ("afm_msgs/msg/Event", None, EVENT.replace(b"xxxx", b"\xff\xff\xff\xff")),
    "bytes that are too few": ("afm_msgs/msg/Event", None, EVENT[:20]),
    "bytes that are too many": ("afm_msgs/msg/Event", None, EVENT + bytes(100)),
    "no bytes": ("afm_msgs/msg/Event", None, b""),
    "a length of 4 GB": (TRACE, None, bytes.fromhex("00010000") + b"\xff" * 40),
    "a definition that is none": ("afm_msgs/msg/Event", "}{ is not a message", EVENT),
    "a definition of other fields": ("afm_msgs/msg/Event", "float64 text", EVENT),
    "a definition without its parts": ("afm_msgs/msg/Event", "std_msgs/Header header", EVENT),
}


def refused(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for main in (inspect_command.main, replay_command.main, identify_command.main):
        assert main([str(path)]) in (1, 2)
        told = capsys.readouterr().err
        assert told.startswith("error: ") and told.count("\n") == 1 and len(told) < 1000, told
        assert str(path) in told


@pytest.mark.parametrize("what", KINDS)
def test_messages_that_no_instrument_sends_are_refused(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(recorded.record(tmp_path / "run.mcap", [*Run(20).messages(), *KINDS[what]]), capsys)


@pytest.mark.parametrize("what", BYTES)
def test_bytes_that_are_no_message_are_refused(what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kind, text, data = BYTES[what]
    writer = RecordWriter(
        GrowingFile(tmp_path / "run.mcap"), lambda kind: text or definition(kind), {"namespace": "/afm"}
    )
    writer.put("events" if "Event" in kind else "control_trace", kind, 0, 0, data)
    refused(writer.close({"missing": ""}), capsys)


def test_every_value_that_a_parameter_of_a_node_has_comes_back(tmp_path: Path) -> None:
    values: dict[str, Any] = {"1e5": "1e5", "a": "1:30", "c": [1.5, 2.5], "e": True, "f": -(2**63), "g": float("inf"),
                              "h": "no", "i": "a\nb\x1b", "j": ["1", "x"], "k": [True], "l": [1]}  # fmt: skip
    name, message = recorded.parameters("node", values | {"bytes": [b"\x01", b"\xff"]})
    empty = Parameter(name="b", value=ParameterValue(type=9))
    message.node, message.parameters = "/my/node", [*message.parameters, empty]
    path = recorded.record(tmp_path / "run.mcap", [(name, message), *Run(20).block(0, 20)])
    assert read_recording(path).parameters == {"/my/node": values | {"bytes": [1, 255], "b": []}}


def test_what_a_recorder_says_is_missing_reaches_no_terminal_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = recorded.record(tmp_path / "run.mcap", Run(20).messages(), {"missing": "\x1b[2Jall"})
    assert inspect_command.main([str(path)]) == 0
    told = "".join(capsys.readouterr())
    assert "NOT COMPLETE: \\x1b[2Jall" in told and "\x1b" not in told
