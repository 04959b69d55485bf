"""What a part is, and what each family of parts has to offer.

A part is one file: parameters, constants made from them once, a state, and kernels with the signature of its family.
docs/extending.md shows one of each.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.calls import INTEGER, NUMBER, POINTER, Argument
from ..compiled.records import Record
from ..core.errors import PartError
from ..core.random_numbers import RandomStream
from ..core.schema import Group
from .signals import (
    Actuation,
    Delivery,
    Detection,
    Displacement,
    Drive,
    Measurement,
    PiezoDrive,
    Setpoint,
    Surface,
    Truth,
)

Numbers = Mapping[str, Any]
"""Values of a record by the names of its fields."""
Tree = Any
"""All parameters of the instrument, or for a law those of the controller. Their types are made of the groups of the
parts, so that a part cannot name them.
"""
Kernel = Callable[..., None]
CONSTANTS, STATE, MAP, WHOLE = "constants", "state", "map", "whole"
"""In the signature of a family what is the part's own: its records, its map; the whole block, to ask other parts."""


def _one(parameters: Tree) -> float:
    return 1.0


def _none(parameters: Tree) -> Numbers:
    return {}


def _anything(parameters: Tree) -> None:
    """Allowed as it is."""


@dataclass(frozen=True)
class Channel:
    """A number of a part's state that can be sampled at the rate of the virtual ADC.

    Parameters
    ----------
    name : str
        Of the topic; what no sensor sees begins with `truth/`.
    unit : str
        SI unit of number times scale.
    field : str
        Of the part's state; of a vector as `name.x`.
    scale : callable
        Parameters of the instrument -> SI units per unit of the number.
    """

    name: str
    unit: str
    field: str
    scale: Callable[[Tree], float] = _one


class LawEstimate(NamedTuple):
    """What a law believes of the microscope."""

    name: str  # of the topic, below law/
    unit: str  # SI
    value: float


class Corrugation(NamedTuple):
    """Sizes of the potential of a sample of atoms, SI units; of its height the same per load."""

    period: float  # distance of neighbouring minima [m]
    force: float  # largest slope along a row of minima [N]
    stiffness: float  # largest second derivative [N/m]
    slope: float  # of the height [1]
    bend: float  # [1/m]


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the instrument, or a law.

    Parameters
    ----------
    name : str
        By which a scenario chooses it; a part that is chosen as `module:NAME` needs none.
    parameters : type[Group]
        Its parameters; the family's own ones must be among them.
    constants, state : type[Record]
    values : callable
        Parameters (the whole tree of the instrument, or of the controller) -> values of `constants`, without those that
        are a parameter of the part, or of `scales`, of the same name and unit. Raises ValueError if the part cannot be
        made of them.
    start : callable
        The same -> values of `state` at the start of a run; zeros if not given.
    check : callable
        Raises ValueError for parameters that are not allowed together; called whenever parameters are read.
    warnings : callable
        Parameters -> what is implausible, a sentence each.
    recorded : bool
        False: the state is not one of the instrument but of what it reports; not recorded and not in the hash.
    channels : tuple of Channel
    draws : int
        Random numbers that it uses in each control tick, by a separate seed.
    draw : callable
        (parameters, generator, ticks) -> (ticks, draws) of them, standard normal if not given; None: they are all zero.
    lanes : bool
        Of plants and samples: the kernels are arithmetic on records alone, without maps, and many instruments can be
        computed at once (lanes/loop.py).
    """

    family: ClassVar[str]
    functions: ClassVar[dict[str, tuple[Argument, ...]]]
    """Kernels of the family and what each is called with, CONSTANTS and STATE standing for the part's records."""

    parameters: type[Group]
    name: str = ""
    constants: type[Record] = Record
    state: type[Record] = Record
    values: Callable[[Tree], Numbers] = _none
    start: Callable[[Tree], Numbers] | None = None
    check: Callable[[Tree], None] = _anything
    warnings: Callable[..., list[str]] = lambda *_: []
    recorded: bool = True
    channels: tuple[Channel, ...] = ()
    draws: int = 0
    draw: Callable[[Any, RandomStream, int], NDArray[np.float64] | None] | None = None
    lanes: bool = False

    def __post_init__(self) -> None:
        for field, base in (("parameters", Group), ("constants", Record), ("state", Record)):
            given = getattr(self, field)
            if not (isinstance(given, type) and issubclass(given, base)):
                shown = given.__qualname__ if isinstance(given, type) else repr(given)
                raise PartError(
                    f"{f'{self.family} {self.name}'.strip()}: {field} = {shown} is not allowed: it must be a class "
                    f"with the base {base.__name__}"
                )

    def arguments(self, function: str) -> tuple[Argument, ...]:
        """What a kernel of this part is called with."""
        own: dict[Argument, Argument] = {CONSTANTS: self.constants, STATE: self.state, MAP: POINTER, WHOLE: POINTER}
        return tuple(own.get(kind, kind) for kind in self.functions[function])


