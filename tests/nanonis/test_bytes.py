"""Claims about requests and responses byte by byte, and about the table."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import afm_nanonis
from afm_nanonis import server  # noqa: F401  # and all handlers
from afm_nanonis.codec import ProtocolError, arguments, failure, success
from afm_nanonis.handlers import HANDLERS
from afm_nanonis.settings import Settings
from afm_nanonis.table import COMMANDS, REAL, STORED, USED, CommandRow

from .client import Client, Refused, unpacked
from .conftest import Served


def name(text: str) -> bytes:
    return text.encode().ljust(32, b"\0")


def test_answer_to_a_setting_is_48_bytes_of_name_length_and_no_error(client: Client) -> None:
    client.socket.sendall(name("Bias.Set") + bytes.fromhex("00000004 0001 0000 3fc00000"))
    assert client.received(48) == name("Bias.Set") + bytes.fromhex("00000008 00000000 00000000 00000000")
    assert client.raw("Bias.Get") == bytes.fromhex("3fc00000 00000000 00000000")


def test_two_names_are_the_37_bytes_of_the_protocol() -> None:
    answer = success(COMMANDS["Signals.NamesGet"], name("Signals.NamesGet"), [["Z (m)", "Bias (V)"]])
    wanted = "00000015 00000002 00000005 5a20286d29 00000008 4269617320285629 00000000 00000000"
    assert answer[40:] == bytes.fromhex(wanted)
    assert struct.unpack_from(">i", answer, 32) == (37,)


def test_image_is_sent_row_by_row() -> None:
    image = np.arange(6.0).reshape(2, 3)
    answer = success(COMMANDS["Scan.FrameDataGrab"], name("Scan.FrameDataGrab"), ["Z (m)", image, 1])
    assert answer[40:] == struct.pack(">i5sii6fIIi", 5, b"Z (m)", 2, 3, *range(6), 1, 0, 0)


def test_error_has_the_declared_values_first_or_stands_alone() -> None:
    sentence = b"Error in command: ztest: no reason"
    section = struct.pack(">Ii", 1, len(sentence)) + sentence
    command = COMMANDS["Scan.FrameDataGrab"]
    assert failure(command, name("ZTest"), "no reason")[40:] == struct.pack(">iiiI", 0, 0, 0, 0) + section
    assert failure(command, name("ZTest"), "no reason", real=True)[40:] == section
    assert failure(None, name("ZTest"), "no reason")[40:] == section


def test_request_without_an_answer_has_none_and_the_next_one_is_answered(client: Client) -> None:
    client.raw("Bias.Set", struct.pack(">f", 0.25), answered=0)
    client.raw("No.Such", answered=0)
    assert client.call("Bias.Get", returns="f") == [0.25]


def test_command_that_does_not_exist_is_an_error_and_the_connection_stays(client: Client) -> None:
    with pytest.raises(Refused, match=r"Error in command: kelvinctrl\.ctrlonoffget: Module not available"):
        client.call("KelvinCtrl.CtrlOnOffGet")
    with pytest.raises(Refused):
        client.call("bias.get")
    assert client.call("Util.VersionGet", returns="S S I I")[2] > 14000


def test_every_real_command_has_a_handler_and_no_other() -> None:
    real = {each.name for each in COMMANDS.values() if each.how == REAL}
    assert real == set(HANDLERS)
    assert len(COMMANDS) > 310


def test_settings_that_the_page_says_are_used_are_those_that_other_commands_read() -> None:
    source = "".join(path.read_text() for path in Path(afm_nanonis.__file__).parent.glob("*.py"))
    read = set(re.findall(r'kept\("([\w.]+?)(?:Get|Set)"|COMMANDS\["([\w.]+)Get"\]|\w: "([\w.]+)Get"', source))
    # What a third command of the same setting gives back is no use of it.
    given_back = {"Piezo.Sens", "DataLog.Props"}
    assert {"".join(each) for each in read} - given_back == {x.setting for x in COMMANDS.values() if x.how == USED}


@pytest.mark.parametrize("command", [each for each in COMMANDS.values() if each.how in STORED and each.sets])
def test_kept_setting_is_given_back_as_it_was_set(command: CommandRow) -> None:
    settings = Settings()
    get = COMMANDS.get(command.name[:-3] + "Get")
    if get is None or get.how not in STORED:
        return
    values: list[object] = []
    for field in command.arguments:
        of_type = {"S": "some text", "SA": ["a", "b"]}.get(field.type, 1 if field.type in "HhIi" else 0.25)
        values.append([of_type] * 3 if field.many else of_type)
    settings.serve(command, arguments(command, encoded(command, values)))
    indices = [value for field, value in zip(command.arguments, values, strict=True) if field.index]
    found = settings.serve(get, indices)
    answer = success(get, name(get.name), found)
    own = [(f, v) for f, v in zip(command.arguments, values, strict=True) if not f.index]
    for back, (field, value) in zip(found, own, strict=False):
        assert back == (value - 1 if field.flag == "<" else value), field  # type: ignore[operator]
    assert answer[40:-8] == encoded(get, found, returns=True)


def encoded(command: CommandRow, values: list[object], *, returns: bool = False) -> bytes:
    """Independent of the codec: numbers by struct."""
    found = b""
    for field, value in zip(command.returns if returns else command.arguments, values, strict=True):
        if field.type in ("S", "SA"):
            texts = value if field.type == "SA" else [value]
            each = b"".join(struct.pack(">i", len(text)) + text.encode() for text in texts)  # type: ignore[attr-defined, arg-type]
            found += (struct.pack(">ii", 4 * len(texts), len(texts)) if field.type == "SA" else b"") + each  # type: ignore[arg-type]
        elif field.many:
            count = struct.pack(">i", len(value)) if field.many == "*" else b""  # type: ignore[arg-type]
            found += count + struct.pack(f">{len(value)}{field.type}", *value)  # type: ignore[arg-type, misc]
        else:
            found += struct.pack(f">{field.type}", value)
    return found


def test_setting_keeps_what_says_so_and_what_is_left_out(client: Client) -> None:
    timing = "f f f f f f f"
    before = client.call("ZSpectr.TimingGet", returns=timing)
    nan = float("nan")
    client.call("ZSpectr.TimingSet", "f f f", nan, 0.5, nan)
    after = client.call("ZSpectr.TimingGet", returns=timing)
    assert after == [before[0], 0.5, *before[2:]]
    client.call("ZSpectr.TimingSet", timing, *before)
    # 1 is on, 2 is off, 0 leaves it; the Get has 1 and 0.
    for flag, wanted in ((1, 1), (0, 1), (2, 0), (0, 0)):
        client.call("SafeTip.OnOffSet", "H", flag)
        assert client.call("SafeTip.OnOffGet", returns="H") == [wanted]
    client.call("ZSpectr.Retract2ndSet", "i f i H", 3, 0.5, -1, 2)
    assert client.call("ZSpectr.RetractSecondGet", returns="i f i H") == [2, 0.5, 1, 0]


def test_settings_of_an_index_are_its_own(client: Client) -> None:
    client.call("LockIn.ModAmpSet", "i f", 1, 0.5)
    client.call("LockIn.ModAmpSet", "i f", 2, 0.75)
    assert [client.call("LockIn.ModAmpGet", "i", number, returns="f")[0] for number in (1, 2)] == [0.5, 0.75]


@given(st.sampled_from(sorted(COMMANDS)), st.binary(max_size=80))
def test_any_body_is_read_or_refused_in_a_sentence(command: str, body: bytes) -> None:
    told = ""
    try:
        assert len(arguments(COMMANDS[command], body)) <= len(COMMANDS[command].arguments)
    except ProtocolError as error:
        told = str(error)
    assert "\n" not in told


def test_texts_of_clients_with_a_wrong_size_are_read(served: Served, client: Client) -> None:
    client.call("Scan.PropsSet", "I I I S S SA I", 0, 0, 0, "", "", ["Bias", "Current"], 0)
    # Behind the modules: parameters of each, a table of two rows without columns.
    found = client.call("Scan.PropsGet", returns="I I I S S SA *i i i I")
    assert found[5:9] == [["Bias", "Current"], [0, 0], 2, 0]
    served.front.scan.modules = []


def test_every_answer_can_be_unpacked_to_its_end() -> None:
    values: dict[str, object] = {"S": "x", "SA": ["x", "yz"], "M": np.ones((2, 2)), "T": []}
    for command in COMMANDS.values():
        sent = [[1, 2] if f.many else values.get(f.type, 1) for f in command.returns]
        body, at = success(command, name(command.name), sent)[40:], 0
        for field in command.returns:
            if field.many == "=":
                at += struct.calcsize(f">2{field.type}")
            else:
                _, at = unpacked(field.many + field.type, body, at)
        assert body[at:] == bytes(8)
