"""Claims about images: steps, places, orientation and angle, trace and retrace, crosstalk."""

import numpy as np
import pytest
from quick_lever import PRESSED

from afm_model import load_scenario
from afm_model.microscope.image import Image
from afm_model.microscope.local import Local
from afm_model.microscope.verbs import Approach, Scan

APPROACH = Approach(rate=20e-6, range=2e-6, settle=10e-3)


def imaged(scan: Scan, preset: str = "two_materials", setpoint: float = 10e-9, **groups: dict[str, object]) -> Image:
    """A scan with a preset, some parameters changed by group; the setpoint in newton."""
    scenario = load_scenario(preset)
    microscope = Local(scenario.sim, scenario.controller)
    for group, changes in groups.items():
        microscope.exchange(group, changes)
    microscope.set_setpoint(force=setpoint)
    assert microscope.execute(APPROACH).status == "complete"
    outcome = microscope.execute(scan)
    assert outcome.status == "complete"
    return outcome.result


def test_step_heights_are_recovered_within_one_percent():
    image = imaged(Scan(size_x=2e-6, size_y=20e-9, pixels=128, lines=2, line_rate=4.0), "step_grating")
    x = (image.x + 0.5e-6) % 1e-6 - 0.5e-6  # the middle between two ridges is at 0
    for way in ("trace", "retrace"):
        height = image.data["height", way]
        top, ground = height[:, np.abs(x) > 0.4e-6], height[:, np.abs(x) < 0.1e-6]
        assert top.mean() - ground.mean() == pytest.approx(20e-9, rel=0.01)
        assert top.std() < 0.2e-9
        assert ground.std() < 0.2e-9


BUMPS = ((60e-9, 40e-9, 5e-9), (-50e-9, 60e-9, 3e-9), (-20e-9, -60e-9, 2e-9))
"""x, y, height of hills on the map: none of its mirror images or turns is like it."""


def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the sample [m]."""
    return sum(h * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2.0 * 20e-9**2)) for a, b, h in BUMPS)


@pytest.mark.parametrize(("angle", "direction"), [(0.0, "up"), (0.5, "down")])
def test_an_asymmetric_sample_lies_in_the_image_as_it_is(tmp_path, angle, direction):
    pixel = 4e-9
    at = (np.arange(101) - 50) * pixel
    np.save(tmp_path / "hills.npy", hills(*np.meshgrid(at, at)))
    sample = {"kind": "map", "file": str(tmp_path / "hills.npy"), "width": 101 * pixel, "length": 101 * pixel}
    scan = Scan(
        centre_x=10e-9,
        centre_y=-5e-9,
        size_x=240e-9,
        size_y=200e-9,
        angle=angle,
        pixels=24,
        lines=12,
        line_rate=20.0,
        direction=direction,
        channels="height, error, x, y",
    )
    # A pressed cantilever moves its tip along y, by 4 nm at 10 nN: press less.
    image = imaged(scan, setpoint=1e-9, plant={"tilt": 0.0}, sample={**sample, "dilate": False})
    u, v = np.meshgrid(image.x, image.y)
    c, s = np.cos(angle), np.sin(angle)
    x, y = scan.centre_x + c * u - s * v, scan.centre_y + s * u + c * v
    truth = hills(x, y)
    for way in ("trace", "retrace"):
        # The scanner is where it is asked to be: within a hundredth of a pixel of 10 nm.
        assert np.abs(image.data["x", way] - x).max() < 0.1e-9
        assert np.abs(image.data["y", way] - y).max() < 0.1e-9
    # What the loop has not followed is in the error: 10 nm/V.
    measured = [image.data["height", way] + 10e-9 * image.data["error", way] for way in ("trace", "retrace")]
    off = np.mean(measured, axis=0) - truth
    off -= off.mean()
    assert np.abs(off).max() < 0.1e-9
    # Turned or mirrored it would be off by a hill.
    for other in (truth[::-1], truth[:, ::-1], truth[::-1, ::-1]):
        assert np.abs(np.mean(measured, axis=0) - other).max() > 2e-9


def test_crosstalk_is_half_the_sum_of_trace_and_retrace_and_friction_does_not_show_it():
    scan = Scan(size_x=400e-9, size_y=20e-9, pixels=32, lines=2, line_rate=10.0)
    plain = imaged(scan)
    mixed = imaged(scan, detector={"deflection_in_lateral": 0.05})
    inside = np.abs(np.abs(plain.x) - 100e-9) < 60e-9
    # 5 % of a setpoint of 5 V, at 50 nN/V.
    assert mixed.crosstalk()[:, inside] == pytest.approx(0.05 * PRESSED * 50e-9, rel=1e-3)
    assert np.abs(plain.crosstalk()[:, inside]).max() < 1e-12
    assert mixed.friction()[:, inside] == pytest.approx(plain.friction()[:, inside], rel=1e-4)
