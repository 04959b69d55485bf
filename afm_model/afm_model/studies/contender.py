"""The laws of a comparison, and their conditions: rate, delay, noise, friction, reference, parameters of each law.

A law is a part by its kind, an object that answers measurements, or one that runs elsewhere.
"""

import faulthandler
import importlib
import itertools
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any

from ..core.errors import ParameterError
from ..core.registry import find, names
from ..law import PaperLaw
from ..parameters import ControllerParameters, SimParameters, Value, build, changed
from ..parameters.scenario import Scenario, law_timing

CONDITIONS = ("period", "delay_ticks", "noise", "friction", "reference")
"""What varies besides the law: control period [s], delay, noise, true over nominal friction, reference."""
NOISE: dict[str, float] = {"detector.noise": 1e-3, "detector.position_noise": 5e-11}
"""Noise of level 1: photodetector [V], position sensors [m]; with any noise the ADC has 16 bits."""


_OF_THE_PAPER = "positions and velocities of the scanner, deflection; scanner, cantilever; bounds on friction"
"""Knowledge of the paper's laws."""
_UNDECLARED = "not declared"
PATIENCE = 300.0
"""Wall time without an answer after which an object ends its process [s]."""
_OFTEN = 1.0
"""Shortest interval at which that time starts again [s]: it takes a thread each time."""
_STANDARD_ERROR = 2
Start = Callable[[SimParameters], AbstractContextManager[Any]]
"""Starts a law that runs somewhere else, for one run: given the instrument as all laws are, it gives an object with
`answer(measurement)`; LawError if it does not start or answer. At the exit the law is ended."""


@dataclass(frozen=True)
class Contender:
    """A law that takes part: a part by its kind, an object that answers measurements, or a law that runs elsewhere.

    Parameters
    ----------
    label : str
        As the user has written it, one space between words; also how the row names it.
    kind : str
        Name of the law, or module:NAME.
    values : dict
        Parameters that are not left at their default, by name within `law.`.
    start : callable, optional
        Of a law that runs in a separate process, a node for instance: starts it, see `Start`.
    """

    label: str
    kind: str
    values: dict[str, Value]
    start: Start | None = None

    @property
    def is_part(self) -> bool:
        """Whether it is a part, and not an object or elsewhere."""
        return self.start is None and getattr(load_law(self.kind), "family", None) == "law"

    def begin(self, told: SimParameters) -> AbstractContextManager[Any]:
        """Begin it for one run, if it is no part: made of the instrument with nominal friction and without noise.

        It is given a separate copy: what it changes there changes no run.
        """
        own = told.model_copy(deep=True)
        return self.start(own) if self.start is not None else _watched(load_law(self.kind)(own))

    @property
    def parameters(self) -> dict[str, Value]:
        """Of the controller: the kind of law, and what is given."""
        return {"law.kind": self.kind, **{f"law.{name}": value for name, value in self.values.items()}}

    @property
    def knowledge(self) -> str:
        """What it uses and knows, as the law declares it."""
        if self.start is not None:
            return _UNDECLARED
        law = load_law(self.kind)
        if getattr(law, "parameters", None) is PaperLaw:
            return _OF_THE_PAPER
        # One line, as that of every other law.
        return " ".join(str(getattr(law, "knowledge", "")).split()) or _UNDECLARED


@contextmanager
def _watched(law: Any) -> Iterator[Any]:
    """Watch a law that is an object. If it gives no answer its process ends, and a traceback shows where it was.

    Nothing else stops a loop without end in compiled code. Not where a debugger looks on.
    """
    answer, again = law.answer, -math.inf

    def answer_in_time(measurement: Any) -> Any:
        nonlocal again
        now = time.monotonic()
        if now >= again and sys.gettrace() is None:
            again = now + _OFTEN
            faulthandler.dump_traceback_later(PATIENCE, exit=True, file=_STANDARD_ERROR)
        return answer(measurement)

    with suppress(AttributeError):  # of an object that takes no attributes
        law.answer = answer_in_time
    try:
        yield law
    finally:
        faulthandler.cancel_dump_traceback_later()


