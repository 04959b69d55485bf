"""What runs inside the instrument, the family onboard, and what can be set of it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

from ..compiled.calls import NUMBER
from .part import CONSTANTS, STATE, Channel, Kernel, Part, Tree
from .signals import Actuation, Detection, Setpoint

_Z_CHANNELS = (Channel("z_loop", "m", "z"), Channel("z_loop_error", "V", "error"))


@dataclass(frozen=True, kw_only=True)
class Onboard(Part):
    """What runs inside the instrument at the rate of the virtual ADC: `regulate(t, d, r, u, p, s)` may change drive u.

    Without it nothing runs there. d is the photodetector's last sample, r the reference of the control tick. One that
    moves z does with it what `r.z_mode` says.

    Parameters
    ----------
    begin : callable
        (parameters, s, drive [V]) -> None: given the drive (x, y, z) that holds the plant at the start, may write s;
        called if the part has a state. If not given, it writes `s.z` of a part that moves z.
    moves_z : bool
        It drives z, whatever is asked along z. The instrument itself takes z from it by `r.z_mode` GIVEN: u is z then,
        and the part goes on from there later. Unless it declares channels, the fields `z` of its state (z as
        driven [m], positive towards the sample) and `error` (setpoint less deflection [V]) are the channels `z_loop`,
        which verbs need, and `z_loop_error`.
    setpoint : callable, optional
        Parameters -> setpoint of the deflection [V], which verbs need; if not given, the setting `setpoint_voltage`.
    settings : mapping of str to str
        Of what verbs and services set, names of ONBOARD_SETTINGS, the names of its parameters. A setting that it lacks
        is refused in words.
    """

    family = "onboard"
    functions: ClassVar = {"regulate": (NUMBER, Detection, Setpoint, Actuation, CONSTANTS, STATE)}

    regulate: Kernel | None = None
    excites: bool = False
    """It also writes how the cantilever is excited: `amplitude` and the fields after it of u, an Actuation, which stay
    until it writes others.
    """
    moves_z: bool = False
    begin: Callable[[Any, Any, tuple[float, float, float]], None] | None = None
    setpoint: Callable[[Tree], float] | None = None
    settings: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """What a loop that moves z need not say."""
        defaults: dict[str, Any] = {"begin": self._begin}
        if self.moves_z:
            defaults["channels"] = tuple(each for each in _Z_CHANNELS if each.field in self.state.names)
        if "setpoint_voltage" in self.settings:
            defaults["setpoint"] = partial(self.setting, name="setpoint_voltage")
        for name, default in defaults.items():
            if not getattr(self, name):
                object.__setattr__(self, name, default)

    def _begin(self, parameters: Tree, s: Any, drive: tuple[float, float, float]) -> None:
        """From the drive that holds the start, without a jump."""
        if self.moves_z and "z" in self.state.names:
            s.z = parameters.piezo.sensitivity_z * drive[2]

    def setting(self, parameters: Tree, name: str, default: Any = math.nan) -> Any:
        """A setting as it is, by its name in ONBOARD_SETTINGS; `default` if this loop lacks it."""
        return getattr(parameters.onboard, self.settings[name]) if name in self.settings else default


ONBOARD_SETTINGS = (
    *("setpoint_force", "setpoint_voltage"),  # [N], [V]; 0: by the other one, or as the loop has it
    *("proportional_gain", "integral_gain"),  # [m/V], [m/(V s)]
    "feedback",  # on, hold, off or external
    *("low", "high"),  # limits of z [m]
)
"""What can be set of a loop inside the instrument that moves z, see `Onboard.settings`."""
TAPPING_SETTINGS = ("setpoint_amplitude", "setpoint_share")
"""Besides, of one that may regulate an amplitude: [m], part of the free one; 0: by the other one."""
NO_DEFLECTION = 1e-12
"""The setpoint 0 V as a setting, the least that a parameter may be [V]: one of 0 is not given."""
