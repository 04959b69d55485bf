"""What a microscope can be asked to do: one file a verb. Each is also an action of afm_msgs, with the same fields."""

from ...core.registry import register
from .approach import Approach
from .calibrate_lateral import CalibrateLateral
from .calibrate_sensitivity import CalibrateSensitivity
from .force_curve import ForceCurve
from .friction_loop import FrictionLoop
from .move_to import MoveTo
from .scan import Scan
from .scan_path import ScanPath
from .thermal_tune import ThermalTune
from .withdraw import Withdraw

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
