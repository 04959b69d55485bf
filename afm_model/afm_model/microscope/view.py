"""The instrument as verbs see it: sizes, limits, where everything stands. SI units."""

import math
from typing import Any

from ..core import registry
from ..core.elementary import hypot
from ..core.errors import ParameterError
from ..instrument import Instrument
from ..onboard.by_amplitude import lag, taps
from ..parameters import changed
from ..parts.onboard import Onboard
from ..parts.signals import FOLLOW
from ..parts.ticks import ticks_of
from ..program.orders import Polynomial, quintic

Z_CHANNEL, ERROR_CHANNEL = "z_loop", "z_loop_error"
"""Channels of a loop that moves z: z as driven [m], positive towards the sample; setpoint less deflection [V]."""
CALIBRATIONS = {"spring_constant": "N/m", "deflection_sensitivity": "m/V", "lateral_sensitivity": "N/V"}
"""What can be calibrated, parameters `calibration.*`, and the units by which results are known."""
_TRAVEL = 500e-6
"""Of a scanner without piezo.limit, to each side [m]."""
_SETTLING = 3.0
"""A motion takes at least so many periods of the scanner's resonance."""
_STEEPEST = 1.875
"""Largest velocity of a quintic from rest to rest over its mean velocity."""


_BAND = 1.4
"""The first resonance of a cantilever is within this factor of its nominal one; higher modes are beyond, folded or not.
"""


def z_loop(parameters: Any) -> Onboard:
    """The loop inside the instrument."""
    found: Onboard = registry.find("onboard", parameters.onboard.kind)
    return found


def sensitivities(parameters: Any) -> tuple[float, float]:
    """Deflection across the cantilever [m] and lateral force [N] over voltage, as they are believed."""
    plant, detector, calibrated = parameters.plant, parameters.detector, parameters.calibration
    deflection = calibrated.deflection_sensitivity or detector.deflection_sensitivity
    if calibrated.deflection_sensitivity and plant.spring_constant(parameters) != 0.0:
        # It is for vertical motion.
        deflection *= plant.deflection_under(parameters, 1.0) * plant.vertical_stiffness(parameters)
    return float(deflection), float(calibrated.lateral_sensitivity or detector.lateral_sensitivity)


