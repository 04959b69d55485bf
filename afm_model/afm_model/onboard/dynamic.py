"""Dynamic modes: an excited cantilever, a lock-in amplifier, and a z loop; docs/dynamic.md.

It is excited by drive_amplitude cos(theta + drive_phase), theta' = 2 pi drive_frequency, without a jump of theta where
the frequency changes. The signal, sampled by the ADC, is multiplied with cosine and sine of harmonic n of the same
theta and low-passed: a signal A cos(n theta - phi) gives the amplitude A and the phase phi, by which it is late, less
phase_offset.

The z loop is that of contact mode (pi.py). Its error [V] is setpoint less deflection, or amplitude less setpoint: the
sample comes nearer as long as the amplitude is above it.
"""

import math
from typing import Annotated, Literal, get_args

from annotated_types import Ge, Le, Lt
from pydantic import Field, model_validator

from ..compiled.jit import kernel
from ..compiled.records import Array
from ..core import registry
from ..core.elementary import expm1, sincos, square
from ..core.schema import NonNegative, Positive, Unit
from ..parts.onboard import ONBOARD_SETTINGS, TAPPING_SETTINGS, Onboard
from ..parts.part import Channel, Numbers, Tree
from ..parts.signals import Actuation, Detection, Setpoint
from . import by_amplitude
from .by_amplitude import setpoint, taps
from .pi import PI, PiParameters, move_z, regulate
from .pi import Constants as PiConstants
from .pi import State as PiState

RESOLVED = 0.075
"""Angle [rad] by which the drive may turn in an integration step: resonances are narrower by its square over six."""
FEWEST = 4
"""Samples of the ADC in a period of the harmonic that is measured."""
FEWEST_OF_ONE = 2.5
"""The same of a signal without other harmonics, that of a plant that averages over the cycle."""
_Drive = Literal["base", "tip", "lateral", "torsion"]
DRIVES = get_args(_Drive)
"""Names of BASE, TIP, LATERAL and TORSION in afm_model.parts.signals."""
STAGES = 8
_TURN = 2.0 * math.pi
Phase = Annotated[float, Ge(-_TURN), Le(_TURN), Unit("rad")]


class DynamicParameters(PiParameters):
    """A z loop of deflection or amplitude, a drive of the cantilever, and a lock-in amplifier."""

    kind: str = Field("dynamic", description="loop inside the instrument")
    drive: _Drive = Field(
        "base",
        description="what is driven: the base across the cantilever; the tip, by a force across it; the base sideways; "
        "the base, rocking about the cantilever's axis",
    )
    drive_frequency: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="0: first resonance of the cantilever, with torsion that of torsion, as plant.* gives it"
    )
    drive_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="way of the base; tip: force over plant.k; torsion: way of the tip with the base; 0: no drive"
    )
    drive_phase: Phase = Field(0.0, description="by which the drive is ahead of the reference of the lock-in")
    phase_offset: Phase = Field(
        0.0, description="that the lock-in takes from the lag it measures; tune sets it: a free cantilever shows pi/2"
    )
    lock_in: Literal["deflection", "lateral"] = Field(
        "deflection", description="signal that the lock-in measures; lateral: as way of the tip by twist"
    )
    harmonic: Annotated[int, Ge(1), Le(20)] = Field(1, description="of the drive, that the lock-in measures")
    time_constant: Annotated[Positive, Unit("s")] = Field(
        100e-6, description="of each of the first-order low-passes of the lock-in"
    )
    filter_order: Annotated[int, Ge(1), Le(STAGES)] = Field(4, description="how many low-passes there are, in a row")
    regulate: Literal["deflection", "amplitude"] = Field(
        "deflection", description="what the z loop keeps at its setpoint: contact mode, or tapping"
    )
    setpoint_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="setpoint of the amplitude (regulate: amplitude); 0: by setpoint_share"
    )
    setpoint_share: Annotated[float, Ge(0), Lt(1)] = Field(
        0.0, description="the same over free_amplitude; 0: by setpoint_amplitude, or 0.8 of it"
    )
    free_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0,
        description="amplitude off the sample, that setpoint_share is of; approach and tune write it. 0: not known, z "
        "rests without a setpoint_amplitude",
    )

    @model_validator(mode="after")
    def _setpoint_is_of_what_is_regulated(self) -> "DynamicParameters":
        kinds = {"deflection": ("setpoint_voltage", "setpoint_force"), "amplitude": TAPPING_SETTINGS}
        own = " or ".join(f"onboard.{name}" for name in kinds[self.regulate])
        for kind, names in kinds.items():
            given = [f"onboard.{name} = {getattr(self, name):g}" for name in names if getattr(self, name)]
            if given and kind != self.regulate:
                raise ValueError(f"{given[0]} is not allowed with onboard.regulate = {self.regulate}: give {own}")
            if len(given) > 1:
                raise ValueError(f"{' and '.join(given)} are not allowed together: give one")
        return self


