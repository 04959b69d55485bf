"""The rules of the drive contract. Needs no ROS."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from afm_model import SimParameters
from afm_model.core import registry
from afm_node_common import topics

from .log import IN_LOCKSTEP, Answer, Log, Phase
from .response import Response, responses


@dataclass(frozen=True)
class Terms:
    """The conditions of a test."""

    sim: SimParameters
    deadline: float  # time in which an answer must be there [s]
    feedback: bool = True  # whether the controller follows the reference
    repeats: bool = True  # whether it begins again with a reset


_STRONGEST = 1e6
"""No drive is stronger, where there is no limit [V]."""
_ONE_BY_ONE = (Phase.LOCKSTEP, Phase.LONG, Phase.STEPS, Phase.REPEAT)
_UPWARDS = 0.5
"""A drive may rise with the measured position by so much of what it rises with the reference: a law that predicts may
have it so (predictive in packets .2).
"""
_ACROSS = 0.2
"""A drive of x or y may answer the reference of the other one by so much of what each answers its own: a sensor that is
turned by 10 degrees makes .18, the laws of the package .004.
"""
_FOLLOWS = 0.8
"""Largest error, rms over that of a scanner that does not move: gains a thousandth of those that follow make 1.0, the
examples .04 to .5, the laws of the package .1 at most.
"""
_RUNS_AWAY = 10.0
"""Largest error along z over the height of the sample: the laws of the package have up to 1.04."""
_LEAK = 5_000_000
"""What a controller may take in a quarter of a long run, once, but not in the next quarter as well [bytes]."""


@dataclass(frozen=True)
class Rule:
    """One rule.

    Parameters
    ----------
    name : str
    what : str
        What a controller must do, for the docs.
    judge : callable
        (log, terms) -> why it is broken; empty if it is kept, None if it was not tested.
    """

    name: str
    what: str
    judge: Callable[[Log, Terms], str | None]


def _readable(log: Log) -> list[Answer]:
    return [each for each in log.answers if not each.unreadable]


def _first(problems: Iterator[str]) -> str:
    """The first problem, and how many more there are."""
    found = list(problems)
    return f"{found[0]} (and {len(found) - 1} more)" if len(found) > 1 else "".join(found)


def _answered(log: Log, *phases: Phase) -> str | None:
    """Whether each measurement of these phases has been answered."""
    if not any(phase in log.begun for phase in phases):
        return None
    given = {(each.phase, each.sequence) for each in _readable(log)}
    asked = [each for each in log.sent if each.phase in phases]
    missing = [each.sequence for each in asked if (each.phase, each.sequence) not in given]
    if not missing:
        return ""
    return f"{len(missing)} of {len(asked)} measurements were not answered, the first was {missing[0]}"


def _once(log: Log, terms: Terms) -> str | None:
    asked = Counter((each.phase, each.sequence) for each in log.sent)
    given = Counter((each.phase, each.sequence) for each in _readable(log))
    return _first(
        f"measurement {key[1]} was answered {given[key]} times"
        for key in given
        if key[0] != Phase.PAUSE and given[key] > asked[key] > 0
    )


def _order(log: Log, terms: Terms) -> str | None:
    newest: dict[Phase, int] = {}

    def problems() -> Iterator[str]:
        for each in _readable(log):
            before = newest.get(each.phase, -1)
            if each.sequence < before:
                yield f"the answer to measurement {each.sequence} came after that to {before}"
            newest[each.phase] = max(before, each.sequence)

    return _first(problems())


def _asked(log: Log, terms: Terms) -> str | None:
    # At the begin of a phase an answer to the last measurement of the one before may still be on its way.
    known = {phase: {each.sequence for each in log.sent if each.phase == phase} for phase in Phase}
    phases = list(Phase)

    def expected(each: Answer) -> bool:
        at = phases.index(each.phase)
        return each.sequence in known[each.phase] or (at > 0 and each.sequence in known[phases[at - 1]])

    return _first(
        f"a drive came for measurement {each.sequence}, which was not published"
        for each in _readable(log)
        if not expected(each)
    )


def _in_time(log: Log, terms: Terms) -> str | None:
    first = {(each.phase, each.sequence): each.time for each in reversed(_readable(log))}
    waits = [
        (first[each.phase, each.sequence] - each.time, each.sequence)
        for each in log.sent
        if each.phase in IN_LOCKSTEP and (each.phase, each.sequence) in first
    ]
    if not waits:
        return None
    return _first(
        f"the answer to measurement {sequence} took {wait:.3g} s, the deadline is {terms.deadline:g} s"
        for wait, sequence in waits
        if wait > terms.deadline
    )


def _finite(log: Log, terms: Terms) -> str | None:
    return _first(
        f"the drive for measurement {each.sequence} is {each.drives[0].tolist()} V"
        if not np.isfinite(each.drives[0]).all()
        else f"the horizon for measurement {each.sequence} contains a value that is not finite"
        for each in _readable(log)
        if not np.isfinite(each.drives).all()
    )


def _run(log: Log, terms: Terms) -> str | None:
    return _first(
        f"the drive for measurement {each.sequence} has a wrong run_id: it must be that of the measurement, or 0"
        for each in _readable(log)
        if each.other_run
    )


def _frame(log: Log, terms: Terms) -> str | None:
    return _first(
        f"the drive for measurement {each.sequence} has the frame_id {each.frame[:40]!r}, not {topics.FRAME!r}"
        for each in _readable(log)
        if each.frame != topics.FRAME
    )


def _in_range(log: Log, terms: Terms) -> str | None:
    limit = terms.sim.piezo.limit or _STRONGEST
    return _first(
        f"the drive for measurement {each.sequence} goes to {largest:.6g} V, the limit is {limit:g} V"
        for each in _readable(log)
        if limit < (largest := np.abs(each.drives).max()) < np.inf
    )


def _slew(log: Log, terms: Terms) -> str | None:
    limit, period = terms.sim.piezo.slew_limit, terms.sim.plant.control_period
    if not limit:
        return None

    def problems() -> Iterator[str]:
        given = [each for each in _readable(log) if each.phase in IN_LOCKSTEP]
        for before, each in pairwise(given):
            ticks = each.sequence - before.sequence
            step = float(np.abs(each.drives[0] - before.drives[0]).max())
            if each.phase == before.phase and ticks > 0 and step > limit * ticks * period * (1.0 + 1e-9):
                yield (
                    f"the drive for measurement {each.sequence} is {step:.4g} V from the one before, "
                    f"{limit * ticks * period:.4g} V are allowed"
                )

    return _first(problems())


def _pause(log: Log, terms: Terms) -> str | None:
    if Phase.PAUSE not in log.begun:
        return None
    if stray := [each for each in log.answers if each.phase == Phase.PAUSE]:
        return f"{len(stray)} drives came in a pause, the first for measurement {stray[0].sequence}"
    return _answered(log, Phase.RESUMED)


def _send_again(log: Log, terms: Terms) -> str | None:
    if Phase.AGAIN not in log.begun:
        return None
    given = [each for each in _readable(log) if each.phase == Phase.AGAIN]
    asked = [each for each in log.sent if each.phase == Phase.AGAIN]
    if len(given) >= len(asked):
        return ""
    return f"measurement {asked[0].sequence} was sent {len(asked)} times and answered {len(given)} times"


def _restart(log: Log, terms: Terms) -> str | None:
    if Phase.RESTART not in log.begun:
        return None
    return _answered(log, Phase.RESTART) if log.reconnected else "it did not connect to a simulator that was restarted"


def _stamp(log: Log, terms: Terms) -> str | None:
    period = terms.sim.plant.control_period
    return _first(
        f"the drive for measurement {each.sequence} has the stamp {each.stamp:.9f} s, not {stamp:.9f} s"
        for each in _readable(log)
        if abs(each.stamp - (stamp := each.sequence * period)) > 1e-9
    )


def _answered_jumps(log: Log, terms: Terms) -> list[Response] | None:
    return responses(log, 2 if terms.sim.onboard.kind != "none" else 3) if terms.feedback else None


def _response(log: Log, terms: Terms) -> str | None:
    if (found := _answered_jumps(log, terms)) is None:
        return None

    def problems() -> Iterator[str]:
        for axis, response in enumerate(found):
            name = "xyz"[axis]
            measured = f"measured {'position' if axis < 2 else 'height of the tip'}"
            if response.lag < 0:
                others = [other for other, step in zip("xyz", response.steps, strict=True) if step]
                instead = f": that of {' and '.join(others)} does" if others else ""
                yield f"the drive of {name} does not answer when its reference moves{instead}"
                continue
            if response.steps[axis] < 0:
                yield f"the drive of {name} falls when its reference rises"
            if response.feedback is None:
                yield f"the drive of {name} does not answer the {measured}"
            elif response.feedback > _UPWARDS * abs(response.steps[axis]):
                yield f"the drive of {name} rises when the {measured} rises"
            if axis < 2 and (step := response.steps[1 - axis]):
                smallest = min(abs(each.steps[i]) for i, each in enumerate(found[:2]) if each.steps[i])
                if abs(step) > _ACROSS * smallest:
                    yield (
                        f"the drive of {'xy'[1 - axis]} moves by {step:.3g} V when the reference of {name} jumps, "
                        f"that of {name} by {response.steps[axis]:.3g} V"
                    )

    return _first(problems())


def _present(log: Log, terms: Terms) -> str | None:
    if (found := _answered_jumps(log, terms)) is None:
        return None
    return _first(
        f"the drive of {'xyz'[axis]} answers the measurement {response.lag} before the one whose sequence it has"
        for axis, response in enumerate(found)
        if response.lag > 0
    )


def _follows(log: Log, terms: Terms) -> str | None:
    """Judge what the drives make of the exam's own plant in the phase LOCKSTEP."""
    # What is broken before has its own rule, and need not follow.
    before = (_answered(log, Phase.LOCKSTEP), _finite(log, terms), _response(log, terms), _present(log, terms))
    if not terms.feedback or len(log.motion) < 2 or any(each is None or each for each in before):
        return None
    motion = np.array(log.motion)
    error = motion[:, 0] - motion[:, 1]
    wanted = motion[:, 1] - motion[0, 0]
    sample = registry.find("sample", terms.sim.sample.kind).height(terms.sim)

    def problems() -> Iterator[str]:
        for axis in range(2):
            made, still = (float(np.sqrt(np.mean(each[:, axis] ** 2))) for each in (error, wanted))
            if still > 0.0 and not made <= _FOLLOWS * still:
                yield (
                    f"{'xy'[axis]} does not follow its reference in the first {len(motion)} measurements: the error is "
                    f"{made:.3g} m rms, of a scanner that does not move it is {still:.3g} m, at most "
                    f"{_FOLLOWS * still:.3g} m is allowed: look at sign and size of the gains, damping included"
                )
        away = float(np.abs(error[:, 2]).max())
        if sample > 0.0 and terms.sim.onboard.kind == "none" and not away <= _RUNS_AWAY * sample:
            yield (
                f"z runs away in the first {len(motion)} measurements: the deflection changes by up to {away:.3g} m, "
                f"at most {_RUNS_AWAY * sample:.3g} m is allowed: look at sign and size of the gains, damping included"
            )

    return _first(problems())


