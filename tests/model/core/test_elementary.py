"""Claims about the elementary functions: how exact they are; compiled and in plain Python they have the same bits."""

import math
from collections.abc import Callable
from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.typing import NDArray

from afm_model.compiled.jit import routine
from afm_model.core import elementary

_PI = Decimal("3.1415926535897932384626433832795028841971693993751058209749445923")


def _sine(x: Decimal) -> Decimal:
    """Sine by its series, of what is left of whole turns."""
    x = x - 2 * _PI * (x / (2 * _PI)).to_integral_value()
    term = total = x
    n = 1
    while abs(term) > Decimal(10) ** -45:
        n += 2
        term *= -x * x / (n * (n - 1))
        total += term
    return total


def _tanh(x: Decimal) -> Decimal:
    e = (2 * x).exp()
    return (e - 1) / (e + 1)


EXACT: dict[str, Callable[[Decimal], Decimal]] = {
    "sin": _sine,
    "cos": lambda x: _sine(x + _PI / 2),
    "tan": lambda x: _sine(x) / _sine(x + _PI / 2),
    "exp": lambda x: x.exp(),
    "expm1": lambda x: x.exp() - 1,
    "log": lambda x: x.ln(),
    "tanh": _tanh,
    "sinh": lambda x: (x.exp() - (-x).exp()) / 2,
    "cosh": lambda x: (x.exp() + (-x).exp()) / 2,
    "cbrt": lambda x: (abs(x).ln() / 3).exp().copy_sign(x),
    "inverse_cbrt": lambda x: (-x.ln() / 3).exp(),
}
WORST = {
    "sin": 1.5,
    "cos": 1.5,
    "tan": 2.5,
    "exp": 0.9,
    "expm1": 1.4,
    "log": 0.9,
    "tanh": 2.1,
    "sinh": 2.0,
    "cosh": 1.3,
}
WORST |= {"cbrt": 1.0, "inverse_cbrt": 1.6}
"""Largest error in units in the last place of the result."""


def _arguments(name: str, n: int = 700) -> NDArray[np.float64]:
    random = np.random.default_rng(7)
    either = random.choice([-1.0, 1.0], n)
    small = 10.0 ** random.uniform(-17, 0, n)
    near = random.uniform(0.2, 5.0, n)
    match name:
        case "sin" | "cos" | "tan":
            return np.concatenate([either * 10.0 ** random.uniform(-6, 6, n), either * near])
        case "log":
            return np.concatenate([10.0 ** random.uniform(-300, 300, n), near, 1.0 + either * small * 0.2])
        case "cbrt":
            return np.concatenate([either * 10.0 ** random.uniform(-300, 300, n), near])
        case "inverse_cbrt":
            return np.concatenate([10.0 ** random.uniform(-300, 300, n), near])
    return np.concatenate([either * small, either * near, either * random.uniform(5.0, 700.0, n)])


@pytest.mark.parametrize("name", EXACT)
def test_error_is_within_the_table_of_the_docs(name: str) -> None:
    function, worst = getattr(elementary, name), 0.0
    with localcontext() as context:
        context.prec = 50
        for x in _arguments(name).tolist():
            exact = EXACT[name](Decimal(x))
            worst = max(worst, float(abs(Decimal(function(x)) - exact) / Decimal(math.ulp(float(exact)))))
    assert 0.4 < worst < WORST[name]


@pytest.mark.parametrize("name", EXACT)
def test_compiled_in_a_loop_and_in_plain_python_it_has_the_same_bits(name: str) -> None:
    function = getattr(elementary, name)

    @routine
    def compiled(x: NDArray[np.float64]) -> NDArray[np.float64]:
        y = np.empty(x.size)
        for i in range(x.size):
            y[i] = function(x[i])
        return y

    x = np.concatenate([_arguments(name, 200), [0.0, math.inf, -math.inf, math.nan]])
    assert compiled(x).tobytes() == np.array([function(each) for each in x.tolist()]).tobytes()


def test_ends_of_the_range_are_those_of_the_functions() -> None:
    e = elementary
    assert (e.exp(-math.inf), e.exp(-800.0), e.exp(0.0), e.exp(710.0), e.exp(math.inf)) == (0, 0, 1, math.inf, math.inf)
    assert (e.expm1(-math.inf), e.expm1(0.0), e.expm1(math.inf)) == (-1.0, 0.0, math.inf)
    assert (e.log(0.0), e.log(1.0), e.log(math.inf)) == (-math.inf, 0.0, math.inf)
    assert (e.tanh(-math.inf), e.tanh(0.0), e.tanh(math.inf)) == (-1.0, 0.0, 1.0)
    assert (e.cbrt(0.0), e.cbrt(-8.0), e.cbrt(math.inf)) == (0.0, -2.0, math.inf)
    assert (e.sincos(0.0), e.hypot(3.0, -4.0), e.power(4.0, 0.5)) == ((0.0, 1.0), 5.0, 2.0)
    for undefined in (e.exp(math.nan), e.log(-1.0), e.log(math.nan), e.sin(math.inf), e.cbrt(math.nan)):
        assert math.isnan(undefined)
