"""Warnings about the quality of a run."""

from collections.abc import Callable

from ..core.prefix import text
from ..instrument import Instrument, ScoreSummary
from ..instrument.validity import doubts
from ..parameters import ControllerParameters, InstrumentParameters
from .counts import Snapshot

HELD_WARNED = 0.01
"""Fraction of the scored ticks that may run on a held drive without a warning in the score."""
HELD_MOST = 0.5
"""The same without the score becoming invalid; and during the run, of the ticks since the last look, without a warning.
With more, most of what is scored is not what the controller answers.
"""
_MISSED = 0.01
"""Fraction of the periods that may be missed without a warning during the run; the score counts all."""


def warnings(before: Snapshot, now: Snapshot, cause: Callable[[], str] = str) -> list[str]:
    """What went wrong between two looks at one run, a clause each.

    Parameters
    ----------
    before, now : Snapshot
    cause : callable, optional
        Called if drives are late; returns why they may be, as `Link.cause`.
    """
    ticks = now.ticks - before.ticks
    a, b = before.counts, now.counts
    told = []
    missed = b.periods_missed - a.periods_missed
    if now.wanted_factor is not None and missed > _MISSED * (missed + ticks):
        told.append(
            f"{missed} of the last {missed + ticks} periods were missed ({_percent(missed, missed + ticks)}): the run "
            f"reaches {_factor(before, now):.3g} of real time in place of {now.wanted_factor:g}"
        )
    lost = b.drives_lost - a.drives_lost
    if now.wanted_factor is not None and ticks > 0 and lost > HELD_MOST * ticks:
        told.append(f"{lost} of the last {ticks} ticks had no new drive and held an older one{_because(cause)}")
    if (outdated := b.drives_outdated - a.drives_outdated) > 0:
        told.append(f"{outdated} drives answered an older measurement than one before them and were not put in force")
    if (ahead := b.drives_ahead - a.drives_ahead) > 0:
        told.append(f"{ahead} drives answered a measurement that has not been published and were not put in force")
    if (malformed := b.drives_malformed - a.drives_malformed) > 0:
        told.append(f"{malformed} drives could not be read and were dropped, the last: {now.unreadable}")
    return told


def _because(cause: Callable[[], str]) -> str:
    return f" ({found})" if (found := cause()) else ""


def verdict(summary: ScoreSummary, end: Snapshot, cause: Callable[[], str] = str) -> str:
    """Why the score of a run must not be compared with that of others; empty if it may. `cause` as of `warnings`."""
    retracted = end.counts.scored_ticks_retracted
    if summary.ticks and retracted:
        return (
            f"the sample was retracted in {retracted} of {summary.ticks} scored ticks "
            f"({_percent(retracted, summary.ticks)}), because no drive came"
        )
    held = _on_held_drive(summary, end, cause) if _held(summary, end) > HELD_MOST else ""
    return withdrawn(summary, end.counts.scored_ticks_withdrawn, end.counts.withdrawals) or held


def reasons(
    summary: ScoreSummary,
    end: Snapshot,
    parameters: InstrumentParameters,
    law: ControllerParameters | None = None,
    cause: Callable[[], str] = str,
) -> list[str]:
    """Return all reasons why a finished run's score is not valid, one sentence each; none if it is valid.

    Parameters
    ----------
    summary : ScoreSummary
    end : Snapshot
        Of the run at its end.
    parameters : InstrumentParameters
    law : ControllerParameters, optional
        The law that closed the loop, if it is known.
    cause : callable, optional
        As of `warnings`.
    """
    found = [
        verdict(summary, end, cause),
        *doubts(parameters, summary, law),
        saturated(end.samples_saturated),
        outside(end.time_outside, parameters.plant.kind),
    ]
    return [each for each in found if each]


def warning(summary: ScoreSummary, end: Snapshot, cause: Callable[[], str] = str) -> str:
    """Return what else to know before reading the score of a finished run: missed periods, held drives; or nothing.

    `cause` as of `warnings`.
    """
    held = _on_held_drive(summary, end, cause) if HELD_WARNED < _held(summary, end) <= HELD_MOST else ""
    return "; ".join(filter(None, [shortfall(end), held]))


def _on_held_drive(summary: ScoreSummary, end: Snapshot, cause: Callable[[], str]) -> str:
    """Return a clause that gives the number of scored ticks without a new drive, and what to do."""
    return (
        f"{end.scored_ticks_held} of {summary.ticks} scored ticks ({_percent(end.scored_ticks_held, summary.ticks)}) "
        f"ran on a held drive, because no new one had come; at most {100 * HELD_MOST:g} % may: lower "
        f"run.real_time_factor, raise plant.control_period, or send drives ahead (horizon){_because(cause)}"
    )


def _held(summary: ScoreSummary, end: Snapshot) -> float:
    return end.scored_ticks_held / summary.ticks if summary.ticks else 0.0


def withdrawn(summary: ScoreSummary, ticks: int, times: int) -> str:
    """That the instrument had the drive in so many scored ticks, because of so many withdrawals; empty if in none."""
    if not (summary.ticks and ticks):
        return ""
    return (
        f"the instrument had the drive in {ticks} of {summary.ticks} scored ticks ({_percent(ticks, summary.ticks)}): "
        f"it withdrew the sample {times} time{'s' * (times != 1)}, because a limit was passed"
    )


def saturated(samples: int) -> str:
    """That the detector was beyond its range in so many samples; empty if in none."""
    if not samples:
        return ""
    return (
        f"the photodiode was at the end of its range in {samples} samples: deflection or lateral force read less there "
        f"than they are"
    )


def outside(time: float, plant: str) -> str:
    """That a plant was outside of what it holds for during so long a time [s]; empty if it was not."""
    if time == 0.0:
        return ""
    return (
        f"plant.kind = {plant} did not hold for {text(time, 's')}, where truth/outside is 1: what was measured there "
        f"is no result; take plant.kind = lever, or a larger amplitude"
    )


def limited(instrument: Instrument) -> str:
    """Warnings about a finished run."""
    counts = instrument.guard.counts()
    return withdrawn(instrument.score(), counts["scored_ticks_withdrawn"], counts["withdrawals"])


def retracted_fraction(summary: ScoreSummary, end: Snapshot) -> float:
    """Part of the scored ticks in which the sample was retracted; NaN if nothing was scored."""
    return end.counts.scored_ticks_retracted / summary.ticks if summary.ticks else float("nan")


def shortfall(end: Snapshot) -> str:
    """Return by how much a realtime run was slower than its clock, in one sentence; empty if it was not."""
    missed = end.counts.periods_missed
    if not missed or end.wanted_factor is None:
        return ""
    periods = missed + end.ticks
    return (
        f"{_percent(missed, periods)} of the periods were missed ({missed} of {periods}): the run "
        f"reached {end.real_time_factor:.3g} of real time in place of {end.wanted_factor:g}"
    )


def _factor(before: Snapshot, now: Snapshot) -> float:
    """Simulated over wall time between two looks."""
    elapsed = now.elapsed - before.elapsed
    return (now.time - before.time) / elapsed if elapsed > 0.0 else 0.0


def _percent(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.3g} %"
