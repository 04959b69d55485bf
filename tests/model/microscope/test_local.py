"""Claims about verbs in process: approach, move, scan, force curve, withdraw; what cannot be is refused."""

import tracemalloc

import numpy as np
import pytest
from quick_lever import KNOWN, LAW, LEVER, PRESSED

from afm_model import ControllerParameters, SimParameters, VerbError, build
from afm_model.analysis import force_curve
from afm_model.files import write_curves
from afm_model.microscope.local import Local
from afm_model.microscope.verbs import Approach, ForceCurve, MoveTo, Scan, Withdraw

APPROACH = Approach(rate=10e-6, range=200e-9, settle=10e-3)
SCAN = Scan(size_x=40e-9, size_y=10e-9, pixels=16, lines=2, line_rate=20.0)


def local(block_ticks: int | None = None, **values: float | str) -> Local:
    changes = {name.replace("__", "."): value for name, value in values.items()}
    return Local(
        build(SimParameters, LEVER | changes),
        build(ControllerParameters, LAW | KNOWN),
        block_ticks=block_ticks,
        hashed=True,
    )


@pytest.fixture(scope="module")
def scanned():
    """A microscope that has approached and scanned, and the outcome."""
    microscope = local()
    assert microscope.execute(APPROACH).status == "complete"
    lines = []
    return microscope, microscope.execute(SCAN, on_line=lines.append), lines


def test_a_scan_tells_two_materials_by_their_friction_and_not_by_their_height(scanned):
    _, outcome, _ = scanned
    image = outcome.result
    assert outcome.status == "complete"
    assert image.complete
    assert image.units == {"height": "m", "error": "V", "lateral": "N"}
    friction = image.friction()
    strong = (image.x > 2e-9) & (image.x < 8e-9)
    weak = (image.x < -2e-9) & (image.x > -8e-9)
    assert friction[:, weak].mean() / friction[:, strong].mean() == pytest.approx(0.5, rel=0.03)
    for way in ("trace", "retrace"):
        height = image.data["height", way][1]
        assert abs(height[strong].mean() - height[weak].mean()) < 5e-12


def test_lines_come_one_by_one_and_make_the_image(scanned):
    _, outcome, lines = scanned
    assert [(line.index, line.direction) for line in lines] == [
        (0, "trace"),
        (0, "retrace"),
        (1, "trace"),
        (1, "retrace"),
    ]
    # A line starts a period behind the one before; trace and retrace are half of one apart.
    starts = np.array([line.time for line in lines])
    assert np.diff(starts) == pytest.approx(0.5 / outcome.result.line_rate, rel=1e-9)
    assert starts[0] == pytest.approx(outcome.result.start)
    for line in lines:
        assert outcome.result.data["lateral", line.direction][line.index].tolist() == line.channels["lateral"].tolist()


@pytest.mark.parametrize("block_ticks", [7, 1000])
def test_the_bytes_do_not_depend_on_the_size_of_the_blocks(scanned, block_ticks):
    reference, outcome, _ = scanned
    other = local(block_ticks)
    other.execute(APPROACH)
    image = other.execute(SCAN).result
    for key, values in outcome.result.data.items():
        assert image.data[key].tobytes() == values.tobytes(), key
    assert other.instrument.trajectory_sha256() == reference.instrument.trajectory_sha256()


def test_approach_withdraw_and_move_go_where_they_say():
    microscope = local()
    begin = microscope.instrument.orders.onboard.z
    standing = microscope.execute(APPROACH).result
    assert standing.deflection_voltage == pytest.approx(PRESSED, rel=1e-2)
    assert microscope.state.approached
    assert standing.z - begin == pytest.approx(20e-9 + PRESSED * 9.71e-9, abs=1e-9)
    standing = microscope.execute(MoveTo(x=20e-9, y=-10e-9)).result
    assert (standing.x, standing.y) == pytest.approx((20e-9, -10e-9), rel=1e-9)
    assert microscope.instrument.truth.position[:2] == pytest.approx([20e-9, -10e-9], abs=1e-10)
    before = standing.z
    standing = microscope.execute(Withdraw(distance=300e-9, rate=50e-6)).result
    assert standing.z == pytest.approx(before - 300e-9, rel=1e-6)
    assert not microscope.state.approached
    assert not microscope.instrument.in_contact


def test_an_approach_that_finds_no_sample_leaves_the_tip_withdrawn_and_says_how_far_it_went():
    microscope = local()
    begin = microscope.instrument.orders.onboard.z
    outcome = microscope.execute(Approach(rate=10e-6, range=15e-9, settle=1e-3))
    assert outcome.status == "failed"
    assert outcome.message.startswith("no sample within range = 1.5e-08 m: z went 1.5e-08 m")
    assert microscope.instrument.orders.onboard.z == begin
    assert microscope.execute(APPROACH).status == "complete"


