"""Claims about images by tapping: contrast of phase by the energy that a material takes; parachuting."""

import math
from typing import Any

import numpy as np
import pytest

from afm_model.microscope import Approach, Local, Microscope, Outcome, Scan

from .test_amplitude_curve import GAIN, SHOWN, Q
from .test_tapping import tapped

MODE = 1.0302 * 2.8
"""Stiffness of the first mode [N/m]."""
OTHERS = (1.0 - 8.0 / 12.3624 * 1.3765) / 2.8 / SHOWN
"""Way that the photodiode shows of all other modes, which follow the force, as one of the first: (6) less what (2) has
of it [m/N]."""
RADIUS, TENSION, VOLUME, BEGIN = 10e-9, 0.072, 1e-26, 1.2e-9
BRIDGE = {"plant__bridge_volume": VOLUME, "plant__bridge_begin": BEGIN}
SOFT = {"plant__K": 3e9, "plant__G": 0.5e9, "plant__work_of_adhesion": 0.05}
LOST = [f"truth/lost_by_{what}" for what in ("viscosity", "bridge", "friction")]
SEEN = ["amplitude", "in_phase", "quadrature", "phase"]
WIDTH = 20e-9


def bound(D: float) -> float:
    """Work to draw a bridge from the distance D out without end, by the integral of its force [J]."""
    spread = math.sqrt(VOLUME / (math.pi * RADIUS))
    return 4.0 * math.pi * RADIUS * TENSION * (math.hypot(D, spread) - D)


HYSTERESIS = bound(BEGIN) - bound(VOLUME ** (1.0 / 3.0))
"""What a bridge takes as it forms and breaks [J]."""


def imaged(scan: Scan, free: float, share: float, **values: Any) -> tuple[Local, Outcome]:
    """A scan by tapping with a free amplitude of the end [m]."""
    lost = {"detector__channels": ", ".join(["z_loop, z_loop_error", *SEEN, *LOST, "verb_number, verb_step"])}
    drive = {"onboard__drive_amplitude": free / (GAIN * Q), "onboard__setpoint_share": share}
    microscope = tapped(**{"plant__gap": free + 30e-9} | drive | lost | values)
    assert microscope.execute(Approach(rate=4e-6, range=100e-9, settle=5e-3)).message == ""
    return microscope, microscope.execute(scan)


def dissipated(a: Any, free: float) -> Any:
    """Energy per cycle of a response, by the force on the tip that makes it of the free one, at resonance [J].

    As docs/dynamic.md (43), and without what the other modes show of this force.
    """
    force = (a + 1j * free) / (Q / (1j * MODE) + OTHERS)
    return math.pi * np.imag(np.conj(force) * (a - OTHERS * force + free / (GAIN * Q)))


@pytest.mark.parametrize(
    ("free", "share", "second", "branch"),
    [
        (10e-9, 0.7, BRIDGE | {"sample__tension": 0.0}, "attraction"),
        (20e-9, 0.7, BRIDGE | {"sample__tension": 0.0}, "repulsion"),
        (20e-9, 0.7, SOFT | {"plant__viscosity": 50.0, "sample__viscosity": 0.0}, "repulsion"),
    ],
    ids=["bridges, attraction", "bridges, repulsion", "viscosity, repulsion"],
)
def test_phase_tells_the_material_that_takes_energy_and_the_other_way_round_in_the_other_branch(
    free, share, second, branch
):
    scan = Scan(size_x=2.0 * WIDTH, pixels=8, lines=1, line_rate=20.0, overscan=0.3, channels=", ".join(SEEN + LOST))
    sample = {"sample__kind": "patches", "sample__width": WIDTH, **second}
    microscope, outcome = imaged(scan, free, share, **sample)
    assert (outcome.status, outcome.message) == ("complete", "")
    image = outcome.result
    row = {name: image.data[name, "trace"][0] for name in image.units}
    # From the middle of the third pixel of each material to that of its fourth: cycles, and energy in each.
    cycles = 77e3 * 0.5 / (image.line_rate * 1.3 * 8)
    lost = {name: [(row[name][i + 1] - row[name][i]) / cycles for i in (2, 6)] for name in LOST}
    account = np.sum(list(lost.values()), axis=0)
    a = (row["in_phase"] - 1j * row["quadrature"]) / SHOWN
    part = microscope.instrument.parameters.onboard
    found = dissipated(a, part.free_amplitude / SHOWN)[[2, 6]]
    driven = math.pi * MODE * abs(a[2]) * free / Q
    # Harmonics, which the air damps as well, are what is left: more the harder the tip is pushed.
    assert np.abs(found - account).max() < (1e-3 if branch == "attraction" else 2.5e-3) * driven
    more = account[1] - account[0]
    assert found[1] - found[0] == pytest.approx(more, rel=0.08, abs=0.0)
    if "plant__bridge_volume" in second:
        assert lost[LOST[1]] == [0.0, pytest.approx(HYSTERESIS, rel=0.02, abs=0.0)]
    # sin phi = A / A0 + E / (pi k A A0 / Q), but for the base that moves along.
    sine, tilt = np.sin(row["phase"][[2, 6]]), np.cos(row["phase"][[2, 6]])
    assert np.diff(sine)[0] == pytest.approx(more / driven, rel=0.1, abs=0.0)
    contrast = row["phase"][6] - row["phase"][2]
    if branch == "attraction":
        assert (tilt < 0.0).all() and contrast < -0.03
    else:
        assert (tilt > 0.0).all() and contrast > 0.01


