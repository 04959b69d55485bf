"""Elementary functions of + - * / and bits alone: the same result to the last bit on every processor.

The C library's and numpy's differ between versions and, with their fast ways for some processors, within one. These
here are what every run stands on, its constants and tables included; tools/check_elementary.py names any other in the
rooms of a run. They have no call and no branch that a compiler cannot make a select, so that loops over many
instruments become vectors. Worst errors: docs/numerics.md.

Kernels take them, and plain Python does, with the same bits, some microseconds a call. Arguments and results are
float64; subnormal arguments of `log` and `cbrt` are not allowed. Polynomials are near minimax on the reduced range,
found by interpolation in Chebyshev points with 40 digits.
"""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..compiled.bits import bits_of, from_bits
from ..compiled.jit import inlined, routine

_Number = TypeVar("_Number", float, NDArray[np.float64])

_ROUND = 6755399441055744.0
"""1.5 times 2^52: added to a number below 2^51 it rounds it to a whole one, which then stands in the lowest bits."""
_HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
_LN2 = (0.6931471803691238, 1.9082149292705877e-10)
"""Constants in parts; the first have 33 and 32 bits, so that products with small whole numbers are exact."""
_ONE = 0x3FF0000000000000
"""Bits of 1."""


@inlined
def sincos(x: float) -> tuple[float, float]:
    """(sin x, cos x), for |x| up to 1e15; beyond 1e6 as exact as x itself is."""
    shifted = x * 0.6366197723675814 + _ROUND
    quarter = bits_of(shifted)
    k = shifted - _ROUND
    # What is left of x after k quarter turns, in two parts; the products are exact.
    a, b = x - k * _HALF_PI[0], k * _HALF_PI[1]
    r = a - b
    rest = ((a - r) - b) - k * _HALF_PI[2]
    z = r * r
    high = 2.755731610068303e-06 + z * (-2.5051131455427946e-08 + z * 1.591810123027412e-10)
    p = 0.008333333333330946 + z * (-0.0001984126983675497 + z * high)
    s = r + (r * z * (-0.16666666666666666 + z * p) + rest * (1.0 - 0.5 * z))
    high = -2.7557317270560326e-07 + z * (2.0876146024689747e-09 + z * -1.1382614868556325e-11)
    p = 0.041666666666666664 + z * (-0.0013888888888887395 + z * (2.4801587298763433e-05 + z * high))
    half = 0.5 * z
    w = 1.0 - half
    c = w + (((1.0 - w) - half) + (z * z * p - r * rest))
    odd = (quarter & 1) != 0
    sine, cosine = (c, s) if odd else (s, c)
    return -sine if (quarter & 2) != 0 else sine, -cosine if ((quarter + 1) & 2) != 0 else cosine


@inlined
def sin(x: float) -> float:
    """Sine: see `sincos`."""
    return sincos(x)[0]


@inlined
def cos(x: float) -> float:
    """Cosine: see `sincos`."""
    return sincos(x)[1]


@inlined
def tan(x: float) -> float:
    """Tangent: see `sincos`."""
    s, c = sincos(x)
    return s / c


@inlined
def _exponential(x: float) -> tuple[float, float, float]:
    """(p, a, b) with exp(x) = (1 + p) a b, where a and b are powers of 2; x is kept within -746 to 710."""
    x = min(max(x, -746.0), 710.0)
    shifted = x * 1.4426950408889634 + _ROUND
    n = bits_of(shifted) - bits_of(_ROUND)
    k = shifted - _ROUND
    a, b = x - k * _LN2[0], k * _LN2[1]
    r = a - b
    rest = (a - r) - b
    high = 2.75572632790885e-07 + r * (2.505207109429355e-08 + r * (2.0918137737642736e-09 + r * 1.608662795678037e-10))
    high = 0.00019841269841263298 + r * (2.4801587336442236e-05 + r * (2.755731924721873e-06 + r * high))
    high = 0.04166666666666668 + r * (0.008333333333333333 + r * (0.0013888888888879073 + r * high))
    p = r + (r * r * (0.5 + r * (0.16666666666666666 + r * high)) + rest * (1.0 + r))
    half = n >> 1
    return p, from_bits(_ONE + (half << 52)), from_bits(_ONE + ((n - half) << 52))


