"""Claims about thermal drift: the sample moves, the sensors of the scanner do not see it, a z loop follows it."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from afm_model import Instrument, InstrumentParameters, build
from afm_model.core.random_numbers import RandomStream
from afm_model.parameters import SimParameters
from afm_model.studies.start_checks import implausible

from ..held import held

CHANNELS = ", ".join(f"truth/{what}_{axis}" for what in ("drift", "position") for axis in "xyz")
PAPER = {"sample.beta": 0.0}
LEVER = {"plant.kind": "lever", "sample.kind": "flat", "reference.z_r": 50e-9, "onboard.kind": "pi"}
PERIOD = 1e-4


def drifting(values: dict[str, Any], ticks: int) -> tuple[dict[str, np.ndarray], Any, Instrument]:
    """Channels at the ticks in SI units and measurements, under the drive of the start."""
    given = {"plant.control_period": PERIOD, "detector.sample_period": PERIOD, "detector.channels": CHANNELS}
    scope, read, block = held(build(InstrumentParameters, given | values), ticks)
    return read, block.measurements, scope


@pytest.mark.parametrize("plant", [PAPER, LEVER])
@pytest.mark.parametrize("decay", [0.0, 0.02])
def test_sample_moves_by_the_drift_and_the_sensors_do_not_see_it(plant, decay):
    # Fast, so that it shows within a tenth of a second; almost no friction where that would hold the scanner.
    rates = {"drift.rate_x": 2e-7, "drift.rate_z": -1e-7, "drift.decay_time": decay, "contact.tau": 1.0}
    if plant is LEVER:
        del rates["contact.tau"]
    read, y, _ = drifting(plant | rates, 1000)
    # A channel holds what moved the sample in the period before.
    t = PERIOD * np.maximum(np.arange(1000) - 1, 0)
    way = decay * (1.0 - np.exp(-t / decay)) if decay else t
    for axis, rate in (("x", 2e-7), ("y", 0.0), ("z", -1e-7)):
        assert read[f"truth/drift_{axis}"] == pytest.approx(rate * way, abs=1e-20)
    moved = read["truth/position_x"] - read["truth/position_x"][0]
    # A drift that is there at once makes the scanner ring by rate / w, and no more.
    ringing = 2e-7 / (2.0 * np.pi * (669.0 if plant is PAPER else 500.0))
    assert moved == pytest.approx(2e-7 * way, abs=ringing)
    assert np.abs(y.position[:, 0] - y.position[0, 0]).max() < ringing
    assert moved[-1] > 3e-9


def test_z_loop_follows_the_drift_along_z_and_the_tip_is_dragged_until_it_slides():
    values = LEVER | {"drift.rate_x": 2e-7, "drift.rate_z": -1e-7}
    values["detector.channels"] = "z_loop, truth/stuck, truth/place_x, truth/drift_x, truth/drift_z"
    read, y, _ = drifting(values, 2000)
    t = PERIOD * np.arange(2000)
    late = t > 0.05
    # 0.02 to 0.3 nm of stick at k_eff of 21 N/m, then it slides: the place under the tip moves with the sample.
    assert read["truth/stuck"][:5].all() and not read["truth/stuck"][late].any()
    assert np.polyfit(t[late], read["truth/place_x"][late], 1)[0] == pytest.approx(2e-7, rel=1e-3)
    assert np.polyfit(t[late], read["z_loop"][late], 1)[0] == pytest.approx(1e-7, rel=1e-3)
    # z_loop is what the scanner does, and its sensor sees that.
    assert np.polyfit(t[late], y.position[late, 2], 1)[0] == pytest.approx(1e-7, rel=1e-3)


def test_random_part_is_an_ornstein_uhlenbeck_process_of_its_own_stream():
    rms, time, ticks = 3e-9, 2e-3, 600
    read, _, _ = drifting(PAPER | {"drift.wander": rms, "drift.wander_time": time, "plant.seed": 5}, ticks)
    # Stream 4 of the seed, three numbers a tick.
    normal = RandomStream(5, 4).standard_normal((ticks, 3))
    keep = np.exp(-PERIOD / time)
    shaken = rms * np.sqrt(1.0 - keep**2) * normal
    shaken[0] = rms * normal[0]
    rate = lfilter([1.0], [1.0, -keep], shaken, axis=0)
    way = np.concatenate([np.zeros((1, 3)), np.cumsum(PERIOD * rate, axis=0)])
    for axis, name in enumerate("xyz"):
        assert read[f"truth/drift_{name}"][1:] == pytest.approx(way[: ticks - 1, axis], abs=1e-20)


def test_drift_that_is_off_changes_no_bit():
    hashes = {drifting(PAPER | values, 50)[2].trajectory_sha256() for values in ({}, {"drift.decay_time": 3.0})}
    assert len(hashes) == 1


def test_what_is_implausible_is_told():
    given = {"drift.rate_x": 1e-6, "drift.wander": 1e-7, "detector.deflection_gain": 3.0}
    told = implausible(build(SimParameters, given))
    assert [name for sentence in told for name in ("deflection_gain", "rate_x", "wander") if name in sentence] == [
        "deflection_gain",
        "rate_x",
        "wander",
    ]
    assert implausible(build(SimParameters, {"drift.rate_x": 3e-11})) == []