def test_force_curves_show_snap_in_and_adhesion_and_leave_the_tip_on_the_sample():
    # DMT, whose branch begins at no indentation, and no friction: closed forms.
    microscope = local(plant__tilt=0.0, plant__contact="dmt", plant__tau=1e3)
    microscope.set_sample({"kind": "flat"})
    microscope.execute(APPROACH)
    verb = ForceCurve(trigger_force=2e-9, approach_rate=0.5e-6, retract_rate=2e-6, count=2, lift=100e-9, settle=5e-3)
    outcome = microscope.execute(verb)
    assert outcome.status == "complete"
    first, second = outcome.result
    plant = microscope.instrument.parameters.plant
    k, R, H, units = 0.2, 10e-9, plant.pair_numbers.hamaker, plant.contact_units
    # A sphere under van der Waals attraction snaps in at D, over D / 2; the rest is what the contact gives way.
    D = (H * R / (3.0 * k)) ** (1.0 / 3.0)
    way = 1.5 * D - (H * R / (12.0 * units.force)) ** 0.5 + 2.0 ** (2.0 / 3.0) * units.indentation
    for curve in (first, second):
        assert curve.triggered
        read = curve.record.channels
        assert read["deflection_voltage"][read["phase"] == 2].max() == pytest.approx(1.0, rel=0.02)
        told = force_curve(read["z"], read["deflection_voltage"] * curve.deflection_sensitivity, curve.spring_constant)
        assert told.adhesion.value == pytest.approx(2.0 * units.force, rel=0.01)
        # To pass the fold takes time: 0.013 nm of way at 0.2 um/s, 0.036 nm at 1 um/s.
        assert told.snap_in_way == pytest.approx(way, abs=0.036e-9)
    assert second.record.time[0] > first.record.time[-1]
    assert microscope.state.approached
    assert microscope.instrument.in_contact


def test_setpoint_trigger_curve_and_file_mean_one_force_and_it_is_the_vertical_one(tmp_path):
    # A tilted cantilever without friction, whose truth is the force on the tip.
    microscope = local(plant__tau=1e3)
    microscope.set_sample({"kind": "flat"})
    microscope.execute(APPROACH)
    assert microscope.instrument.truth.normal_force == pytest.approx(10e-9, rel=2e-3)
    verb = ForceCurve(trigger_force=30e-9, approach_rate=0.2e-6, ramp=300e-9)
    (curve,) = microscope.execute(verb).result
    free = curve.arrays().variables["force"].values[:100].mean()
    # A sample of z is 2 pm, 0.4 pN.
    assert curve.arrays().variables["force"].values.max() - free == pytest.approx(30e-9, rel=1e-3)
    assert curve.trigger == pytest.approx(3.0 * PRESSED)
    import h5py

    with h5py.File(write_curves(tmp_path / "curve.h5", curve)) as file:
        assert file["0"].attrs["setpoint"] == pytest.approx(30e-9, rel=1e-9)
        assert file["0"]["force"][:].max() - free == pytest.approx(30e-9, rel=1e-3)


def test_memory_is_the_same_however_many_lines_are_scanned():
    microscope = local(block_ticks=500)
    microscope.execute(APPROACH)
    scan = Scan(size_x=40e-9, pixels=16, lines=4, line_rate=20.0)
    microscope.execute(scan)
    peaks = []
    for lines in (4, 24):
        tracemalloc.start()
        microscope.execute(scan.model_copy(update={"lines": lines, "size_y": 10e-9}))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # 20 lines of two directions and three channels of 16 pixels; their samples would be 12 MB.
    assert peaks[1] - peaks[0] < 20 * 2 * 3 * 16 * 8 + 100_000


def test_the_plant_of_the_paper_that_can_leave_the_sample_has_verbs_too():
    values = {"plant.kind": "compliant", "plant.gap": 200e-9, "sample.beta": 0.0, "detector.sample_period": 2e-6}
    values |= {"onboard.kind": "pi", "onboard.setpoint_voltage": 5.0, "onboard.integral_gain": 100e-6}
    microscope = Local(build(SimParameters, values), build(ControllerParameters, {"law.kind": "tanh"}))
    outcome = microscope.execute(Approach(rate=50e-6, range=500e-9, settle=1e-3))
    assert outcome.status == "complete"
    assert microscope.instrument.in_contact
    outcome = microscope.execute(Scan(size_x=5e-9, size_y=1e-9, pixels=8, lines=1, line_rate=15.0, speed=1e-6))
    assert outcome.result.complete
    assert (outcome.result.friction() > 0.0).all()
    microscope.close()
    assert not microscope.instrument.in_contact


@pytest.mark.parametrize(
    ("verb", "told"),
    [
        (SCAN, "Scan is not allowed while the tip is withdrawn: it must be approached first"),
        (ForceCurve(), "ForceCurve is not allowed while the tip is withdrawn"),
        (MoveTo(x=1.0), r"x = 1 m is outside the travel of the scanner: it must be within \+-1e-06 m"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(verb, told):
    microscope = local()
    with pytest.raises(VerbError, match=told):
        microscope.execute(verb)
    assert microscope.time == 0.0