class InstrumentView:
    """What there is to plan with.

    Parameters
    ----------
    instrument : Instrument
    """

    def __init__(self, instrument: Instrument) -> None:
        self.instrument = instrument
        parameters = instrument.parameters
        self.control_period = parameters.plant.control_period
        self.sample_period = parameters.detector.sample_period
        self.samples_per_tick = instrument.samples_per_tick
        piezo, plant = parameters.piezo, parameters.plant
        self.travel = tuple(
            piezo.limit * getattr(piezo, f"sensitivity_{axis}") if piezo.limit > 0.0 else _TRAVEL for axis in "xy"
        )
        """Of the scanner to each side, along x and y [m]."""
        scanner: Any = plant.scanner_numbers or parameters.scanner
        self.resonance: float = min(scanner.f_x, scanner.f_y)
        """Lower one of the scanner along x and y [Hz]."""

    @property
    def parameters(self) -> Any:
        """Of the instrument, as they are now."""
        return self.instrument.parameters

    @property
    def spring_constant(self) -> float:
        """Of the cantilever, as it is believed [N/m]; 0: not known."""
        return float(self.parameters.plant.spring_constant(self.parameters))

    @property
    def pull_off(self) -> float:
        """Adhesion of tip and sample, 2 pi w R [N]; 0: not known."""
        plant = self.parameters.plant
        pair = getattr(plant, "pair_numbers", None)
        return float(2.0 * math.pi * pair.work_of_adhesion * self.tip_radius) if pair is not None else 0.0

    @property
    def tip_radius(self) -> float:
        """Radius of the tip [m]."""
        return float(self.parameters.plant.radius_of_tip(self.parameters))

    @property
    def vertical_stiffness(self) -> float:
        """Spring constant for vertical forces [N/m]."""
        return float(self.parameters.plant.vertical_stiffness(self.parameters))

    @property
    def vertical_sensitivity(self) -> float:
        """Vertical motion of the tip over voltage [m/V], from that of the detector, which is across the cantilever."""
        if self.spring_constant == 0.0:
            return self.deflection_sensitivity
        return 1.0 / (self.vertical_stiffness * self.volts(1.0))

    @property
    def deflection_sensitivity(self) -> float:
        """Deflection across the cantilever over voltage, as it is believed [m/V]."""
        return sensitivities(self.parameters)[0]

    @property
    def resonance_band(self) -> tuple[float, float] | None:
        """Frequencies among which the first resonance of the cantilever is looked for, by its nominal one [Hz]."""
        c = self.parameters.plant.cantilever_numbers
        return None if c is None else (c.f0 / _BAND, min(c.f0 * _BAND, 0.5 / self.sample_period))

    @property
    def loop(self) -> Onboard:
        """The loop inside that moves z."""
        return z_loop(self.parameters)

    @property
    def setpoint(self) -> float:
        """Setpoint of the deflection, or of the amplitude of a tip that taps [V]; NaN: the loop does not report it."""
        return self.loop.setpoint(self.parameters) if self.loop.setpoint is not None else math.nan

    @property
    def taps(self) -> bool:
        """Whether the z loop regulates the amplitude of a driven cantilever."""
        return taps(self.parameters)

    @property
    def amplitude_lag(self) -> float:
        """Time by which the amplitude follows the distance late [s]; of a tip that taps."""
        return lag(self.parameters)

    @property
    def free_amplitude(self) -> float:
        """Of a tip that taps, off the sample, as it was measured last [V]; 0: it was not."""
        parameters = self.parameters
        return float(parameters.onboard.free_amplitude / parameters.detector.deflection_sensitivity)

    @property
    def touching(self) -> bool:
        """Whether the tip is on the sample; of one that taps, whether its amplitude is nearer to setpoint than free."""
        if not self.taps:
            return self.instrument.in_contact
        return bool(self.instrument.orders.onboard.amplitude < 0.5 * (self.setpoint + self.free_amplitude))

    @property
    def pull_off_distance(self) -> float:
        """Deflection at which the tip comes off a flat sample, as distance [m]; 0: not known."""
        plant = self.parameters.plant
        if self.spring_constant == 0.0 or not hasattr(plant, "contact_units"):
            return 0.0
        # Between 1.5 (JKR) and 2 (DMT) of its unit.
        return float(2.0 * plant.contact_units.force / self.vertical_stiffness)

    def stays_in_contact(self, name: str, lift: float, pressed: float = 0.0) -> str:
        """What is to be said of a lift [m] after which the tip still touches the sample.

        Parameters
        ----------
        name : str
            Of the lift.
        lift : float [m]
        pressed : float [m]
            Deflection from which the lift counts.
        """
        if not (distance := self.pull_off_distance):
            return f"{name} = {lift * 1e9:.3g} nm does not take the tip off the sample: use a larger one"
        distance += pressed
        return (
            f"{name} = {lift * 1e9:.3g} nm is below the pull-off distance of {distance * 1e9:.2g} nm: the tip stays in "
            f"contact. Use at least {max(1.1 * distance, 1.1 * lift) * 1e9:.2g} nm"
        )

    def setting(self, name: str, default: Any = math.nan) -> Any:
        """A setting of the loop, see `Onboard.setting`."""
        return self.loop.setting(self.parameters, name, default)

    def volts(self, force: float) -> float:
        """Deflection under a vertical force [V]; 0 where its spring constant is not known."""
        parameters = self.parameters
        known = self.spring_constant != 0.0
        return float(parameters.plant.deflection_voltage(parameters, force)) if known else 0.0

    @property
    def place(self) -> tuple[float, float]:
        """Where the scanner is asked to be [m]."""
        x, y, _ = self.instrument.orders.asked.position
        return float(x), float(y)

    @property
    def z(self) -> float:
        """As driven, positive towards the sample [m]."""
        channel = next(each for each in self.loop.channels if each.name == Z_CHANNEL)
        return float(self.instrument.orders.onboard[channel.field] * channel.scale(self.parameters))

    @property
    def next_sample(self) -> int:
        """Number of the first sample of the next control tick."""
        return int(self.instrument.ticks * self.samples_per_tick)

    @property
    def offset(self) -> float:
        """Of z from where the loop was opened [m]; 0 while it follows."""
        return float(self.instrument.orders.program.offset)

    @property
    def follows(self) -> bool:
        """Whether z is left to its loop, whose feedback may be held: no verb has opened it, and no withdrawal."""
        return bool(self.instrument.orders.program.mode == FOLLOW)

    @property
    def z_range(self) -> tuple[float, float]:
        """Least and largest z: of the loop, or of the piezo if that is closer [m]."""
        parameters = self.parameters
        most = parameters.piezo.limit * parameters.piezo.sensitivity_z or math.inf
        return max(self.setting("low", -math.inf), -most), min(self.setting("high", math.inf), most)

    @property
    def reach(self) -> tuple[float, float]:
        """Least and largest offset that the range of z allows [m]."""
        origin, (low, high) = self.z - self.offset, self.z_range
        return low - origin, high - origin

    @property
    def most_deflection(self) -> float:
        """Here the deflection saturates [V]; infinite for a detector without a range."""
        return float(getattr(self.parameters.detector, "most_voltage", math.inf))

    def set_loop(self, **changes: Any) -> None:
        """Change settings of the loop, names of ONBOARD_SETTINGS, or calibrations, from the next tick on.

        Raises
        ------
        ParameterError
            If the loop has no such setting, or a value is not allowed.
        """
        parameters, own = self.parameters, self.loop.settings
        places = {name: f"onboard.{place}" for name, place in own.items()}
        places |= {name: f"calibration.{name}" for name in CALIBRATIONS}
        if lacking := [name for name in changes if name not in places]:
            raise ParameterError(
                f"{', '.join(lacking)} cannot be set: the z loop onboard.kind = {parameters.onboard.kind} has no such "
                f"setting; it has {', '.join(own) or 'none'}"
            )
        news = {places[name]: value for name, value in changes.items()}
        self.instrument.set_onboard(changed(parameters, news))

    def samples(self, duration: float, rate: float = math.inf) -> float:
        """How many means at this rate [Hz], or at that of the ADC if it is lower, a duration [s] has."""
        return duration * min(rate, 1.0 / self.sample_period)

    def ticks(self, duration: float) -> int:
        """Control ticks that take this time [s] at least, one or more."""
        return max(1, ticks_of(duration, self.control_period))

    def stay(self, duration: float = 0.0) -> Polynomial:
        """x and y where they are."""
        x, y = self.place
        return Polynomial((x,), (y,), self.ticks(duration) if duration else 0)

    def move(self, x: float, y: float, speed: float) -> Polynomial:
        """On a straight line from rest to rest, `speed` [m/s] at most, and no faster than the scanner can follow."""
        at = self.place
        way = hypot(x - at[0], y - at[1])
        if way == 0.0:
            return self.stay()
        ticks = self.ticks(max(_STEEPEST * way / speed, _SETTLING / self.resonance))
        return self.between(ticks, (at, (0.0, 0.0)), ((x, y), (0.0, 0.0)))

    def between(
        self,
        ticks: int,
        begin: tuple[tuple[float, float], tuple[float, float]],
        end: tuple[tuple[float, float], tuple[float, float]],
    ) -> Polynomial:
        """From place and velocity to place and velocity, without acceleration at both ends."""
        x, y = (
            quintic(ticks, self.control_period, (begin[0][i], begin[1][i], 0.0), (end[0][i], end[1][i], 0.0))
            for i in range(2)
        )
        return Polynomial(x, y, ticks)

    def brake(self) -> Polynomial:
        """From whatever motion to rest."""
        asked = self.instrument.orders.asked
        ticks = self.ticks(_SETTLING / self.resonance)
        curves = []
        for axis in range(2):
            p, v, a = (float(vector[axis]) for vector in (asked.position, asked.velocity, asked.acceleration))
            end = p + 0.5 * v * ticks * self.control_period
            end = min(max(end, -self.travel[axis]), self.travel[axis])
            curves.append(quintic(ticks, self.control_period, (p, v, a), (end, 0.0, 0.0)))
        return Polynomial(curves[0], curves[1], ticks)
