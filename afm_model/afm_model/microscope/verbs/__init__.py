"""What a microscope can be asked to do. Each is also an action of afm_msgs, with the same fields."""

from ...core.registry import register
from .calibrate_lateral import CalibrateLateral
from .calibrate_sensitivity import CalibrateSensitivity
from .force_curve import ForceCurve
from .friction_loop import FrictionLoop
from .going import Approach, MoveTo, Withdraw
from .scan import Scan
from .scan_path import ScanPath
from .thermal_tune import ThermalTune

register(Approach, Withdraw, MoveTo, ForceCurve, FrictionLoop, Scan, ScanPath)
register(ThermalTune, CalibrateSensitivity, CalibrateLateral)

__all__ = [
    "Approach",
    "CalibrateLateral",
    "CalibrateSensitivity",
    "ForceCurve",
    "FrictionLoop",
    "MoveTo",
    "Scan",
    "ScanPath",
    "ThermalTune",
    "Withdraw",
]
