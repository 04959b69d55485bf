"""Claims about `make bench`: its C is the plant of afm_model, on every branch, and what it measures can be built."""

import numpy as np
import pytest
from bench import kernel, lever

from afm_model import InstrumentParameters, build
from afm_model.plant.presets import LEVERS


def test_c_and_numba_take_the_same_steps_through_lost_and_made_contact(tmp_path, rng):
    start, u = kernel.problem()
    u = u[:400] + rng.normal(size=(400, 3)) * [5.0, 5.0, 30.0] / kernel.gains(start)
    native = {name: kernel.compile_c(tmp_path, name) for name in kernel.FLAGS}
    one, others = start.copy(), {name: start.copy() for name in native}
    contact, stuck = set(), set()
    for row in range(len(u)):
        kernel.advance(one, u[row : row + 1], 5)
        for name, advance in native.items():
            advance(others[name], u[row : row + 1], 5)
            assert kernel.difference(one, others[name]) <= kernel.TOLERANCE
        contact.add(kernel.state(one).contact)
        stuck.add(kernel.state(one).V_X == 0.0)
    assert (contact, stuck) == ({0.0, 1.0}, {False, True})


def test_measure_refuses_to_compare_different_motions(tmp_path, monkeypatch):
    def standing(m, u, hold):
        """Does nothing, very fast."""

    monkeypatch.setattr(kernel, "compile_c", lambda folder, name: standing)
    with pytest.raises(RuntimeError, match="not the plant"):
        kernel.measure(tmp_path, repeats=1)


def test_measure_tells_why_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel, "COMPILER", "no-such-compiler")
    assert list(kernel.measure(tmp_path)) == ["reason"]


def test_measure_gives_ratios(tmp_path):
    result = kernel.measure(tmp_path, repeats=1)
    numba = result["numba"]
    assert numba["real_time_factor"] == pytest.approx(1000.0 / numba["ns_per_step"])
    for name in kernel.FLAGS:
        assert result[name]["ratio"] == pytest.approx(numba["ns_per_step"] / result[name]["ns_per_step"])
    assert np.isfinite(result["c"]["ratio"])


def test_every_cantilever_is_measured_with_steps_that_it_allows():
    cases = lever.cases()
    assert set(LEVERS) <= set(cases)
    for values in cases.values():
        build(InstrumentParameters, values)