def contender(text: str) -> Contender:
    """A law as it is written on a command line: `pid`, `tanh alpha=0.4`, `my_package.my_law:LAW`, `my_law:Law`.

    Raises
    ------
    ParameterError
        If there is no such law, or a parameter of it is not allowed.
    """
    kind, *given = text.split() or [""]
    values: dict[str, Value] = {}
    for each in given:
        name, equals, value = each.partition("=")
        if not equals:
            raise ParameterError(f"law {text}: {each} is not allowed: a parameter is given as name=value")
        values[name] = _value(value)
    made = Contender(" ".join((kind, *given)), kind, values)
    if made.is_part:
        # Each run has its own period, and checks what is allowed there.
        slow = build(SimParameters, {"plant.control_period": 1e-3})
        build(ControllerParameters, law_timing(made.parameters, slow) | made.parameters)
    elif values:
        raise ParameterError(f"law {text}: an object takes no parameters here; set them in its code")
    return made


def contenders(text: str) -> list[Contender]:
    """As `contender`; `pid slowness=0.1,0.15,1` is a law for each combination, of which a comparison keeps the best.

    Raises
    ------
    ParameterError
    """
    kind, *given = text.split() or [""]
    choices = [
        [f"{name}={value}" for value in values.split(",")] for name, _, values in (s.partition("=") for s in given)
    ]
    settings = list(itertools.product(*choices)) if all("=" in each for each in given) else []
    if len(settings) <= 1:
        return [contender(text)]
    made = [contender(" ".join((kind, *setting))) for setting in settings]
    return [replace(each, label=f"{each.label} (tuned: best of {len(made)})") for each in made]


def _value(text: str) -> Value:
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def load_law(kind: str) -> Any:
    """The part, or the class or function that makes the object.

    Raises
    ------
    ParameterError
    """
    module, _, attribute = kind.partition(":")
    if not attribute or kind in names("law"):
        return find("law", kind)
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:
        raise ParameterError(f"law {kind} cannot be loaded: {type(error).__name__}: {error}") from error
    if getattr(found, "family", "law") != "law" or not (hasattr(found, "family") or callable(found)):
        raise ParameterError(
            f"law {kind} is not a law part and not a class: a class is called with the parameters of the "
            f"instrument (SimParameters) and makes an object with answer(measurement)"
        )
    return found


@dataclass(frozen=True)
class Common:
    """What all runs of a comparison have in common."""

    scenario: Scenario
    cycles: float  # length of a run in periods of the reference


def instrument_under(common: Common, conditions: Mapping[str, Any]) -> SimParameters:
    """The instrument under some conditions.

    Raises
    ------
    ParameterError
        If a condition is not allowed.
    """
    shape, _, omega = str(conditions["reference"]).partition(" ")
    try:
        speed = float(omega)
        cycle = 2.0 * math.pi / speed
    except (ValueError, ZeroDivisionError):
        raise ParameterError(
            f"reference {conditions['reference']} is not allowed: it must be a shape and an angular frequency > 0 in "
            f"rad/s, such as sine 50"
        ) from None
    level = float(conditions["noise"])
    news: dict[str, Value] = {
        "plant.control_period": conditions["period"],
        "plant.delay_ticks": conditions["delay_ticks"],
        "contact.tau": common.scenario.sim.contact.tau * conditions["friction"],
        "reference.shape_x": shape,
        "reference.shape_y": shape,
        "reference.omega_x": speed,
        "reference.omega_y": speed,
        "run.duration": common.cycles * cycle,
        "score.start": 0.5 * cycle,
    }
    if level != 0.0:
        news |= {name: level * value for name, value in NOISE.items()} | {"detector.adc_bits": 16}
    return changed(common.scenario.sim, news)


def feedback_of(law: Contender, *, noisy: bool) -> dict[str, Value]:
    """Where there is noise a law that may do without measured rates does, unless it is given `feedback`."""
    may = noisy and "feedback" in find("law", law.kind).parameters.model_fields
    return {"law.feedback": "measured"} if may and "feedback" not in law.values else {}


def law_under(
    common: Common, law: Contender, conditions: Mapping[str, Any], sim: SimParameters
) -> ControllerParameters:
    """A law under some conditions: with period and delay if it has such parameters, without noise and true friction.
    `sim`: the instrument under them.

    Raises
    ------
    ParameterError
        If the law refuses its rate.
    """
    own = law.parameters | feedback_of(law, noisy=float(conditions["noise"]) != 0.0)
    timing = law_timing(own, sim)
    same = common.scenario.controller.law.kind == law.kind
    return changed(common.scenario.controller, timing | own, afresh=() if same else ("law",))