@inlined
def exp(x: float) -> float:
    """Exponential; 0 below -745.2, infinite above 709.8."""
    p, a, b = _exponential(x)
    found = (a + a * p) * b
    return found if x == x else x


@inlined
def expm1(x: float) -> float:
    """exp(x) - 1, without loss of digits near 0; infinite above 709.8."""
    p, a, b = _exponential(x)
    # Below one half of the last digit of 1 the powers of 2 do not matter, and above 2^100 the 1 does not.
    scale = a * b
    found = scale * p + (scale - 1.0) if scale < 1e30 else (a + a * p) * b
    return found if x == x else x


@inlined
def log(x: float) -> float:
    """Natural logarithm of a number that is not subnormal; minus infinity at 0, NaN below."""
    i = bits_of(x)
    # x = 2^k (1 + f) with 1 + f between sqrt(1/2) and sqrt(2).
    k = (i - 0x3FE6A09E667F3BCD) >> 52
    f = from_bits(i - (k << 52)) - 1.0
    s = f / (2.0 + f)
    z = s * s
    high = 0.18182889786191042 + z * (0.15331699633543858 + z * 0.14616721179861816)
    r = z * (
        0.666666666666667 + z * (0.3999999999989938 + z * (0.28571428626031065 + z * (0.2222221112572281 + z * high)))
    )
    half = 0.5 * f * f
    n = float(k)
    found = n * _LN2[0] - ((half - (s * (half + r) + n * _LN2[1])) - f)
    if x > 0.0:
        return found if x < math.inf else x
    return -math.inf if x == 0.0 else math.nan


@inlined
def tanh(x: float) -> float:
    """Hyperbolic tangent."""
    size = min(abs(x), 30.0)
    t = expm1(2.0 * size)
    found = t / (t + 2.0) if size < 1.0 else 1.0 - 2.0 / (t + 2.0)
    return math.copysign(found, x) if x == x else x


@inlined
def sinh(x: float) -> float:
    """Hyperbolic sine, for |x| up to 709."""
    t = expm1(abs(x))
    return math.copysign(0.5 * (t + t / (t + 1.0)), x)


@inlined
def cosh(x: float) -> float:
    """Hyperbolic cosine, for |x| up to 709."""
    t = exp(abs(x))
    return 0.5 * (t + 1.0 / t)


@inlined
def inverse_cbrt(x: float) -> float:
    """1 / cbrt(x), for x > 0."""
    # A third of the exponent gives it to 4 %; two steps of fourth order, without division, give all digits.
    y = from_bits(0x553EF0FF289DD796 - (bits_of(x) >> 22) * 1398101)
    for _ in range(2):
        e = 1.0 - (x * y) * (y * y)
        y += (y * e) * ((1.0 / 3.0 + e * (2.0 / 9.0)) + (e * e) * (14.0 / 81.0))
    return y


@inlined
def cbrt(x: float) -> float:
    """Cube root."""
    size = abs(x)
    y = inverse_cbrt(size)
    root = size * (y * y)
    root -= (root * root * root - size) * ((y * y) * (1.0 / 3.0))
    return math.copysign(root, x) if size > 0.0 and size < math.inf else x


@inlined
def hypot(x: float, y: float) -> float:
    """Length of (x, y), both between 1e-150 and 1e150 in size, or 0."""
    return math.sqrt(x * x + y * y)


@inlined
def square(x: _Number) -> _Number:
    """x times x, of a number or an array; `x**2` is the C library's pow."""
    return x * x


@inlined
def power(x: float, y: float) -> float:
    """x to the y, for x > 0: relative error some 2e-16 |y log x|. Thirds and quarters: `cbrt` and square roots."""
    return exp(y * log(x))


@routine
def sincos_each(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sine and cosine of every number of an array (n,)."""
    s, c = np.empty(x.size), np.empty(x.size)
    for i in range(x.size):
        s[i], c[i] = sincos(x[i])
    return s, c


@routine
def power_each(x: NDArray[np.float64], y: float) -> NDArray[np.float64]:
    """Every number of an array (n,) to the y: see `power`."""
    found = np.empty(x.size)
    for i in range(x.size):
        found[i] = power(x[i], y)
    return found