class Constants(PiConstants):
    angular_frequency: float
    drive: float
    lateral: float
    drive_amplitude: float
    drive_phase: float
    harmonic: float
    share: float
    filter_order: float
    by_amplitude: float
    offset_cos: float
    offset_sin: float


class State(PiState):
    angular_frequency: Annotated[float, "rad/s"]
    turned: Annotated[float, "rad"]  # theta when it became this
    since: Annotated[float, "s"]
    in_phase: Annotated[Array, (STAGES,), "V"]  # behind each low-pass: A cos phi
    quadrature: Annotated[Array, (STAGES,), "V"]  # A sin phi
    x: Annotated[float, "V"]  # behind the last one, turned by phase_offset
    y: Annotated[float, "V"]
    amplitude: Annotated[float, "V"]
    phase: Annotated[float, "rad"]  # from -pi/2 to 3 pi/2, so that 0 to pi has no jump


def frequency(parameters: Tree) -> float:
    """Return the frequency of the drive [Hz]; 0 if it is not given and the plant has no cantilever."""
    part, cantilever = parameters.onboard, parameters.plant.cantilever_numbers
    name = "f_torsion" if part.drive == "torsion" else "f0"
    return float(part.drive_frequency or (0.0 if cantilever is None else getattr(cantilever, name)))


def _values(parameters: Tree) -> Numbers:
    part, T = parameters.onboard, parameters.detector.sample_period
    sin, cos = sincos(part.phase_offset)
    return {
        **PI.values(parameters),
        "setpoint": setpoint(parameters),
        "by_amplitude": float(taps(parameters)),
        "angular_frequency": _TURN * frequency(parameters),
        "share": -expm1(-T / part.time_constant),
        "harmonic": float(part.harmonic),
        "filter_order": float(part.filter_order),
        "drive": float(DRIVES.index(part.drive)),
        "lateral": float(part.lock_in == "lateral"),
        "drive_amplitude": part.drive_amplitude,
        "drive_phase": part.drive_phase,
        "offset_cos": cos,
        "offset_sin": sin,
    }


def check_tone(parameters: Tree, f: float, n: int) -> None:
    """Raise ValueError unless plant and ADC resolve a drive of the frequency f [Hz] and its harmonic n."""
    T, averages = parameters.detector.sample_period, registry.find("plant", parameters.plant.kind).averages
    most = RESOLVED / (_TURN * f) if f > 0.0 and not averages else math.inf
    if parameters.plant.dt > most:
        raise ValueError(
            f"plant.dt = {parameters.plant.dt:g} s is not allowed with a drive of {f:.6g} Hz, which it does not "
            f"resolve: take plant.dt <= {most:.3g} s"
        )
    fewest = FEWEST_OF_ONE if averages else FEWEST
    if fewest * n * f * T > 1.0 + 1e-9:
        raise ValueError(
            f"detector.sample_period = {T:g} s is not allowed with onboard.harmonic = {n} of a drive of {f:.6g} Hz: "
            f"the lock-in needs {fewest:g} samples a period; take <= {1.0 / (fewest * n * f):.3g} s"
        )


def _check(parameters: Tree) -> None:
    PI.check(parameters)
    part = parameters.onboard
    if part.drive_amplitude > 0.0:
        check_tone(parameters, frequency(parameters), part.harmonic)
    if part.drive == "torsion" and getattr(parameters.plant, "torsion", "moving") != "moving":
        raise ValueError(
            f"onboard.drive = torsion is not allowed with plant.torsion = {parameters.plant.torsion}, which has no "
            f"resonance: take plant.torsion = moving"
        )
    if taps(parameters):
        by_amplitude.check(parameters)


