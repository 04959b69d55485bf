"""What a verb is: something that a microscope can be asked to do, which takes time and can be cancelled.

A verb is one class: its fields (with units, bounds and description), what is refused and why, the orders that it comes
to, and what it brings back. Ours are in `afm_model.microscope.verbs`; one of your own is chosen as `module:NAME` or by
an entry point of the group `afm_model.verb`. docs/extending.md.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self

from ..core import registry
from ..core.errors import VerbError
from ..core.schema import Group, build, flatten, out_of_range, python_value
from .results import MicroscopeState, Standing

if TYPE_CHECKING:
    from .execution import Execution, Task
    from .view import InstrumentView

MOST_NUMBERS = 2**25
"""That a verb may bring back: 268 MB, a scan of 4096 x 4096 pixels of one channel, trace and retrace."""
MOST_PLACES = 10_000
"""Of a path."""


class Verb(Group):
    """Something that the microscope does. Fields are numbers, words or tuples of numbers, in SI units."""

    family: ClassVar[str] = "verb"
    name: ClassVar[str] = ""
    """By which it is asked for, `move_to` of the class MoveTo: a word of `Microscope`, the name of an action."""
    returns: ClassVar[Any] = Standing
    """Type of its result: a dataclass, a list of one, or `Arrays`."""
    on_sample: ClassVar[bool] = False
    """Whether it needs an approached tip."""
    slides: ClassVar[bool] = False
    """Whether it needs a z loop that is not switched off."""
    presses: ClassVar[bool] = False
    """Whether it needs a tip that is pressed on the sample, or would be: not one that taps."""

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        cls.name = re.sub("(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Self:
        """The verb with these fields, the others as they are by default.

        Raises
        ------
        ParameterError
            If there is no such field, or a value is not allowed: one sentence.
        """
        given: dict[str, Any] = {}
        for name, value in fields.items():
            if isinstance(value, str) or not hasattr(value, "__len__"):
                given[name] = python_value(value)
            elif len(value) > 0 and all(isinstance(each, str) for each in value):
                # Several words of one field, as its text has them.
                given[name] = ", ".join(value)
            else:
                given[name] = tuple(python_value(each) for each in value)
        return build(cls, given)

    def refusals(self, view: "InstrumentView", state: MicroscopeState) -> Iterator[str]:
        """Why it cannot be begun now, a sentence each that names the value and what is allowed."""
        yield from ()

    def tasks(self, run: "Execution") -> Iterator["Task"]:
        """What is to be done, in order; the next is asked for between two ticks, when the order before is done.

        It gives `run` what results (`run.result`) and how long it takes at most (`run.total`). VerbError: it cannot
        be brought to its end, and the tip is withdrawn.
        """
        raise NotImplementedError


def all_verbs() -> dict[str, type[Verb]]:
    """Verbs by name: those of this package and those that installed packages offer."""
    return {name: find(name) for name in registry.names("verb")}


def find(name: str) -> type[Verb]:
    """The verb called `name`, or `module:NAME`.

    Raises
    ------
    ParameterError
        If no verb has this name.
    """
    verb: type[Verb] = registry.find("verb", name)
    return verb


def objection(verb: Verb, view: "InstrumentView", state: MicroscopeState) -> str:
    """Why `verb` cannot be begun now, one sentence; empty if it can."""

    def every() -> Iterator[str]:
        title = type(verb).__name__
        yield out_of_range(type(verb), flatten(verb))
        if state.doing:
            yield f"{title} is not allowed while {state.doing} is being done: wait for its end, or cancel it"
        if verb.on_sample and not state.approached:
            yield f"{title} is not allowed while the tip is withdrawn: it must be approached first"
        if verb.slides and state.feedback == "off":
            yield f"{title} is not allowed with feedback = off: it must be on, hold or external"
        if verb.presses and view.taps:
            yield (
                f"{title} is not allowed with onboard.regulate = amplitude: it needs a tip that is pressed on the "
                f"sample, not one that taps; take deflection"
            )
        yield from verb.refusals(view, state)

    try:
        return next(filter(None, every()), "")
    except VerbError as error:
        return str(error)


# Refusals that several verbs have.


def outside(view: "InstrumentView", what: str, places: Iterable[tuple[float, float]]) -> Iterator[str]:
    """What is beyond the travel of the scanner; `what` begins the sentence."""
    for place in places:
        for axis, value, most in zip("xy", place, view.travel, strict=True):
            if abs(value) > most:
                yield (
                    f"{what}{axis} = {value:.4g} m is outside the travel of the scanner: it must be within +-{most:g} m"
                )


def on_the_sample(verb: Verb, state: MicroscopeState) -> Iterator[str]:
    """What is to be said of a verb that needs a free cantilever, while the tip is on the sample."""
    if state.near:
        yield f"{type(verb).__name__} is not allowed while the tip is on the sample: withdraw it first"


def saturating(what: str, volts: float, view: "InstrumentView") -> Iterator[str]:
    """A deflection that the detector never shows: z would go on into the sample."""
    if abs(volts) >= view.most_deflection:
        yield (
            f"{what} of {volts:.4g} V is not allowed: the detector saturates at {view.most_deflection:.4g} V, and z "
            f"would go on into the sample"
        )


def too_much(count: float, what: str) -> Iterator[str]:
    """More numbers than a verb may bring back."""
    if count > MOST_NUMBERS:
        yield f"{what} is not allowed: it would bring back {count:.3g} numbers, and {MOST_NUMBERS} are the most"


def too_fast(name: str, rate: float, trigger: float, way: float, view: "InstrumentView") -> Iterator[str]:
    """A rate at which z goes further within a sample than the deflection [V] that it is to stop at, or all its way."""
    most = min(trigger * view.deflection_sensitivity or way, way) / view.sample_period
    if rate > most:
        yield (
            f"{name} = {rate:g} m/s is not allowed: within a sample of {view.sample_period:g} s z would go further "
            f"than it may; it must be <= {most:.4g} m/s"
        )
