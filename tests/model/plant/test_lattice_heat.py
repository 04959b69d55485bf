"""Claims about thermal activation on a lattice: equipartition, Kramers' rates, force and the logarithm of velocity."""

import math

import numpy as np
import pytest

from .test_lattice import A, along, bench
from .tomlinson import BOLTZMANN, Tomlinson

MASS, DAMPING, T = 6e-11, 1e6, 300.0
WARM = {"plant__apex_mass": MASS, "plant__apex_damping": DAMPING, "plant__temperature": T, "plant__apex_stiffness": 1.0}
ETA = 13.0


@pytest.mark.parametrize("dt", [1e-6, 2.5e-7])
def test_heat_is_shared_equally_at_every_step(dt):
    b, model = bench(ETA, **WARM | {"plant__temperature": 20.0, "plant__dt": dt})
    n = 100_000
    r = b.run(along(np.zeros(n)))
    stiff = model.k * (1.0 + ETA)
    # Correlated over 1 / rate: independent places.
    independent = n * dt * stiff / (MASS * DAMPING) / 2.0
    error = math.sqrt(2.0 / independent)
    # The potential softens by (2 pi / a)^2 <u^2> / 2, half a percent.
    assert r.A_x.var() == pytest.approx(BOLTZMANN * 20.0 / stiff, rel=4.0 * error + 0.01)
    assert r.V_Ax.var() == pytest.approx(BOLTZMANN * 20.0 / MASS, rel=0.03)
    # Along y the same heat, drawn apart. Bending gives way more slowly than the noise: the well alone to some percent.
    assert r.A_y.var() == pytest.approx(r.A_x.var(), rel=8.0 * error + 0.05)
    assert abs(np.corrcoef(r.A_x, r.A_y)[0, 1]) < 4.0 / math.sqrt(independent)


def slip_lags(v: float, count: int, seed: int) -> tuple[np.ndarray, Tomlinson]:
    """k (X_c - X) of each slip [N], X_c where it would be without heat."""
    b, model = bench(ETA, **WARM, plant__seed=seed)
    start, h = model.last_support - 0.9 * A, b.plant.dt
    b.run(along(np.linspace(0.0, start, 2000)))
    steps = round((count + 0.9) * A / (v * h))
    X, place = [], []
    for first in range(0, steps, 40_000):
        r = b.run(along(start + v * h * np.arange(first + 1, min(first + 40_000, steps) + 1)))
        X.append(r.X.copy())
        place.append(r.A_x.copy())
    X, u = np.concatenate(X), np.concatenate(place)
    # A slip is done when the next minimum is passed for the first time.
    found = [X[np.argmax(u > (i + 1.0) * A)] - i * A for i in range(count) if u.max() > (i + 1.0) * A]
    return model.k * (model.last_support - np.array(found)), model


def test_mean_force_against_the_logarithm_of_velocity_lies_on_the_closed_form_within_its_noise():
    lags = []
    speeds = (1e-8, 1e-7, 4e-7)
    for v, count in zip(speeds, (8, 40, 60), strict=True):
        lag, model = slip_lags(v, count, 1)
        mean, deviation = model.thermal_slip(v, MASS, DAMPING, T)
        noise = deviation / math.sqrt(len(lag))
        lags.append((lag.mean(), noise))
        assert lag.mean() == pytest.approx(mean, abs=3.5 * noise)
        assert lag.std() == pytest.approx(deviation, rel=4.0 / math.sqrt(2.0 * len(lag)) + 0.1)
        # The closed form is the leading order in kT / E: 1.5 % of the force off the integral of Kramers' rate.
        assert lag.mean() == pytest.approx(
            model.closed_form_slip(v, MASS, DAMPING, T), abs=3.5 * noise + 0.016 * model.peak
        )
    # (k (X_c - X))^(3/2) falls by kT ln of velocity: the slope over 1.6 decades.
    drop = lags[0][0] ** 1.5 - lags[2][0] ** 1.5
    c = (2.0 * math.pi / A) ** 2 * model.peak
    expected = BOLTZMANN * T / (4.0 / 3.0 * math.sqrt(2.0 / c)) * math.log(speeds[2] / speeds[0])
    noise = 1.5 * math.hypot(*(math.sqrt(value) * spread for value, spread in (lags[0], lags[2])))
    assert drop == pytest.approx(expected, abs=3.5 * noise)


def test_heat_is_drawn_by_the_seed():
    def end(seed: int) -> float:
        b, _ = bench(ETA, **WARM, plant__seed=seed)
        return float(b.run(along(np.zeros(50))).A_x[-1])

    assert end(3) == end(3)
    assert end(3) != end(4)