def _warnings(parameters: Tree) -> list[str]:
    part = parameters.onboard
    found = by_amplitude.warnings(parameters) if taps(parameters) else list(PI.warnings(parameters))
    turn = _TURN * part.harmonic * frequency(parameters) * part.time_constant
    if part.drive_amplitude > 0.0 and turn < 3.0:
        found.append(
            f"onboard.time_constant = {part.time_constant:g} s is shorter than half of a period of what the lock-in "
            f"measures: amplitude and phase swing at twice its frequency"
        )
    return found


@kernel
def late(x: float, y: float) -> float:
    """Angle of (x, y) from -pi/2 to 3 pi/2: a rough one, and twice the sine of what is missing."""
    r = math.sqrt(x * x + y * y)
    if r == 0.0:
        return 0.0
    least, most = min(abs(x), abs(y)) / r, max(abs(x), abs(y)) / r
    t = least / most
    angle = t * (0.25 * math.pi + 0.273 * (1.0 - t))
    if abs(y) > abs(x):
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    if y < 0.0:
        angle = -angle
    for _ in range(2):
        sin, cos = sincos(angle)
        angle += (y * cos - x * sin) / r
    return angle + _TURN if angle < -0.5 * math.pi else angle


@kernel
def mixed(d: Detection, angle: float, in_phase: Array, quadrature: Array, p: Constants) -> tuple[float, float]:
    """Return the signal times cosine and sine of an angle [rad], after the last of the low-passes [V]."""
    sin, cos = sincos(angle % _TURN)
    signal = d.lateral_voltage if p.lateral != 0.0 else d.deflection_voltage
    x, y = 2.0 * signal * cos, 2.0 * signal * sin
    for i in range(int(p.filter_order)):
        in_phase[i] += p.share * (x - in_phase[i])
        quadrature[i] += p.share * (y - quadrature[i])
        x, y = in_phase[i], quadrature[i]
    return x, y


@kernel
def drive_at(
    t: float, d: Detection, r: Setpoint, u: Actuation, omega: float, amplitude: float, p: Constants, s: State
) -> None:
    """Drive the cantilever at omega [rad/s] and amplitude [m], measure, and let the z loop act."""
    if s.angular_frequency != omega:
        s.turned = (s.turned + s.angular_frequency * (t - s.since)) % _TURN
        s.since, s.angular_frequency = t, omega
    u.amplitude, u.angular_frequency = amplitude, s.angular_frequency
    u.phase, u.since, u.excited = s.turned + p.drive_phase, s.since, p.drive
    angle = p.harmonic * (s.turned + s.angular_frequency * (t - s.since))
    x, y = mixed(d, angle, s.in_phase, s.quadrature, p)
    # Of what was measured: whatever the offset is, the z loop does the same.
    s.amplitude = math.sqrt(x * x + y * y)
    s.x, s.y = p.offset_cos * x + p.offset_sin * y, p.offset_cos * y - p.offset_sin * x
    s.phase = late(s.x, s.y)
    d.amplitude_voltage = s.amplitude
    if p.by_amplitude != 0.0:
        s.error = s.amplitude - p.setpoint if p.setpoint > 0.0 else 0.0
        move_z(r, u, p, s)
    else:
        regulate(t, d, r, u, p, s)


@kernel
def drive_and_measure(t: float, d: Detection, r: Setpoint, u: Actuation, p: Constants, s: State) -> None:
    """See `afm_model.parts.Onboard`."""
    drive_at(t, d, r, u, p.angular_frequency, p.drive_amplitude, p, s)


def sensitivity(parameters: Tree) -> float:
    """Of the signal that the lock-in measures [m/V]."""
    detector, c = parameters.detector, parameters.plant.cantilever_numbers
    if parameters.onboard.lock_in == "deflection":
        return float(detector.deflection_sensitivity)
    return float(detector.lateral_sensitivity * square(c.tip_height + 0.5 * c.thickness) / c.k_torsion)


DYNAMIC = Onboard(
    name="dynamic",
    parameters=DynamicParameters,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    moves_z=True,
    excites=True,
    regulate=drive_and_measure,
    begin=PI.begin,
    warnings=_warnings,
    setpoint=setpoint,
    settings={name: name for name in (*ONBOARD_SETTINGS, *TAPPING_SETTINGS)},
    channels=(
        *PI.channels,
        Channel("amplitude", "m", "amplitude", sensitivity),
        Channel("phase", "rad", "phase"),
        Channel("in_phase", "m", "x", sensitivity),
        Channel("quadrature", "m", "y", sensitivity),
    ),
)