@dataclass(frozen=True, kw_only=True)
class Program(Part):
    """Reference and setpoint over time: `reference(t, r, p)` writes the record r of Setpoint at time t [s].

    It is a function of time alone, so that it can be asked for any time.

    Parameters
    ----------
    watch : callable, optional
        For a program that depends on what is measured. `watch(t, d, r, p, s)` is called at every sample of the virtual
        ADC, before the onboard part, with the photodetector's last sample d; it may change `z_mode` and `z_offset` of
        the reference r for this sample.
    """

    family = "program"
    functions: ClassVar = {
        "reference": (NUMBER, Setpoint, CONSTANTS),
        "watch": (NUMBER, Detection, Setpoint, CONSTANTS, STATE),
    }

    reference: Kernel
    watch: Kernel | None = None
    order: Callable[[Any, int, Tree, Any, Any], Any] | None = None
    """(order, tick, parameters, p, s) -> kept: for a program with orders during the run, between two control
    ticks. It is in force from this tick on; the reference of this tick is that of before. The program sets `done` of
    its state to 1.0 at the samples of the control tick with which the order ends. What it returns is kept as long as
    the order is in force, such as an array that p points to.
    """
    first: Callable[[Tree], Any] | None = None
    """Parameters -> the only order of a program, given at the start."""


@dataclass(frozen=True, kw_only=True)
class Law(Part):
    """A control law: `control(t, y, u, p, s)` writes into u, a PiezoDrive, what answers measurement y of time t [s].

    That is `u.voltage`, and for a law that looks ahead the horizon: further drives with their times. `warnings` is also
    given the control period [s], and says why the loop cannot work at this rate.

    `values`, `start` and `check` are given the parameters of the controller. When a parameter changes while the law
    runs its constants are made again and its state goes on.
    """

    family = "law"
    functions: ClassVar = {"control": (NUMBER, Measurement, PiezoDrive, CONSTANTS, STATE)}

    control: Kernel
    memory: tuple[str, Callable[[Tree], int]] | None = None
    """Numbers that it keeps outside its state, zeros at the start: the field of the state in which their address
    stands, to be read by `numbers_at`, and parameters -> how many. If that number changes the law begins again.
    """
    change: Callable[[Any, Any, Any], None] = lambda before, now, state: None
    """Constants before and after a change of parameters while the law runs, and its state, which it may write: so that
    the drive does not jump.
    """
    remark: Callable[[Any], str] = lambda state: ""
    """Record of its state -> what it has to say of itself, a sentence, such as that it distrusts its model."""
    estimates: Callable[[Any, Any], Iterable[LawEstimate]] = lambda p, s: ()
    """Records of its constants and of its state -> what it believes now: each time the same names and units."""
    knowledge: str = ""
    """Measurements and parameters of the microscope that it uses, in words, for comparisons."""
    models_contact: bool = False
    """Whether it has a model of friction, from the parameters `contact`: on a plant of one's own with another contact,
    or one that declares none, it warns, see `Plant`; on one of this package it is refused.
    """


