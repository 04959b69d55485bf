"""Claims about several clients at one time: commands in quick succession, and clients that are gone."""

import socket
import struct
import threading
from contextlib import suppress

import pytest

from .client import Client, Refused, until
from .conftest import Served

VERTICAL = 1


def gone(client: Client) -> None:
    """End a connection as that of a process that is killed."""
    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.socket.close()


def held_at_the_setpoint(served: Served, client: Client) -> bool:
    """Whether the tip is on the sample, the feedback on, and the deflection as it was set."""
    (setpoint,) = client.call("ZCtrl.SetpntGet", returns="f")
    (now,) = client.call("Signals.ValGet", "i I", VERTICAL, 1, returns="f")
    state = served.microscope.state
    return (
        state.approached and state.feedback == "on" and not served.front.jobs.doing and abs(now / setpoint - 1) < 0.02
    )


def test_client_that_is_gone_in_a_spectrum_leaves_the_tip_at_the_setpoint(served: Served, engaged: Client) -> None:
    engaged.call("ZSpectr.RangeSet", "f f", 100e-9, -300e-9)
    engaged.call("ZSpectr.PropsSet", "H i H H H H", 1, 500, 1, 2, 0, 0)
    engaged.call("ZSpectr.TimingSet", "f f f f f f f", 0.0, 0.002, 1.0, 0.0, 5e-4, 0.0, 0.0)
    engaged.call("ZSpectr.RetractSet", "H f i H", 1, 8.0, VERTICAL, 0)
    killed = served.client(1)
    killed.socket.sendall(b"ZSpectr.Start".ljust(32, b"\0") + struct.pack(">iHHIi", 8, 1, 0, 1, 0))
    # In the middle of it, pressed.
    until(lambda: engaged.call("Signals.ValGet", "i I", VERTICAL, 1, returns="f")[0] > 6.5)
    gone(killed)
    until(lambda: held_at_the_setpoint(served, engaged))


def test_starts_and_stops_of_two_clients_in_quick_succession_end_with_the_tip_at_the_setpoint(
    served: Served, engaged: Client
) -> None:
    engaged.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 100e-9, 100e-9, 0.0)
    engaged.call("Scan.BufferSet", "*i i i", [14], 16, 100)
    engaged.call("Scan.SpeedSet", "f f f f H f", 0.0, 0.0, 0.02, 0.02, 2, 1.0)

    def operate(number: int) -> None:
        with served.client(number) as client:
            for _ in range(5):
                # Refused where the other one has a scan running.
                with suppress(Refused):
                    client.call("Scan.Action", "H I", 0, number % 2)
                with suppress(Refused):
                    client.call("FolMe.XYPosSet", "d d I", 20e-9 * number, 0.0, 0)
                client.call("Scan.Action", "H I", 1, 0)

    clients = [threading.Thread(target=operate, args=(number,)) for number in (1, 2)]
    for each in clients:
        each.start()
    for each in clients:
        each.join(60.0)
        assert not each.is_alive()
    until(lambda: held_at_the_setpoint(served, engaged))
    assert engaged.call("Scan.StatusGet", returns="I") == [0]


def test_client_that_is_gone_while_the_tip_is_withdrawn_leaves_it_to_the_end(served: Served, engaged: Client) -> None:
    killed = served.client(1)
    killed.socket.sendall(b"ZCtrl.Withdraw".ljust(32, b"\0") + struct.pack(">iHHIi", 8, 1, 0, 1, -1))
    until(lambda: engaged.call("ZCtrl.StatusGet", returns="H") == [6])
    gone(killed)
    until(lambda: not served.front.jobs.doing)
    (z,) = engaged.call("ZCtrl.ZPosGet", returns="f")
    assert z == pytest.approx(served.front.z_limits[0], abs=1e-9)
