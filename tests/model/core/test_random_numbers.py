"""Claims about the random numbers in a plant's step."""

import numpy as np
from scipy import stats

from afm_model.compiled.jit import kernel
from afm_model.core.random_numbers import bits, key_of, normal, uniform


@kernel
def drawn(key: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    flat, bell = np.empty(n), np.empty(n)
    for i in range(n):
        flat[i], bell[i] = uniform(bits(key, i)), normal(key, i)
    return flat, bell


def test_numbers_are_uniform_and_normal_out_to_the_tails():
    flat, bell = drawn(key_of(0, 1), 400_000)
    assert stats.kstest(flat, "uniform").pvalue > 1e-3
    assert stats.kstest(bell, "norm").pvalue > 1e-3
    # The tail is drawn by another way from 3.65 on.
    for edge in (3.0, 3.7, 4.2):
        expected = len(bell) * 2.0 * stats.norm.sf(edge)
        assert abs((np.abs(bell) > edge).sum() - expected) < 4.0 * expected**0.5
    # Mean, variance and correlation of neighbours, in standard errors.
    n = len(bell)
    assert abs(bell.mean()) * n**0.5 < 4.0
    assert abs(bell.var() - 1.0) * (0.5 * n) ** 0.5 < 4.0
    for lag in (1, 2, 4):
        assert abs(np.corrcoef(bell[:-lag], bell[lag:])[0, 1]) * n**0.5 < 4.0


def test_every_seed_and_every_stream_has_numbers_of_its_own():
    keys = {key_of(seed, stream) for seed in (0, 1, 2**63 - 1) for stream in (1, 1000)}
    assert len(keys) == 6
    series = [drawn(key, 100_000)[1] for key in keys]
    correlation = np.corrcoef(series) - np.eye(6)
    assert np.abs(correlation).max() < 4.0 / 100_000**0.5
    assert (drawn(key_of(0, 1), 100)[1] == drawn(key_of(0, 1), 100)[1]).all()