@dataclass(frozen=True, kw_only=True)
class Fault(Part):
    """What goes wrong in control tick k. Each function may be left out.

    Parameters
    ----------
    on_sample : callable
        `on_sample(k, d, p, s)`, at the begin of the tick: write what is wrong with the sample into d of Displacement.
    on_command : callable
        `on_command(k, u, v, p, s)`, then: u is what the controller has commanded, v what has arrived, both of
        PiezoDrive; v stays from tick to tick.
    on_drive : callable
        `on_drive(k, t, u, p, s, r)`, when a drive is put in force, at each update of the DAC, at time t [s].
    on_measurement : callable
        `on_measurement(k, t, y, e, p, s, r)`, with the measurement of tick k. With e.lost = 1 it is not sent.

    r holds the part's `draws` random numbers of one tick, the same for its drives and for the measurement at its end;
    at the start they are zero.
    """

    family = "fault"
    functions: ClassVar = {
        "on_sample": (INTEGER, Displacement, CONSTANTS, STATE),
        "on_command": (INTEGER, PiezoDrive, PiezoDrive, CONSTANTS, STATE),
        "on_drive": (INTEGER, NUMBER, Drive, CONSTANTS, STATE, POINTER),
        "on_measurement": (INTEGER, NUMBER, Measurement, Delivery, CONSTANTS, STATE, POINTER),
    }

    on_sample: Kernel | None = None
    on_command: Kernel | None = None
    on_drive: Kernel | None = None
    on_measurement: Kernel | None = None


@dataclass(frozen=True, kw_only=True)
class Piezo(Part):
    """The piezo ceramic: `actuate(t, u, v, p, s)` writes into v what drive u comes to, in volts of an ideal piezo.

    Called at every sample of the virtual ADC, after range, resolution and delay of the drive.

    Parameters
    ----------
    begin : callable
        (parameters, s, drive [V]) -> None: given the drive (x, y, z) that holds the plant at the start, may write s;
        called if the part has a state. What it comes to must be that drive itself.
    """

    family = "piezo"
    functions: ClassVar = {"actuate": (NUMBER, Drive, Drive, CONSTANTS, STATE)}

    actuate: Kernel
    begin: Callable[[Any, Any, tuple[float, float, float]], None] = lambda parameters, s, drive: None


SPRING, RIGID, OTHER = "spring", "rigid", "other"
"""Contacts of plants: a spring that plant.dt must resolve; tip and sample as one mass; one of the plant's own."""