@pytest.mark.parametrize(
    ("plant", "sample", "contrast"),
    [
        ({}, {}, 0.2),
        ({"pair": "si_polystyrene", "viscosity": 100.0}, {"viscosity": 0.0}, 4.1),
    ],
    ids=["preset", "polystyrene"],
)
def test_contrast_of_the_preset_and_of_a_viscous_polymer_is_that_of_docs_tapping(plant, sample, contrast):
    fast = {"kind": "averaged", "lever": "ppp_fmr", "gap": 500e-9, "dt": 2e-6}
    with Microscope("tapping", plant=fast | plant, sample=sample) as microscope:
        microscope.approach(rate=5e-6)
        image = microscope.scan(size_x=500e-9, pixels=16, lines=1, line_rate=5.0)
    phase = np.degrees(image.phase.values[0, 0])
    # The first material is to the right of x = 0.
    assert phase[10:14].mean() - phase[2:6].mean() == pytest.approx(contrast, abs=0.05)


GRATING = {"sample__kind": "grating", "sample__pitch": 400e-9, "sample__top": 200e-9, "sample__angle": 0.8}
STEP = 40e-9


def over_a_step(scan: Scan) -> tuple[Local, Outcome]:
    """By a free amplitude of 20 nm at 0.8 of it; a step down is at x = -100 nm, one up at 100 nm."""
    return imaged(scan, 20e-9, 0.8, **GRATING, sample__step=STEP, sample__edge_radius=20e-9)


def test_behind_a_step_down_z_falls_by_the_free_amplitude_less_setpoint_times_the_gain_and_the_tail_is_told():
    microscope, outcome = over_a_step(Scan(size_x=380e-9, pixels=95, lines=1, line_rate=8.0))
    image, loop = outcome.result, microscope.instrument.parameters.onboard
    height, error = image.data["height", "trace"][0], image.data["amplitude_error", "trace"][0]
    most = 0.2 * loop.free_amplitude
    speed = 2.0 * 1.1 * image.line_rate * 380e-9
    slope = -loop.integral_gain * most / 10e-9 / speed
    flies = error > 0.98 * most
    there = np.flatnonzero(flies & (image.x < 50e-9))
    tail = max(np.split(there, np.flatnonzero(np.diff(there) > 1) + 1), key=len)
    assert np.diff(height[tail[1:]]) / 4e-9 == pytest.approx(slope, rel=3e-3)
    # It ends where z has come down by the step, from the edge at -100 nm on; by the pixel in which half is left, and
    # the lag of cantilever and lock-in.
    late = Q / (math.pi * 77e3) + 4.0 * 50e-6
    ends = np.interp(-0.5 * most, -error[tail[-1] : tail[-1] + 4], image.x[tail[-1] : tail[-1] + 4])
    assert ends == pytest.approx(-100e-9 + STEP / -slope, abs=late * speed + 2e-9)
    share = np.mean([image.data["amplitude_error", way] > 0.9 * most for way in ("trace", "retrace")])
    told = f"the tip was off the sample in {100.0 * share:.2g} % of the pixels, trace and retrace (parachuting)"
    assert told in outcome.message
    assert told in image.metadata["Remark"]


@pytest.mark.long
def test_slow_enough_down_a_step_the_height_is_that_of_the_sample_and_nothing_is_told():
    _, outcome = over_a_step(Scan(centre_x=-100e-9, size_x=120e-9, pixels=40, lines=1, line_rate=1.5))
    height = outcome.result.data["height", "trace"][0]
    assert height[3] - height[-3] == pytest.approx(STEP, rel=0.01)
    assert outcome.message == ""
