"""Analysis of measured arrays: calibration, force curves, friction loops, images. SI units, uncertainties.

Nothing here knows the simulated instrument: the functions take arrays from any microscope.
"""

from ..cantilever.tilted import along_normal, tilted_deflection, tilted_stiffness
from .contact_resonance import contact_stiffness
from .estimate import Estimate, correlated_mean, correlation_length
from .force_curves import CurveAnalysis, deflection_sensitivity, force_curve
from .frequency_modulation import ShiftForce, energy_from_drive, force_from_shift, frequency_shift
from .friction_load import FrictionLoadFit, friction_load_fit
from .loops import LoopForces, dissipated, friction_loop, line_loop, means
from .modulus import ContactFit, contact_fit, young
from .regions import Contrast, Roughness, contrast, roughness, two_levels
from .resonance import ResonanceFit, resonance_fit
from .step_heights import Edge, edges, step_height
from .tapping import TappingEnergy, beam_energy, tapping_energy
from .thermal import ThermalResult, spring_constant
from .wedge import WedgeCalibration, wedge_by_flat, wedge_ogletree, wedge_varenberg

__all__ = [
    "ContactFit",
    "Contrast",
    "CurveAnalysis",
    "Edge",
    "Estimate",
    "FrictionLoadFit",
    "LoopForces",
    "ResonanceFit",
    "Roughness",
    "ShiftForce",
    "TappingEnergy",
    "ThermalResult",
    "WedgeCalibration",
    "along_normal",
    "beam_energy",
    "contact_fit",
    "contact_stiffness",
    "contrast",
    "correlated_mean",
    "correlation_length",
    "deflection_sensitivity",
    "dissipated",
    "edges",
    "energy_from_drive",
    "force_curve",
    "force_from_shift",
    "frequency_shift",
    "friction_load_fit",
    "friction_loop",
    "line_loop",
    "means",
    "resonance_fit",
    "roughness",
    "spring_constant",
    "step_height",
    "tapping_energy",
    "tilted_deflection",
    "tilted_stiffness",
    "two_levels",
    "wedge_by_flat",
    "wedge_ogletree",
    "wedge_varenberg",
    "young",
]