@dataclass(frozen=True, kw_only=True)
class Plant(Part):
    """Equations of motion: `step(t, v, r, p, s, m)` advances s by one integration step that begins at time t [s],
    under v of Actuation: the drive [V], and for a plant that takes it the excitation; r holds the part's random
    numbers. `observe(p, s, o)` writes the state into a record o of Truth.

    The sample is asked through m: `afm_model.parts.surface(x, y, m)` with x, y in x0.

    Parameters
    ----------
    rest : callable
        (parameters, p, s, m) -> drive (x, y, z) [V] that holds the start; writes the state at the start into s. If
        not given, the plant is at rest without a drive.
    map : callable, optional
        Parameters -> array of float64, read-only for the kernel, at m[plant_map of BlockHeader]: a table, say.
    contact : str
        How tip and sample touch: SPRING or RIGID with force and friction of the parameters `contact` (docs/theory.md),
        OTHER with those of the plant itself. If it is not declared, what needs to know warns and takes the tip to be
        held on the sample.
    sample_in_si : bool
        The plant takes slopes and curvatures of the sample in SI, not in scaled coordinates, and checks by itself
        whether its tip touches the sample in one point.
    takes_lattice : bool
        Its friction can be the potential that a sample with `lattice` writes.
    takes_excitation : bool
        It moves the base of its cantilever as v says.
    averages : bool
        Of an excited cantilever it has amplitude and phase as its state, and shows no higher harmonics: plant.dt need
        not resolve the excitation.
    common : callable
        Record of the constants -> those by which `step` chooses between ways of computing, the same in all `lanes`;
        None: this one does not run in lanes.
    marks : bool
        Of one with `lanes`: what is seldom it leaves to the routine of an instrument alone (compiled/ways.py).
    ledger : type[Record]
        What it keeps outside its state, at m[plant_ledger of BlockHeader], such as energies: zeros at the start, not
        recorded and not in the hash. A channel may name a field of it as one of the state.
    time_outside : str
        Field of the ledger: time since the start in which the state was outside of what this plant holds for [s].
    """

    family = "plant"
    functions: ClassVar = {
        "step": (NUMBER, Actuation, POINTER, CONSTANTS, STATE, WHOLE),
        "observe": (CONSTANTS, STATE, Truth),
    }

    step: Kernel
    observe: Kernel
    rest: Callable[[Any, Any, Any, Any], tuple[float, float, float]] = lambda parameters, p, s, m: (0.0, 0.0, 0.0)
    map: Callable[[Any], NDArray[np.float64]] | None = None
    contact: str = ""
    sample_in_si: bool = False
    takes_lattice: bool = False
    takes_excitation: bool = False
    averages: bool = False
    common: Callable[[Any], Numbers | None] = _none
    marks: bool = False
    ledger: type[Record] = Record
    time_outside: str = ""


@dataclass(frozen=True, kw_only=True)
class Sample(Part):
    """The sample: `surface(x, y, h, p, map)` writes the record h of Surface at (x, y), in units of x0 and z0.

    Parameters
    ----------
    map : callable, optional
        Parameters -> array of float64, read-only for the kernel: heights of a map, say.
    height : callable
        Parameters -> height amplitude [m], by which the error along z is judged; 0 for a flat sample.
    curvature : callable
        Parameters -> largest |mean curvature| [z0/x0^2], for the longest step and the contact.
    contrast : callable, optional
        Parameters -> least and largest (w/w_0)^2 R_e/R (K_0/K)^2, work of adhesion, effective radius and modulus over
        those of the plant, for the plant `lever`; by default what the curvature makes of it.
    materials : callable, optional
        Parameters -> (work of adhesion, modulus) of each of its materials over those of the plant, for the plant
        `averaged`; empty if they are many. By default one, unless the sample has a `contrast`.
    lattice : callable, optional
        Parameters -> Corrugation, for a sample whose `surface` also writes the derivatives of a potential for the
        place of the tip; that takes the place of friction.
    """

    family = "sample"
    functions: ClassVar = {"surface": (NUMBER, NUMBER, Surface, CONSTANTS, MAP)}

    surface: Kernel
    map: Callable[[Any], NDArray[np.float64]] | None = None
    height: Callable[[Any], float] = lambda parameters: 0.0
    curvature: Callable[[Any], float] = lambda parameters: 0.0
    contrast: Callable[[Any], tuple[float, float]] | None = None
    materials: Callable[[Any], tuple[tuple[float, float], ...]] | None = None
    lattice: Callable[[Any], Corrugation] | None = None


@dataclass(frozen=True, kw_only=True)
class Detector(Part):
    """The photodetector: `detect(o, d, p, s, r)` writes a sample d of Detection from the truth o.

    r holds two standard normal numbers for this sample.

    Parameters
    ----------
    noisy : callable
        Parameters -> whether it uses them; they are zero if not.
    ideal : callable
        Parameters -> whether its deflection is exact. If not, the measured rate of the deflection is the difference of
        what it has read, and not the true one.
    """

    family = "detector"
    functions: ClassVar = {"detect": (Truth, Detection, CONSTANTS, STATE, POINTER)}

    detect: Kernel
    noisy: Callable[[Tree], bool] = lambda parameters: True
    ideal: Callable[[Tree], bool] = lambda parameters: False
