"""How large and how small a number may be, by its unit: beyond, nothing in or around a microscope is.

A declaration may say less (`Le`, `Ge`); where it says nothing, this holds. So no parameter and no field of a verb takes
a number that the instrument cannot compute with.
"""

import math

LARGEST_INTEGER = 2**63 - 1
"""Of 64 bits, as messages and compiled code have them."""
RANGES: dict[str, tuple[float, float]] = {
    "1": (1e-12, 1e12),
    "1/s": (1e-6, 1e15),
    "Hz": (1e-7, 1e9),
    "J": (1e-24, 1e-12),
    "J/m^2": (1e-9, 1e3),
    "K": (1e-3, 1e5),
    "N": (1e-18, 1.0),
    "N m/rad": (1e-16, 1.0),
    "N/V": (1e-15, 1.0),
    "N/m": (1e-6, 1e9),
    "N/s": (1e-12, 1e6),
    "Pa": (1e-3, 1e15),
    "Pa s": (1e-9, 1e9),
    "m^3": (1e-36, 1e-6),
    "V": (1e-12, 1e6),
    "V/(m s)": (1e-6, 1e24),
    "V/m": (1e-9, 1e18),
    "V s/m": (1e-12, 1e15),
    "V/s": (1e-6, 1e12),
    "V/sqrt(Hz)": (1e-15, 1e3),
    "kg": (1e-24, 1e3),
    "m": (1e-18, 1.0),
    "m/(V s)": (1e-15, 1e3),
    "m/V": (1e-15, 1e-4),
    "m/s": (1e-16, 10.0),
    "m/sqrt(Hz)": (1e-20, 1e-3),
    "rad": (1e-12, 2.0 * math.pi),
    "rad/m": (1e-9, 1e13),
    "rad/s": (1e-6, 1e12),
    "s": (1e-15, 1e9),
}
"""Smallest size of a number that is not 0, and largest."""
WIDEST = (1e-30, 1e30)
"""The same for a unit that is not in the table."""