def _repeats(log: Log, terms: Terms) -> str | None:
    if not (terms.repeats and Phase.REPEAT in log.begun):
        return None
    first, again = (
        {each.sequence: each.drives[0] for each in _readable(log) if each.phase is phase}
        for phase in (Phase.LOCKSTEP, Phase.REPEAT)
    )
    largest = max((np.abs(each).max() for each in first.values()), default=0.0)
    return _first(
        f"the drive for measurement {sequence} was {first[sequence].tolist()} V, after a reset {drive.tolist()} V"
        for sequence, drive in again.items()
        if sequence in first and np.abs(drive - first[sequence]).max() > 1e-9 * largest
    )


def _memory(log: Log, terms: Terms) -> str | None:
    sizes = log.memory
    if len(sizes) < 4:
        return None
    third, last = (sizes[(i + 1) * (len(sizes) - 1) // 4] - sizes[i * (len(sizes) - 1) // 4] for i in (2, 3))
    if min(third, last) < _LEAK:
        return ""
    asked = sum(each.phase is Phase.LONG for each in log.sent)
    return f"it has taken {1e-6 * (sizes[-1] - sizes[0]):.3g} MB more in {asked} measurements, and takes more and more"


RULES = (
    Rule(
        "connected",
        "publishes `piezo_drive` and receives `measurement`, both reliable and volatile",
        lambda log, _: log.incompatible or log.absent or ("" if log.sent else None),
    ),
    Rule("alive", "does not end by itself", lambda log, _: log.ended),
    Rule("answered", "answers every measurement, with its sequence", lambda log, _: _answered(log, *_ONE_BY_ONE)),
    Rule("once", "answers no measurement more often than it is sent", _once),
    Rule("in order", "never answers an older measurement after a newer one", _order),
    Rule("asked", "sends no drive for a measurement that has not been published", _asked),
    Rule("in time", "answers within the deadline", _in_time),
    Rule(
        "readable",
        "sends whole messages, with a stamp that is a time",
        lambda log, _: _first(each.unreadable for each in log.answers if each.unreadable),
    ),
    Rule("finite", "sends only finite values, in the horizon as well", _finite),
    Rule("run", "puts the run_id of the measurement into its drive, or 0", _run),
    Rule("frame", "puts `scanner` into frame_id", _frame),
    Rule("stamp", "puts the stamp of the measurement into the header", _stamp),
    Rule("range", f"stays within +-`piezo.limit`, without one within {_STRONGEST:g} V", _in_range),
    Rule("slew", "changes its drive by no more than `piezo.slew_limit` allows, if there is one", _slew),
    Rule("pause", "is silent while no measurement comes, and continues afterwards", _pause),
    Rule("sent again", "answers a measurement that is sent again", _send_again),
    Rule("reset", "continues when the sequences begin again at 0", lambda log, _: _answered(log, Phase.RESET)),
    Rule("fault", "answers when sensors fail or measurements get lost", lambda log, _: _answered(log, Phase.FAULT)),
    Rule(
        "response",
        "moves the drive of an axis up when its reference jumps up, hardly the other one of x and y, and answers its "
        "measured position, too",
        _response,
    ),
    Rule("present", "computes a drive from the measurement whose sequence it has", _present),
    Rule(
        "follows",
        "has the exam's own plant follow the reference: at most 80 % of the error of a scanner that does not move, and "
        "no tip that runs away",
        _follows,
    ),
    Rule("repeats", "sends the same drives for the same measurements after a reset, the first 2000", _repeats),
    Rule("memory", "takes no more memory from measurement to measurement", _memory),
    Rule("restart", "finds a simulator that was restarted", _restart),
    Rule(
        "end",
        "ends when it is interrupted (SIGINT), within 10 s",
        lambda log, _: None if log.went is None else "" if log.went else "it had to be killed",
    ),
)
"""Every rule, in the order of the table."""
