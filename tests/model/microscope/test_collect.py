"""Claims about what verbs measure: units, rates, places of samples, and how far a verb is."""

import numpy as np
import pytest
from quick_lever import OVER_THE_WEDGE, WEDGE

from afm_model.microscope.execution import landing
from afm_model.microscope.plan import path
from afm_model.microscope.verbs import FrictionLoop, MoveTo, Scan

from .test_local import APPROACH, local


@pytest.fixture(scope="module")
def microscope():
    made = local()
    assert made.execute(APPROACH).status == "complete"
    return made


def test_newton_and_metre_are_volts_times_the_sensitivities_of_the_detector_in_images_and_records(microscope):
    detector = microscope.instrument.parameters.detector
    channels = "lateral, lateral_voltage, deflection, deflection_voltage, height, z_loop"
    scan = Scan(size_x=40e-9, size_y=10e-9, pixels=16, lines=2, line_rate=20.0, channels=channels)
    image = microscope.execute(scan).result
    for way in ("trace", "retrace"):
        data = {name: image.data[name, way] for name in channels.split(", ")}
        assert data["lateral"] == pytest.approx(detector.lateral_sensitivity * data["lateral_voltage"], rel=1e-12)
        assert data["deflection"] == pytest.approx(
            detector.deflection_sensitivity * data["deflection_voltage"], rel=1e-12
        )
        assert data["height"].tolist() == (-data["z_loop"]).tolist()
    # Rate and start are found again from the times of the lines alone.
    rate, start = image.line_rate, image.start
    image.date()
    assert (image.line_rate, image.start) == pytest.approx((rate, start), rel=1e-9)
    assert rate == pytest.approx(20.0, rel=0.01)
    assert (image.missing(2), image.missing(3)) == (0, 2)
    # Pressed by 10 nN, friction on silicon oxide is some nanonewton: the shear stress over the area of the contact.
    assert 1e-9 < np.nanmean(image.friction()) < 20e-9
    loop = microscope.execute(FrictionLoop(length=6e-9, line_rate=20.0, sample_rate=20e3)).result
    half = 0.5 * (np.quantile(loop.lateral, 0.9) - np.quantile(loop.lateral, 0.1))
    assert 1e-9 < half < 20e-9


def test_samples_of_a_record_come_at_the_rate_that_was_asked_for(microscope):
    loop = microscope.execute(FrictionLoop(length=6e-9, line_rate=20.0, sample_rate=20e3)).result
    assert np.diff(loop.time) == pytest.approx(1.0 / 20e3, rel=1e-9)


def test_positions_of_a_loop_are_along_its_line_from_its_middle(microscope):
    def loop(**values):
        return microscope.execute(FrictionLoop(length=6e-9, line_rate=20.0, sample_rate=20e3, **values)).result.position

    along = loop()
    assert (along.min(), along.max()) == pytest.approx((-3e-9, 3e-9), rel=0.05)
    microscope.execute(MoveTo(x=20e-9, y=-30e-9))
    assert loop(angle=0.7) == pytest.approx(along, abs=1e-15)
    microscope.execute(MoveTo(x=0.0, y=0.0))


def test_corner_of_a_path_is_rounded_over_half_of_the_shorter_of_its_lines_at_most(microscope):
    # At this speed a period of the resonance takes 2 nm. The short line at the end is none of the corner before.
    view = microscope.operator._view
    places = [(0.0, 0.0), (1e-9, 0.0), (1e-9, 1e-9), (1.3e-9, 1e-9)]
    pieces = list(path(places, 1e-6, view))
    assert (view.control_period, view.resonance) == (1e-4, 500.0)
    assert [max(piece.ticks for at, piece in pieces if at == number) for number in range(4)] == [10, 10, 3, 3]


def test_a_tip_that_presses_already_lands_with_a_trigger_above_nothing(microscope):
    view = microscope.operator._view
    free, pressed = (landing(view, 0.0, 1e-6, 1e-3, rest)[1].trigger for rest in (0.0, 2.0 * view.setpoint))
    assert free == view.setpoint
    assert pressed == 1e-3 * view.setpoint > 0.0


def test_progress_of_a_calibration_counts_its_setpoints_evenly():
    microscope, seen = local(), []
    microscope.set_sample(WEDGE)
    microscope.execute(APPROACH)
    assert microscope.execute(OVER_THE_WEDGE, on_progress=seen.append).status == "complete"
    fractions = [each.fraction for each in seen]
    assert fractions == sorted(fractions)
    count = OVER_THE_WEDGE.setpoints
    for number in range(count):
        part = [each.fraction for each in seen if each.detail.startswith(f"setpoint {number + 1} of {count}")]
        # Going to the first place takes a while, too.
        assert min(part) >= number / count - 0.1
        assert max(part) == pytest.approx((number + 1) / count, abs=0.1)
