"""What a microscope can be asked to do; over topics each by an action of its name, or by the action `verb`."""

from ...core.registry import register
from .amplitude_curve import AmplitudeCurve
from .calibrate_lateral import CalibrateLateral
from .calibrate_sensitivity import CalibrateSensitivity
from .contact_resonance import ContactResonance
from .force_curve import ForceCurve
from .friction_loop import FrictionLoop
from .going import Approach, MoveTo, Withdraw
from .lift import Lift
from .read import Read
from .scan import Scan
from .scan_path import ScanPath
from .thermal_tune import ThermalTune
from .tune import Tune
from .z import Hold, MoveZ

register(Approach, Withdraw, MoveTo, ForceCurve, FrictionLoop, Scan, ScanPath)
register(
    ThermalTune, CalibrateSensitivity, CalibrateLateral, Tune, AmplitudeCurve, Lift, ContactResonance, Read, MoveZ, Hold
)

__all__ = [
    "AmplitudeCurve",
    "Approach",
    "CalibrateLateral",
    "CalibrateSensitivity",
    "ContactResonance",
    "ForceCurve",
    "FrictionLoop",
    "Hold",
    "Lift",
    "MoveTo",
    "MoveZ",
    "Read",
    "Scan",
    "ScanPath",
    "ThermalTune",
    "Tune",
    "Withdraw",
]
