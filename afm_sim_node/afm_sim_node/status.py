"""A run as InstrumentStatus."""

from collections.abc import Sequence
from typing import Any

from afm_msgs.msg import InstrumentStatus

from afm_model.run import OVER, Snapshot
from afm_model.run.counts import Counts
from afm_node_common import topics
from afm_node_common.process import SimNodeParameters
from afm_node_common.stamps import stamp


def status_message(
    run: Snapshot,
    parameters: SimNodeParameters,
    *,
    controllers: Sequence[str],
    recorders: int,
    warning: str,
    over: bool = False,
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
    over : bool
        Whether the run is left. One that has finished is over in any case.
    """
    status = InstrumentStatus(
        run_id=run.run_id,
        state=int(run.state),
        reason=run.reason,
        detail=run.detail,
        over=over or run.state in OVER,
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
        **counted(InstrumentStatus, run.counts),
        in_contact=run.in_contact,
        faults=list(run.faults),
    )
    status.header.frame_id = topics.FRAME
    status.header.stamp = stamp(run.stamp_ns)
    return status


def counted(message: Any, counts: Counts) -> dict[str, int]:
    """Those counts that a type of message has a field for."""
    return {name: getattr(counts, name) for name in Counts.__slots__ if name in message.get_fields_and_field_types()}
