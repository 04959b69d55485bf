"""The score of a run as a message."""

import numpy as np
from afm_msgs.msg import Score
from numpy.typing import NDArray

from afm_model.instrument import ScoreSummary
from afm_model.instrument.validity import doubts
from afm_model.run import Delays, Snapshot, retracted_fraction, saturated, shortfall, verdict
from afm_node_common import topics
from afm_node_common.process import SimNodeParameters

from .streams import stamp

_Z = 2


def score_message(
    summary: ScoreSummary, run: Snapshot, delays: Delays, parameters: SimNodeParameters, trajectory_sha256: str
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
    """
    reason = "; ".join(
        filter(None, [verdict(summary, run), *doubts(parameters, summary), saturated(run.samples_saturated)])
    )
    counts = run.counts

    def of_the_tip(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """NaN if the sample was away from the tip: there was no surface to track."""
        away = counts.scored_ticks_retracted or counts.scored_ticks_withdrawn
        return np.where(np.arange(3) == _Z, np.nan, values) if away else values

    score = Score(
        start=parameters.score_start,
        ticks=summary.ticks,
        valid=not reason,
        reason=reason,
        warning=shortfall(run),
        rms=of_the_tip(summary.rms),
        max=of_the_tip(summary.max),
        max_percent=of_the_tip(summary.max_percent),
        drive_total_variation=summary.drive_total_variation,
        extent=summary.extent,
        stick_phases=summary.stick_phases,
        stick_fraction=summary.stick_fraction,
        contact_fraction=summary.contact_fraction,
        retracted_fraction=retracted_fraction(summary, run),
        friction=summary.friction,
        normal_force=summary.normal_force,
        simulated=run.time,
        wall=run.elapsed,
        round_trip=delays.round_trip,
        lateness=delays.lateness,
        command_age=delays.command_age,
        drives_lost=counts.drives_lost,
        horizon_ticks=counts.horizon_ticks,
        drives_refused=counts.drives_refused,
        drives_outdated=counts.drives_outdated,
        drives_ahead=counts.drives_ahead,
        drives_malformed=counts.drives_malformed,
        drives_clipped=counts.drives_clipped,
        drives_steep=counts.drives_steep,
        late_ticks=counts.late_ticks,
        periods_missed=counts.periods_missed,
        ticks_retracted=counts.ticks_retracted,
        withdrawals=counts.withdrawals,
        ticks_withdrawn=counts.ticks_withdrawn,
        scored_ticks_withdrawn=counts.scored_ticks_withdrawn,
        trajectory_sha256=trajectory_sha256,
        faults=run.faults_acted,
    )
    score.header.frame_id = topics.FRAME
    score.header.stamp = stamp(run.stamp_ns)
    return score
