"""Claims about Lift: the second pass goes the way of the first at its height, what it measures there, and its files."""

import math
import re

import numpy as np
import pytest

from afm_model.analysis import tilted_deflection
from afm_model.files import read_scan, write_gwy, write_scan
from afm_model.files.layers import layers
from afm_model.microscope import Approach, Lift, Local, Outcome, Scan, Withdraw, to_xarray
from afm_model.microscope.image import as_image

from .test_local import APPROACH, local
from .test_tapping import amplitude, tapped

FRAME = {"size_x": 40e-9, "size_y": 10e-9, "pixels": 8, "lines": 2, "line_rate": 20.0, "overscan": 0.3}
HEIGHT = 30e-9
PRESSED = Lift(**FRAME, lift=HEIGHT, lift_rate=10e-6, channels="height, deflection", channels_above="z, deflection, x")


@pytest.fixture(scope="module")
def over_a_slope() -> tuple[Local, Outcome]:
    microscope = local()
    microscope.set_sample({"kind": "plane", "angle_x": 0.1})
    microscope.execute(APPROACH)
    return microscope, microscope.execute(PRESSED)


def test_second_pass_goes_the_way_of_the_first_less_deflection_and_lift(over_a_slope):
    microscope, outcome = over_a_slope
    assert (outcome.status, outcome.message) == ("complete", "")
    image = outcome.result
    plant = microscope.instrument.parameters.plant
    c = plant.cantilever_numbers
    geometry = (plant.tilt, c.tip_height + 0.5 * c.thickness, c.length)
    assert tilted_deflection(*geometry) > 1.02
    assert image.complete and list(image.units) == ["height", "deflection", "z_lift", "deflection_lift", "x_lift"]
    data = image.data
    for way in ("trace", "retrace"):
        # The tip moves vertically by less than the cantilever is deflected across itself.
        vertical = data["deflection", way] / tilted_deflection(*geometry)
        below = -data["height", way] - vertical - HEIGHT
        # A sample later or sooner is 2 pm.
        assert data["z_lift", way] == pytest.approx(below, abs=0.2e-12)
        assert np.polyfit(image.x, data["z_lift", way][0], 1)[0] == pytest.approx(-0.1, rel=0.02)
        assert np.abs(data["x_lift", way] - image.x).max() < 0.1e-9
        # The cantilever is free there.
        assert np.abs(data["deflection_lift", way]).max() < 0.01 * np.abs(data["deflection", way]).min()
    # The feedback follows again behind it, where it was.
    assert microscope.state.approached
    again = microscope.execute(Scan(**FRAME)).result
    assert again.data["height", "trace"][0] == pytest.approx(data["height", "trace"][0], abs=5e-12)


def test_image_of_both_passes_comes_back_from_files_and_labelled_arrays_to_the_last_bit(over_a_slope, tmp_path):
    image = over_a_slope[1].result
    names = [each.name for each in layers(image)]
    assert names == [f"{name}_{way}" for name in image.units for way in ("trace", "retrace")]
    write_gwy(tmp_path / "lift.gwy", image)
    for back in (read_scan(write_scan(tmp_path / "lift.h5", image)), as_image(to_xarray(image))):
        assert (back.scan, back.units, back.metadata) == (image.scan, image.units, image.metadata)
        assert {key: values.tobytes() for key, values in back.data.items()} == {
            key: values.tobytes() for key, values in image.data.items()
        }
    assert "second pass 3e-08 m above the first" in image.metadata["Lift"]


def test_tip_that_taps_flies_with_its_free_amplitude_and_taps_again_in_the_next_line():
    microscope = tapped(onboard__setpoint_share=0.8)
    microscope.execute(Approach(rate=2e-6, range=60e-9, settle=10e-3))
    outcome = microscope.execute(Lift(**FRAME, lift=20e-9, lift_rate=2e-6))
    assert (outcome.status, outcome.message) == ("complete", "")
    data, free = outcome.result.data, microscope.instrument.parameters.onboard.free_amplitude
    names = ["height", "amplitude_error", "phase", "amplitude_lift", "phase_lift"]
    assert list(outcome.result.units) == names
    for way in ("trace", "retrace"):
        assert data["amplitude_lift", way] == pytest.approx(free, rel=2e-3)
        # Far from the sample at resonance; on it by attraction.
        assert data["phase_lift", way] == pytest.approx(0.5 * math.pi, abs=0.02)
        assert data["phase", way].min() > 2.0
        assert np.abs(data["amplitude_error", way]).max() < 0.02 * free
        assert data["height", way] == pytest.approx(data["height", "trace"][0, 0], abs=0.05e-9)
    assert amplitude(microscope) == pytest.approx(0.8 * free * 1.5 / 1.3765, rel=0.02)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"lift": 1e-3}, "lift = 0.001 m is not allowed here: z has "),
        ({"channels_above": "hight"}, "there is no hight (did you mean height?)"),
        ({"size_x": 1e-3}, "with its turns the scan goes too far"),
    ],
)
def test_what_cannot_be_lifted_is_refused_in_a_sentence(over_a_slope, fields, told):
    assert told in over_a_slope[0].objection(Lift(**FRAME | fields))


def test_lift_needs_a_loop_that_follows_and_a_cancelled_one_leaves_the_tip_off_the_sample():
    microscope = local()
    assert "Lift is not allowed while the tip is withdrawn" in microscope.objection(PRESSED)
    microscope.execute(APPROACH)
    microscope.set_feedback("hold")
    assert microscope.objection(PRESSED) == "Lift is not allowed with feedback = hold: it must be on"
    microscope.set_feedback("on")
    microscope.operator.begin(PRESSED)
    while "above it" not in str(microscope.operator.progress.detail):
        microscope.step()
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    assert microscope.operator.outcome().status == "cancelled"
    assert (microscope.state.near, microscope.instrument.in_contact) == (False, False)
    assert microscope.objection(Withdraw()) == ""


def test_lift_below_the_pull_off_distance_says_that_the_tip_stays_in_contact_and_what_to_use():
    microscope = local()
    microscope.execute(APPROACH)
    outcome = microscope.execute(Lift(**FRAME, lift=5e-9, lift_rate=10e-6))
    assert outcome.status == "complete"
    plant = microscope.instrument.parameters.plant
    distance = (
        2.0
        * math.pi
        * plant.pair_numbers.work_of_adhesion
        * plant.cantilever_numbers.tip_radius
        / plant.cantilever_numbers.k
    )
    found = re.match(
        r"lift = 5 nm is below the pull-off distance of (\S+) nm: the tip stays in contact. Use at least (\S+) nm; the "
        r"second pass was in contact in 2 of 2 lines",
        outcome.message,
    )
    assert found, outcome.message
    said, enough = (1e-9 * float(each) for each in found.groups())
    assert said == pytest.approx(distance, rel=0.1)
    assert microscope.execute(Lift(**FRAME, lift=enough, lift_rate=10e-6)).message == ""
