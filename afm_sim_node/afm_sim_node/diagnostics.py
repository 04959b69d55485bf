"""A run as DiagnosticStatus, for ordinary tools."""

from collections.abc import Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from afm_model.run import Delays, RunState, Snapshot
from afm_model.run.counts import Counts
from afm_node_common.diagnostics import entry

_LEVEL = {
    RunState.STALLED: DiagnosticStatus.ERROR,
    RunState.RETRACTED: DiagnosticStatus.ERROR,
    RunState.FAULT: DiagnosticStatus.ERROR,
    RunState.HELD: DiagnosticStatus.ERROR,
    RunState.WITHDRAWN: DiagnosticStatus.ERROR,
    RunState.APPROACHING: DiagnosticStatus.WARN,
}


def diagnostic_status(
    name: str, run: Snapshot, delays: Delays, warnings: Sequence[str], fast_path: Mapping[str, bool]
) -> DiagnosticStatus:
    """The entry about a run as it is now.

    Parameters
    ----------
    name : str
        Full name of the node.
    run : Snapshot
    delays : Delays
    warnings : sequence of str
        What went wrong since the entry before.
    fast_path : mapping
        Which short cuts of the control loop are there.
    """
    level, message = _LEVEL.get(run.state, DiagnosticStatus.OK), run.detail or run.state.title
    if warnings or (run.state == RunState.WAITING and run.detail):
        # A run that has not started is a warning only if it needs an action from outside.
        level = max(level, DiagnosticStatus.WARN)
        message = "; ".join([message, *warnings])
    values = {
        "ticks": run.ticks,
        "reason": run.reason,
        "real-time factor": f"{run.real_time_factor:.4g}",
        "round trip p50, p99, p99.9, max [s]": _show(delays.round_trip),
        "lateness p50, p99, p99.9, max [s]": _show(delays.lateness),
        "command age p50, p99, p99.9, max [s]": _show(delays.command_age),
        **{name.replace("_", " "): getattr(run.counts, name) for name in Counts.__slots__},
        **fast_path,
    }
    return entry(f"{name}: instrument", level, message, values)


def _show(times: Sequence[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in times)
