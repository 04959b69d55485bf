"""Why the microscope cannot do what it is asked for: one sentence that names the value and what is allowed."""

from collections.abc import Iterator

from ..errors import VerbError
from .bench import Bench
from .collect import signals
from .imaging import channel_names
from .jobs import Desk
from .plan import lines
from .verbs import Approach, ForceCurve, MoveTo, Scan, Verb

_ON_THE_SAMPLE = (ForceCurve, Scan)
"""Verbs that need an approached tip."""
_WITH_FEEDBACK = (Scan,)
"""Verbs that need the loop, or that somebody holds z on purpose."""


def objection(verb: Verb, bench: Bench, desk: Desk) -> str:
    """Why `verb` cannot be begun now; empty if it can.

    Parameters
    ----------
    verb : Verb
    bench : Bench
    desk : Desk
        Where the microscope stands.
    """
    return next(_objections(verb, bench, desk), "")


def _objections(verb: Verb, bench: Bench, desk: Desk) -> Iterator[str]:
    name = type(verb).__name__
    if desk.doing:
        yield f"{name} is not allowed while {desk.doing} is being done: wait for its end, or cancel it"
    if isinstance(verb, _ON_THE_SAMPLE) and not desk.approached:
        yield f"{name} is not allowed while the tip is withdrawn: it must be approached first"
    if isinstance(verb, _WITH_FEEDBACK) and desk.feedback == "off":
        yield f"{name} is not allowed with feedback = off: it must be on, hold or external"
    if isinstance(verb, Approach):
        yield from _approach(bench, desk)
    if isinstance(verb, MoveTo):
        yield from _outside(bench, {"x": verb.x, "y": verb.y})
    if isinstance(verb, Scan):
        yield from _scan(verb, bench)
    if isinstance(verb, ForceCurve):
        yield from _curve(verb, bench)


def _approach(bench: Bench, desk: Desk) -> Iterator[str]:
    if desk.approached:
        yield "Approach is not allowed: the tip is on the sample already; withdraw it first"
    if not bench.setpoint > 0.0:
        yield f"Approach is not allowed with a setpoint of {bench.setpoint:g} V: it must be > 0 V"


def _outside(bench: Bench, places: dict[str, float]) -> Iterator[str]:
    for (name, value), most in zip(places.items(), bench.travel, strict=True):
        if abs(value) > most:
            yield f"{name} = {value:g} m is outside the travel of the scanner: it must be within +-{most:g} m"


def _scan(verb: Scan, bench: Bench) -> Iterator[str]:
    names = channel_names(verb.channels)
    if not names:
        yield "channels is empty: it must name one at least, such as height"
    try:
        signals(bench.instrument, names)
    except KeyError as error:
        missing, known = error.args
        yield (
            f"channels = {verb.channels} is not allowed: there is no {', '.join(missing)}; there are {', '.join(known)}"
        )
    try:
        plan = lines(verb, bench)
    except VerbError as error:
        yield str(error)
        return
    for axis, most in enumerate(bench.travel):
        farthest = max((corner[axis] for corner in plan.corners), key=abs)
        if abs(farthest) > most:
            yield (
                f"the frame of size_x = {verb.size_x:g} m, height {verb.height:g} m at centre_x = {verb.centre_x:g} m, "
                f"centre_y = {verb.centre_y:g} m is outside the travel of the scanner: with its turns it reaches to "
                f"{'xy'[axis]} = {farthest:.4g} m and must stay within +-{most:g} m"
            )


def _curve(verb: ForceCurve, bench: Bench) -> Iterator[str]:
    if verb.trigger_force > 0.0 and bench.spring_constant == 0.0:
        yield (
            f"trigger_force = {verb.trigger_force:g} N is not allowed with plant.kind = "
            f"{bench.parameters.plant.kind}, which tells no spring constant: give trigger_voltage"
        )
    low, high = bench.reach
    if bench.offset - verb.lift < low:
        yield (f"lift = {verb.lift:g} m is not allowed here: z has {bench.offset - low:.4g} m left to go away")
    if bench.offset - verb.lift + verb.ramp > high:
        yield (
            f"ramp = {verb.ramp:g} m is not allowed here: with lift = {verb.lift:g} m z has "
            f"{high - bench.offset + verb.lift:.4g} m to go towards the sample"
        )
