"""A run as InstrumentStatus."""

from collections.abc import Sequence

from afm_msgs.msg import InstrumentStatus

from afm_model.run import Snapshot
from afm_node_common import topics
from afm_node_common.process import SimNodeParameters

from .streams import stamp


def status_message(
    run: Snapshot, parameters: SimNodeParameters, *, controllers: Sequence[str], recorders: int, warning: str
) -> InstrumentStatus:
    """The message about a run as it is now.

    Parameters
    ----------
    run : Snapshot
    parameters : SimNodeParameters
    controllers : sequence of str
        Full names of who publishes drives.
    recorders : int
        How many receive every stream.
    warning : str
        What went wrong lately.
    """
    counts = run.counts
    status = InstrumentStatus(
        state=int(run.state),
        reason=run.reason,
        detail=run.detail,
        warning=warning,
        plant=parameters.plant.kind,
        mode=parameters.run.mode,
        controllers=list(controllers),
        recorders=recorders,
        control_period=parameters.plant.control_period,
        duration=parameters.run.duration,
        ticks=run.ticks,
        samples=run.samples,
        real_time_factor=run.real_time_factor,
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
        withdrawals=counts.withdrawals,
        ticks_withdrawn=counts.ticks_withdrawn,
        in_contact=run.in_contact,
        faults=list(run.faults),
    )
    status.header.frame_id = topics.FRAME
    status.header.stamp = stamp(run.stamp_ns)
    return status
