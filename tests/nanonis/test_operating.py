"""Claims about the microscope as a client of the protocol operates it: Z, feedback, moves, scans, spectra, files."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from afm_model.files import read_curve, read_scan
from afm_model.microscope import Microscope

from .client import Client, Refused, until
from .conftest import Served

Z, VERTICAL, HORIZONTAL = 14, 1, 2


def z(client: Client) -> float:
    return float(client.call("ZCtrl.ZPosGet", returns="f")[0])


def test_names_units_and_values_of_the_signals_belong_together(engaged: Client) -> None:
    (names,) = engaged.call("Signals.NamesGet", returns="SA")
    assert len(names) == 128
    assert (names[14], names[24], names[0]) == ("Z (m)", "Bias (V)", "Current (A)")
    (setpoint,) = engaged.call("ZCtrl.SetpntGet", returns="f")
    assert names[VERTICAL] == "Vert. Deflection (V)"
    until(lambda: abs(engaged.call("Signals.ValGet", "i I", 1, 1, returns="f")[0] / setpoint - 1.0) < 1e-3)
    values = engaged.call("Signals.ValsGet", "*i I", [VERTICAL, Z, 24], 1, returns="*f")[0]
    assert values[1] == pytest.approx(z(engaged), abs=2e-10)
    with pytest.raises(Refused, match="signal 128 is not allowed"):
        engaged.call("Signals.ValGet", "i I", 128, 0, returns="f")


def test_z_is_larger_farther_from_the_sample_and_has_no_effect_while_the_controller_is_on(engaged: Client) -> None:
    on = z(engaged)
    engaged.call("ZCtrl.ZPosSet", "f", on + 200e-9)
    assert abs(z(engaged) - on) < 5e-9
    engaged.call("ZCtrl.OnOffSet", "I", 0)
    until(lambda: engaged.call("ZCtrl.OnOffGet", returns="I") == [0])
    engaged.call("ZCtrl.ZPosSet", "f", on + 200e-9)
    assert z(engaged) == pytest.approx(on + 200e-9, abs=1e-12)
    # The cantilever is free there.
    assert abs(engaged.call("Signals.ValGet", "i I", VERTICAL, 1, returns="f")[0]) < 1e-3
    engaged.call("ZCtrl.OnOffSet", "I", 1)
    until(lambda: abs(z(engaged) - on) < 5e-9)
    assert engaged.call("ZCtrl.StatusGet", returns="H") == [2]


def test_switching_off_lifts_the_tip(engaged: Client) -> None:
    engaged.call("ZCtrl.SwitchOffDelaySet", "f", 0.01)
    engaged.call("ZCtrl.TipLiftSet", "f", 100e-9)
    on = z(engaged)
    engaged.call("ZCtrl.OnOffSet", "I", 0)
    until(lambda: engaged.call("ZCtrl.OnOffGet", returns="I") == [0])
    until(lambda: z(engaged) == pytest.approx(on + 100e-9, abs=3e-9))
    engaged.call("ZCtrl.TipLiftSet", "f", 0.0)
    engaged.call("ZCtrl.SwitchOffDelaySet", "f", 0.0)


def test_setpoint_and_gains_are_given_back_to_the_last_bit_and_in_force(served: Served, engaged: Client) -> None:
    before = engaged.call("ZCtrl.SetpntGet", returns="f")[0]
    gains = engaged.call("ZCtrl.GainGet", returns="f f f")
    engaged.call("ZCtrl.SetpntSet", "f", 3.1)
    assert engaged.call("ZCtrl.SetpntGet", returns="f") == [struct.unpack(">f", struct.pack(">f", 3.1))[0]]
    until(lambda: abs(engaged.call("Signals.ValGet", "i I", 1, 1, returns="f")[0] - 3.1) < 0.1)
    engaged.call("ZCtrl.GainSet", "f f f", 1e-10, 2e-5, 123.0)
    assert engaged.call("ZCtrl.GainGet", returns="f f f") == pytest.approx([1e-10, 2e-5, 5e-6], rel=1e-6)
    assert served.microscope.state.integral_gain == pytest.approx(5e-6)
    engaged.call("ZCtrl.GainSet", "f f f", *gains)
    engaged.call("ZCtrl.SetpntSet", "f", before)


def test_deflection_in_newtons_renames_the_signal_and_setpoint_follows(served: Served, engaged: Client) -> None:
    volts = engaged.call("ZCtrl.SetpntGet", returns="f")[0]
    per_volt = 10e-9 / volts
    engaged.call("BeamDefl.VerConfigSet", "S S f f", "Normal Force", "N", per_volt, 0.0)
    try:
        assert engaged.call("Signals.NamesGet", returns="SA")[0][VERTICAL] == "Normal Force (N)"
        assert engaged.call("ZCtrl.SetpntGet", returns="f")[0] == pytest.approx(10e-9, rel=1e-6)
        engaged.call("ZCtrl.SetpntSet", "f", 15e-9)
        assert served.microscope.state.setpoint == pytest.approx(1.5 * volts, rel=1e-6)
        engaged.call("ZCtrl.SetpntSet", "f", 10e-9)
    finally:
        engaged.call("BeamDefl.VerConfigSet", "S S f f", "Vert. Deflection", "V", 1.0, 0.0)


def test_tip_moves_and_moves_beyond_the_range_are_refused(engaged: Client) -> None:
    engaged.call("FolMe.SpeedSet", "f I", 5e-6, 1)
    engaged.call("FolMe.XYPosSet", "d d I", 120e-9, -80e-9, 1)
    assert engaged.call("FolMe.XYPosGet", "I", 1, returns="d d") == pytest.approx([120e-9, -80e-9], abs=1e-9)
    with pytest.raises(Refused, match="x = 1 m is not allowed"):
        engaged.call("FolMe.XYPosSet", "d d I", 1.0, 0.0, 1)
    # What a sum of sines leaves of 0.
    engaged.call("FolMe.XYPosSet", "d d I", 0.0, 3.5e-31, 1)
    assert engaged.call("FolMe.XYPosGet", "I", 1, returns="d d") == pytest.approx([0.0, 0.0], abs=1e-9)


def test_withdrawal_goes_to_the_upper_limit_and_an_approach_comes_back(served: Served, engaged: Client) -> None:
    on = z(engaged)
    with pytest.raises(Refused, match="the limits of Z are not enabled"):
        engaged.call("ZCtrl.LimitsSet", "f f", 1e-6, -1e-6)
    engaged.call("ZCtrl.LimitsEnabledSet", "I", 1)
    engaged.call("ZCtrl.LimitsSet", "f f", 500e-9, -800e-9)
    assert engaged.call("ZCtrl.LimitsGet", returns="f f") == pytest.approx([500e-9, -800e-9])
    engaged.call("ZCtrl.Withdraw", "I i", 1, -1)
    assert z(engaged) == pytest.approx(500e-9, abs=1e-12)
    assert engaged.call("ZCtrl.OnOffGet", returns="I") == [0]
    engaged.call("AutoApproach.Open")
    engaged.call("AutoApproach.OnOffSet", "H", 1)
    until(lambda: engaged.call("AutoApproach.OnOffGet", returns="H") == [0])
    assert engaged.call("ZCtrl.OnOffGet", returns="I") == [1]
    assert z(engaged) == pytest.approx(on, abs=5e-9)
    engaged.call("ZCtrl.LimitsEnabledSet", "I", 0)


def test_withdrawal_that_is_waited_for_too_short_is_an_error_and_goes_on(served: Served, engaged: Client) -> None:
    engaged.call("ZCtrl.WithdrawRateSet", "f", 4e-6)
    with pytest.raises(Refused, match="not withdrawn after 1 ms"):
        engaged.call("ZCtrl.Withdraw", "I i", 1, 1)
    assert engaged.call("ZCtrl.StatusGet", returns="H") == [6]
    engaged.call("ZCtrl.WithdrawRateSet", "f", 1e-5)
    until(lambda: served.front.jobs.doing == "")
    assert z(engaged) == pytest.approx(served.front.z_limits[0], abs=1e-9)


def frame(client: Client, series: str, lines: int = 12, time_of_line: float = 0.05) -> None:
    """A frame of 200 nm over an edge of the stripes, 30 degrees clockwise, 32 pixels."""
    client.call("Scan.FrameSet", "f f f f f", 20e-9, -10e-9, 200e-9, 100e-9, 30.0)
    client.call("Scan.BufferSet", "*i i i", [Z, VERTICAL, HORIZONTAL], 30, lines)
    client.call("Scan.SpeedSet", "f f f f H f", 0.0, 0.0, time_of_line, time_of_line, 2, 1.0)
    client.call("Scan.PropsSet", "I I I S S SA I", 2, 2, 1, series, "", [], 0)


def grabbed(client: Client, channel: int, way: int = 1) -> tuple[np.ndarray, int]:
    _, rows, upwards = client.call("Scan.FrameDataGrab", "I I", channel, way, returns="S M I")
    return np.array(rows), upwards


@pytest.mark.parametrize("direction", [1, 0])
def test_scan_shows_what_its_file_and_the_verb_show(served: Served, engaged: Client, direction: int) -> None:
    frame(engaged, f"way{direction}")
    assert engaged.call("Scan.BufferGet", returns="*i i i") == [[Z, VERTICAL, HORIZONTAL], 32, 12]
    engaged.call("Scan.Action", "H I", 0, direction)
    assert engaged.call("Scan.StatusGet", returns="I") == [1]
    timed_out, path = engaged.call("Scan.WaitEndOfScan", "i", -1, returns="I S")
    assert (timed_out, Path(path).name) == (0, f"way{direction}0001.sxm")
    image = read_scan(path)
    assert image.scan.direction == ("up" if direction else "down")
    assert math.degrees(image.scan.angle) == pytest.approx(-30.0, rel=1e-6)
    assert (image.scan.centre_x, image.scan.size_x, image.scan.size_y) == pytest.approx((20e-9, 200e-9, 100e-9))
    assert image.units == {"height": "m", "Vert. Deflection": "V", "Horiz. Deflection": "V"}
    for channel, name in ((Z, "height"), (HORIZONTAL, "Horiz. Deflection")):
        for way, number in (("trace", 1), ("retrace", 0)):
            seen, upwards = grabbed(engaged, channel, number)
            # Row 0 at the top of the frame, whichever way the scan went; columns from left to right.
            np.testing.assert_array_equal(seen[::-1].astype(np.float32), image.data[name, way].astype(np.float32))
            assert upwards == direction
    # Friction by the lateral signal: half of it on every second stripe of 100 nm, as the verb finds it.
    trace, retrace = (image.data["Horiz. Deflection", way] for way in ("trace", "retrace"))
    friction = 0.5 * (trace - retrace)
    place = (
        image.scan.centre_x
        + math.cos(image.scan.angle) * image.x[None, :]
        - math.sin(image.scan.angle) * image.y[:, None]
    )
    strong = (place / 100e-9) % 2.0 < 1.0
    inner = np.abs((place / 100e-9) % 1.0 - 0.5) < 0.3
    first, second = (abs(np.median(friction[inner & each])) for each in (strong, ~strong))
    assert min(first, second) / max(first, second) == pytest.approx(0.5, abs=0.03)


def test_scan_is_stopped_on_another_port_with_the_tip_on_the_sample_and_no_file(
    served: Served, engaged: Client
) -> None:
    frame(engaged, "stopped", lines=2000)
    with served.client(1) as waiting:
        engaged.call("Scan.Action", "H I", 0, 1)
        timed_out, line, way, scan_pass = waiting.call("Scan.WaitEndOfLine", "i", -1, returns="I i H i")
        assert (timed_out, scan_pass) == (0, 0)
        assert line >= 1 and way in (0, 1)
        assert waiting.call("Scan.WaitEndOfScan", "i", 10, returns="I S") == [1, ""]
        with pytest.raises(Refused, match="a scan is running: stop it first"):
            engaged.call("ZSpectr.Start", "I S", 1, "", returns="SA M *f")
        with pytest.raises(Refused, match="a scan is running: stop it first"):
            engaged.call("FolMe.XYPosSet", "d d I", 0.0, 0.0, 1)
        until(lambda: np.isfinite(grabbed(engaged, Z)[0]).any())
        seen, _ = grabbed(engaged, Z)
        # Upwards: the rows at the top are not there yet.
        assert np.isnan(seen[0]).all() and np.isfinite(seen[-1]).all()
        engaged.call("Scan.Action", "H I", 1, 1)
        until(lambda: engaged.call("Scan.StatusGet", returns="I") == [0])
        assert waiting.call("Scan.WaitEndOfScan", "i", -1, returns="I S") == [0, ""]
    assert served.microscope.state.approached
    assert not list(served.front.folder.glob("stopped*"))


def test_continuous_scan_goes_on_until_it_is_stopped_and_saves_every_frame(served: Served, engaged: Client) -> None:
    frame(engaged, "again", lines=2, time_of_line=0.03)
    engaged.call("Scan.PropsSet", "I I I", 1, 1, 0)
    engaged.call("Scan.Action", "H I", 0, 1)
    paths = [engaged.call("Scan.WaitEndOfScan", "i", -1, returns="I S")[1] for _ in range(2)]
    until(lambda: len(list(served.front.folder.glob("again*"))) >= 3)
    engaged.call("Scan.Action", "H I", 1, 1)
    engaged.call("Scan.PropsSet", "I I I", 2, 2, 0)
    assert all(paths)
    directions = [read_scan(path).scan.direction for path in sorted(served.front.folder.glob("again*"))]
    # Bouncy: to and fro.
    assert directions[:3] == ["up", "down", "up"]


def test_speed_and_time_of_a_line_belong_together(client: Client) -> None:
    types = "f f f f H f"
    client.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 200e-9, 200e-9, 0.0)
    client.call("Scan.SpeedSet", types, 1e-6, 2e-6, 0.0, 0.0, 1, 1.0)
    assert client.call("Scan.SpeedGet", returns=types) == pytest.approx([1e-6, 2e-6, 0.2, 0.1, 0, 1.0])
    client.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 400e-9, 200e-9, 0.0)
    assert client.call("Scan.SpeedGet", returns=types) == pytest.approx([1e-6, 2e-6, 0.4, 0.2, 0, 1.0])
    client.call("Scan.SpeedSet", types, 0.0, 0.0, 0.1, 0.1, 2, 1.0)
    client.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 200e-9, 200e-9, 0.0)
    assert client.call("Scan.SpeedGet", returns=types) == pytest.approx([2e-6, 2e-6, 0.1, 0.1, 1, 1.0])


def test_scan_off_the_sample_is_level(served: Served, engaged: Client) -> None:
    engaged.call("ZCtrl.Withdraw", "I i", 1, -1)
    frame(engaged, "free", lines=2)
    engaged.call("Scan.Action", "H I", 0, 1)
    _, path = engaged.call("Scan.WaitEndOfScan", "i", -1, returns="I S")
    assert np.ptp(read_scan(path).data["height", "trace"]) < 1e-12


def test_force_curve_has_the_pull_off_of_the_verb_and_its_file(served: Served, engaged: Client) -> None:
    engaged.call("FolMe.XYPosSet", "d d I", 50e-9, 0.0, 1)
    engaged.call("ZSpectr.ChsSet", "*i", [VERTICAL, Z])
    engaged.call("ZSpectr.RangeSet", "f f", 150e-9, -400e-9)
    engaged.call("ZSpectr.PropsSet", "H i H H H H", 1, 2000, 1, 1, 0, 0)
    engaged.call("ZSpectr.TimingSet", "f f f f f f f", 0.0, 0.002, 1.0, 0.0, 5e-5, 0.0, 0.0)
    engaged.call("ZSpectr.RetractSet", "H f i H", 1, 7.0, VERTICAL, 0)
    names, data, _ = engaged.call("ZSpectr.Start", "I S", 1, "curve", returns="SA M *f")
    assert names == [
        *("Z rel (m)", "Vert. Deflection (V)", "Z (m)", "Vert. Deflection [bwd] (V)", "Z [bwd] (m)"),
    ]
    table = np.array(data)
    assert table.shape == (5, 2000)
    rel, forward, _, backward, _ = table
    assert rel[0] == pytest.approx(150e-9, abs=1e-12)
    assert (np.diff(rel) < 0.0).all()
    assert forward.max() == pytest.approx(7.0, rel=0.03)
    (path,) = served.front.folder.glob("curve*.dat")
    assert path.name == "curve00001.dat"
    found = read_curve(path, 1.0, 1.0)
    np.testing.assert_allclose(found.record.channels["deflection_voltage"][:2000], forward, rtol=1e-5, atol=1e-6)
    with Microscope("two_materials", sample={"width": 100e-9}) as other:
        other.approach(rate=10e-6)
        other.go_to(x=50e-9, y=0.0)
        way = {"lift": 150e-9, "ramp": 400e-9, "approach_rate": 4e-6, "retract_rate": 4e-6}
        (curve,) = other.measure("force_curve", trigger_voltage=7.0, **way)
    assert backward.min() == pytest.approx(curve.record.channels["deflection_voltage"].min(), rel=0.03)
    # The slope in contact: S of vertical motion.
    pressed = (forward > 2.0) & (forward < 6.5)
    slope = np.polyfit(rel[pressed], forward[pressed], 1)[0]
    assert -1.0 / slope == pytest.approx(curve.deflection_sensitivity, rel=0.05)
    assert served.microscope.state.approached


def test_spectrum_is_stopped_on_another_port_and_the_tip_is_back(served: Served, engaged: Client) -> None:
    engaged.call("ZSpectr.RangeSet", "f f", 100e-9, -150e-9)
    engaged.call("ZSpectr.PropsSet", "H i H H H H", 1, 1000, 50, 2, 0, 0)
    engaged.call("ZSpectr.TimingSet", "f f f f f f f", 0.0, 0.002, 1.0, 0.0, 5e-4, 0.0, 0.0)
    engaged.call("ZSpectr.RetractSet", "H f i H", 1, 6.0, VERTICAL, 0)
    with served.client(1) as other:
        other.socket.sendall(b"ZSpectr.Start".ljust(32, b"\0") + struct.pack(">iHHIi", 8, 1, 0, 0, 0))
        until(lambda: engaged.call("ZSpectr.StatusGet", returns="I") == [1])
        engaged.call("ZSpectr.Stop")
        until(lambda: engaged.call("ZSpectr.StatusGet", returns="I") == [0])
        other.received(40)
    engaged.call("ZSpectr.PropsSet", "H i H H H H", 1, 1000, 1, 1, 0, 0)
    assert served.microscope.state.approached


def test_bias_spectrum_has_its_bias_and_signals_that_do_not_depend_on_it(engaged: Client) -> None:
    engaged.call("BiasSpectr.LimitsSet", "f f", -2.0, 2.0)
    engaged.call("BiasSpectr.PropsSet", "H i H i f H H", 0, 1, 2, 16, float("nan"), 2, 0)
    engaged.call("BiasSpectr.ChsSet", "*i", [0, 24, VERTICAL])
    names, data, _ = engaged.call("BiasSpectr.Start", "I S", 1, "", returns="SA M *f")
    assert names == ["Bias calc (V)", "Current (A)", "Bias (V)", "Vert. Deflection (V)"]
    assert data[0] == pytest.approx(np.linspace(-2.0, 2.0, 16))
    assert data[2] == data[0] and set(data[1]) == {0.0}
    assert data[3] == pytest.approx(engaged.call("ZCtrl.SetpntGet", returns="f") * 16, rel=0.02)


def test_bias_spectrum_takes_its_time_and_is_stopped(served: Served, engaged: Client) -> None:
    engaged.call("BiasSpectr.PropsSet", "H i H i f H H", 0, 1, 1, 100, float("nan"), 2, 0)
    timing = engaged.call("BiasSpectr.TimingGet", returns="f f f f f f f f")
    engaged.call("BiasSpectr.TimingSet", "f f f f f f", 0.0, 0.0, 0.0, 1.0, 1e3, 0.0)
    with served.client(1) as other:
        other.socket.sendall(b"BiasSpectr.Start".ljust(32, b"\0") + struct.pack(">iHHIi", 8, 1, 0, 0, 0))
        until(lambda: engaged.call("BiasSpectr.StatusGet", returns="I") == [1])
        engaged.call("BiasSpectr.Stop")
        until(lambda: engaged.call("BiasSpectr.StatusGet", returns="I") == [0])
        head = other.received(40)
        assert b"the spectrum was stopped" in other.received(struct.unpack_from(">i", head, 32)[0])
    engaged.call("BiasSpectr.TimingSet", "f f f f f f f f", *timing)
    assert served.microscope.state.approached


def test_session_path_is_where_files_go_and_must_exist(served: Served, client: Client, tmp_path: Path) -> None:
    before = client.call("Util.SessionPathGet", returns="S")[0]
    assert before == str(served.front.folder)
    with pytest.raises(Refused, match="Session Path not valid"):
        client.call("Util.SessionPathSet", "S I", "/no/such/folder", 0)
    client.call("Util.SessionPathSet", "S I", str(tmp_path), 0)
    assert client.call("Util.SessionPathGet", returns="S") == [str(tmp_path)]
    client.call("Util.SessionPathSet", "S I", before, 0)
    with pytest.raises(Refused, match="must be a name of a file"):
        client.call("Scan.PropsSet", "I I I S", 0, 0, 0, "../elsewhere")


def test_data_stream_sends_frames_with_a_counter_until_it_is_stopped(served: Served, engaged: Client) -> None:
    engaged.call("TCPLog.ChsSet", "*i", [Z, VERTICAL])
    engaged.call("TCPLog.OversamplSet", "i", 5)
    with Client(served.server.stream_port) as stream:
        engaged.call("TCPLog.Start")
        assert engaged.call("TCPLog.StatusGet", returns="i") == [4]
        frames = [struct.unpack(">IfQH2f", stream.received(26)) for _ in range(5)]
        engaged.call("TCPLog.Stop")
    assert [frame[0] for frame in frames] == [2] * 5
    assert [frame[2] - frames[0][2] for frame in frames] == [0, 1, 2, 3, 4]
    assert frames[-1][4] == pytest.approx(z(engaged), abs=5e-9)
    assert engaged.call("TCPLog.StatusGet", returns="i") == [1]
