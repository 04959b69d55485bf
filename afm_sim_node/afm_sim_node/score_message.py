"""The score of a run as a message."""

from collections.abc import Callable, Sequence

import numpy as np
from afm_msgs.msg import Percentiles, Score
from geometry_msgs.msg import Vector3
from numpy.typing import NDArray

from afm_model.instrument import ScoreSummary
from afm_model.run import Delays, Snapshot, reasons, retracted_fraction, warning
from afm_node_common import topics
from afm_node_common.process import SimNodeParameters
from afm_node_common.stamps import stamp

from .status import counted

_Z = 2


def score_message(
    summary: ScoreSummary,
    run: Snapshot,
    delays: Delays,
    parameters: SimNodeParameters,
    trajectory_sha256: str,
    cause: Callable[[], str] = str,
) -> Score:
    """The message about a run that is over.

    Parameters
    ----------
    summary : ScoreSummary
    run : Snapshot
        At its end.
    delays : Delays
    parameters : SimNodeParameters
    trajectory_sha256 : str
    cause : callable, optional
        Returns why drives may have been late, as `Link.cause`.
    """
    reason = "; ".join(reasons(summary, run, parameters, parameters.controller_inside, cause))
    counts = run.counts

    def error(values: NDArray[np.float64]) -> Vector3:
        """z is NaN if the sample was away from the tip: there was no surface to track."""
        away = counts.scored_ticks_retracted or counts.scored_ticks_withdrawn
        return _vector(np.where(np.arange(3) == _Z, np.nan, values) if away else values)

    score = Score(
        run_id=run.run_id,
        start=parameters.score_start,
        ticks=summary.ticks,
        valid=not reason,
        reason=reason,
        warning=warning(summary, run, cause),
        rms=error(summary.rms),
        max=error(summary.max),
        max_percent=error(summary.max_percent),
        drive_total_variation=_vector(summary.drive_total_variation),
        extent=_vector(summary.extent),
        stick_phases=summary.stick_phases,
        stick_fraction=summary.stick_fraction,
        contact_fraction=summary.contact_fraction,
        retracted_fraction=retracted_fraction(summary, run),
        friction_min=summary.friction[0],
        friction_max=summary.friction[1],
        normal_force_min=summary.normal_force[0],
        normal_force_max=summary.normal_force[1],
        simulated=run.time,
        wall=run.elapsed,
        round_trip=_percentiles(delays.round_trip),
        lateness=_percentiles(delays.lateness),
        command_age=_percentiles(delays.command_age),
        **counted(Score, counts),
        trajectory_sha256=trajectory_sha256,
        faults=list(run.faults_acted),
    )
    score.header.frame_id = topics.FRAME
    score.header.stamp = stamp(run.stamp_ns)
    return score


def _vector(values: NDArray[np.float64]) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


def _percentiles(times: Sequence[float]) -> Percentiles:
    p50, p99, p99_9, largest = times
    return Percentiles(p50=p50, p99=p99, p99_9=p99_9, max=largest)
