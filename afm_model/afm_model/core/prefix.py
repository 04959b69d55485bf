"""Numbers with units as people read them: 1.5e-7 m is 150 nm."""

import math

_PREFIXES = {-5: "f", -4: "p", -3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}
_TAKE_ONE = ("m", "N", "V", "s", "Hz", "Pa", "A", "J", "N/m", "m/V", "N/V", "m/s", "V/s")
"""Units that a prefix is put before, these per sqrt(Hz) too; another keeps its numbers."""
_DEGREES = "°"


def prefixed(unit: str, *values: float) -> tuple[float, str]:
    """Factor by which numbers in `unit` are multiplied, and the unit that they then have.

    Parameters
    ----------
    unit : str
        SI unit; "1" for a pure number.
    *values : float
        The numbers: the largest that is finite counts.

    Returns
    -------
    (float, str)
        1e9 and "nm" for "m" and 5e-9; angles [rad] become degrees.
    """
    if unit == "rad":
        return 180.0 / math.pi, _DEGREES
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if unit.removesuffix("/sqrt(Hz)") not in _TAKE_ONE or largest == 0.0:
        return 1.0, "" if unit == "1" else unit
    # 999.99 nm is read as 1 µm.
    power = math.floor(math.log10(largest * 1.00001) / 3.0)  # no part of a run
    # Nobody reads kiloseconds.
    power = min(max(power, min(_PREFIXES)), 0 if unit == "s" else max(_PREFIXES))
    return 1000.0**-power, _PREFIXES[power] + unit  # no part of a run


def text(value: float, unit: str, digits: int = 4, unknown: str = "not measured") -> str:
    """Return a number with its unit, as "150 nm" or "90°"; the words `unknown` for one that is not finite."""
    if not math.isfinite(value):
        return unknown
    factor, shown = prefixed(unit, value)
    return f"{value * factor:.{digits}g}{'' if shown == _DEGREES else ' '}{shown}".rstrip()
