"""Claims about requests that are none: an error or an orderly end of the connection, and the instrument goes on."""

import random
import socket
import struct
import threading
from contextlib import suppress

import pytest

from afm_nanonis.table import COMMANDS

from .client import Client, Refused, until
from .conftest import Served

LENGTHS = [-1, -(2**31), 2**31 - 1, 1 << 25]
QUIET = {
    "Scan.Action",
    "ZSpectr.Start",
    "BiasSpectr.Start",
    "ZCtrl.Withdraw",
    "Osci1T.DataGet",
    "Osci2T.DataGet",
    "TCPLog.Start",
}
QUIET |= {
    "ZCtrl.OnOffSet",
    "ZCtrl.Home",
    "FolMe.XYPosSet",
    "PLLFreqSwp.Start",
    "AutoApproach.OnOffSet",
    "Bias.Pulse",
    "Util.SessionPathSet",
    "Scan.WaitEndOfScan",
    "Scan.WaitEndOfLine",
}
"""Not sent with bodies of chance: they take time, or leave something behind."""


def alive(served: Served) -> None:
    with served.client() as client:
        assert client.call("Util.VersionGet", returns="S S I I")[1] == "Generic 5"


@pytest.mark.parametrize("length", LENGTHS)
def test_impossible_length_is_an_error_and_ends_this_connection_alone(served: Served, length: int) -> None:
    with served.client() as client:
        client.socket.sendall(b"Bias.Set".ljust(32, b"\0") + struct.pack(">iHH", length, 1, 0))
        head = client.received(40)
        body = client.received(struct.unpack_from(">i", head, 32)[0])
        assert struct.unpack_from(">I", body) == (1,)
        assert b"a body of" in body
        assert client.socket.recv(1) == b""
    alive(served)


def test_body_that_is_cut_is_an_error_and_the_next_request_is_answered(client: Client) -> None:
    for name, body in (
        ("Bias.Set", b"\0\0"),
        ("Signals.ValsGet", struct.pack(">i", 1000)),
        ("FolMe.XYPosSet", b"x" * 7),
    ):
        with pytest.raises(Refused, match="its body ends"):
            body_of(client, name, body)
    assert client.call("Bias.Get", returns="f")


def body_of(client: Client, name: str, body: bytes) -> None:
    """Raises what the response says: its error stands at the end, whatever is before."""
    answer = client.raw(name, body)
    at = answer.find(b"Error in command")
    if at >= 0:
        raise Refused(answer[at:].decode())


def test_body_that_is_too_long_is_read_as_far_as_it_is_known(client: Client) -> None:
    body_of(client, "Bias.Set", struct.pack(">f", 0.5) + b"more" * 1000)
    assert client.call("Bias.Get", returns="f") == [0.5]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 3e38])
@pytest.mark.parametrize(
    "name", ["ZCtrl.SetpntSet", "ZCtrl.ZPosSet", "FolMe.SpeedSet", "Scan.SpeedSet", "Piezo.RangeSet"]
)
def test_numbers_that_are_none_are_refused_or_left_alone(
    served: Served, client: Client, name: str, value: float
) -> None:
    before = served.front.ranges
    count = sum(f.type == "f" for f in COMMANDS[name].arguments)
    with suppress(Refused):
        body_of(client, name, struct.pack(f">{count}f", *[value] * count))
    served.front.ranges = before
    served.front.follow_speed = 2e-6
    client.call("ZCtrl.LimitsEnabledSet", "I", 0)
    state = served.microscope.state
    assert abs(state.setpoint) < 10.0
    assert all(speed > 0.0 for speed in served.front.scan.speeds)


@pytest.mark.parametrize("count", [2000, pytest.param(20000, marks=pytest.mark.long)])
def test_malformed_requests_are_answered_or_end_their_connection(served: Served, count: int) -> None:
    chance = random.Random(count)
    names = sorted(set(COMMANDS) - QUIET)
    made = 0
    client = served.client()
    before = served.microscope.backend.time  # type: ignore[attr-defined]
    for _ in range(count):
        name = chance.choice(names)
        if chance.random() < 0.2:
            name = "".join(chr(chance.randrange(33, 126)) for _ in range(chance.randrange(1, 31)))
        body = chance.randbytes(chance.choice([0, 1, 3, 4, 7, 8, 16, 40, 200]))
        try:
            client.raw(name, body)
        except ConnectionError:
            client.socket.close()
            client = served.client()
        made += 1
    client.socket.close()
    assert made == count
    alive(served)
    assert served.microscope.backend.time > before  # type: ignore[attr-defined]
    with served.client() as again:
        again.call("ZCtrl.LimitsEnabledSet", "I", 0)
        served.front.ranges = [10e-6, 10e-6, 10e-6]


def test_garbage_and_half_requests_leave_the_other_clients_alone(served: Served) -> None:
    chance = random.Random(2)
    with served.client() as good:
        for _ in range(50):
            with socket.create_connection(("127.0.0.1", served.server.ports[1])) as bad:
                bad.sendall(chance.randbytes(chance.randrange(1, 200)))
        assert good.call("Bias.Get", returns="f")
    alive(served)


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.long)])
def test_many_connections_are_served_or_closed_and_a_later_one_is_served(served: Served, count: int) -> None:
    open_ones = []
    for _ in range(count):
        open_ones.append(socket.create_connection(("127.0.0.1", served.server.ports[1]), 30.0))
    for each in open_ones:
        each.close()

    def served_again() -> bool:
        with suppress(ConnectionError):
            alive(served)
            return True
        return False

    until(served_again)
    until(lambda: sum(thread.name == "afm_nanonis" for thread in threading.enumerate()) <= 10)


def test_client_that_is_gone_in_a_scan_leaves_the_scan_to_the_others(served: Served, engaged: Client) -> None:
    engaged.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 100e-9, 100e-9, 0.0)
    engaged.call("Scan.BufferSet", "*i i i", [14], 16, 1000)
    engaged.call("Scan.SpeedSet", "f f f f H f", 0.0, 0.0, 0.05, 0.05, 2, 1.0)
    gone = served.client(1)
    gone.call("Scan.Action", "H I", 0, 1)
    # Without a word, with an answer on its way.
    gone.socket.sendall(b"Scan.WaitEndOfLine".ljust(32, b"\0") + struct.pack(">iHHi", 4, 1, 0, -1))
    gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    gone.socket.close()
    assert engaged.call("Scan.StatusGet", returns="I") == [1]
    engaged.call("Scan.Action", "H I", 1, 0)
    assert served.microscope.state.approached
