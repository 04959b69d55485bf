"""What a user makes of measured arrays: calibration, force curves, friction loops. SI units, standard uncertainties.

Nothing here knows the simulated instrument: the functions take arrays from any microscope.
"""

from .curves import CurveAnalysis, deflection_sensitivity, force_curve, tilted_stiffness
from .estimate import Estimate
from .loops import FrictionLoop, friction_loop, means
from .thermal import ThermalTune, spring_constant
from .wedge import WedgeCalibration, wedge_by_flat, wedge_ogletree, wedge_varenberg

__all__ = [
    "CurveAnalysis",
    "Estimate",
    "FrictionLoop",
    "ThermalTune",
    "WedgeCalibration",
    "deflection_sensitivity",
    "force_curve",
    "friction_loop",
    "means",
    "spring_constant",
    "tilted_stiffness",
    "wedge_by_flat",
    "wedge_ogletree",
    "wedge_varenberg",
]
