"""Contact of tip and sample: JKR, Maugis and Dugdale, and the bound of friction."""

from .friction import bound_of_load, friction_impulse
from .jkr import indentation_of_u, radius_at_zero_load, u_of_load

__all__ = ["bound_of_load", "friction_impulse", "indentation_of_u", "radius_at_zero_load", "u_of_load"]
