"""Claims about the load of a tip that slides: one far from the setpoint is named in the result."""

import warnings
from typing import Any

import numpy as np
import pytest

from afm_model.microscope import Microscope

BLUNT: dict[str, Any] = {"tip_radius": 200e-9}
SCAN: dict[str, Any] = {"size_x": 150e-9, "pixels": 32, "lines": 1, "line_rate": 2.0}


def scanned(**plant: Any) -> tuple[np.ndarray, list[str]]:
    """Heights of a flat sample [m], and the warnings."""
    with Microscope("two_materials", sample={"kind": "flat"}, plant=plant) as microscope:
        microscope.approach()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            image = microscope.scan(**SCAN)
    return image["height"].values, [str(each.message) for each in caught]


def test_load_far_from_the_setpoint_is_reported_with_its_numbers_and_what_to_do():
    """Friction of a blunt tip bends the tilted cantilever by more than the setpoint: z swings, the error is small."""
    heights, told = scanned(**BLUNT)
    assert np.ptp(heights) > 5e-9
    (sentence,) = told
    assert "the normal force was from -" in sentence
    assert "% of the time far from the setpoint of 10 nN" in sentence
    assert "take a smaller integral gain" in sentence


@pytest.mark.parametrize("changed", [{"tau": 1e6}, {"tilt": 0.0}])
def test_same_tip_is_scanned_without_a_warning_where_friction_does_not_bend_the_cantilever(changed):
    heights, told = scanned(**BLUNT, **changed)
    assert np.ptp(heights) < 0.5e-9
    assert told == []


def test_friction_loop_and_path_report_the_load_as_a_scan_does():
    with Microscope("two_materials", sample={"kind": "flat"}, plant=BLUNT) as microscope:
        microscope.approach()
        with pytest.warns(UserWarning, match="far from the setpoint of 10 nN"):
            microscope.friction_loop(length=100e-9, line_rate=2.0, count=2)
        with pytest.warns(UserWarning, match="far from the setpoint of 10 nN"):
            microscope.scan_path(x=(0.0, 150e-9), y=(0.0, 0.0), speed=0.6e-6)
