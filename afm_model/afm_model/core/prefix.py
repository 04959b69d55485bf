"""Numbers with units as people read them: 1.5e-7 m is 150 nm."""

import math

_PREFIXES = {-5: "f", -4: "p", -3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}
_TAKE_ONE = ("m", "N", "V", "s", "Hz", "Pa", "A")
"""Units that a prefix is put before; another keeps its numbers."""


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Factor by which numbers in `unit` are multiplied, and the unit that they then have.

    Parameters
    ----------
    largest : float
        Magnitude of the largest of them.
    unit : str
        SI unit; "1" for a pure number.

    Returns
    -------
    (float, str)
        1e9 and "nm" for `largest` 5e-9 and "m".
    """
    if unit not in _TAKE_ONE or not math.isfinite(largest) or largest == 0.0:
        return 1.0, "" if unit == "1" else unit
    # 999.99 nm is read as 1 µm.
    power = math.floor(math.log10(abs(largest) * 1.00001) / 3.0)  # no part of a run
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return 1000.0**-power, _PREFIXES[power] + unit  # no part of a run


def text(value: float, unit: str, digits: int = 4) -> str:
    """A number with its unit, as "150 nm"; "not measured" for NaN."""
    if math.isnan(value):
        return "not measured"
    factor, shown = prefixed(value, unit)
    return f"{value * factor:.{digits}g} {shown}".rstrip()
