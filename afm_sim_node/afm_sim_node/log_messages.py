"""Log messages about a run."""

from collections.abc import Sequence
from typing import Any

from afm_model.law import timing_disagreements
from afm_model.parameters.simulator_parameters import is_inside
from afm_model.run import RunState, Snapshot
from afm_node_common.process import SimNodeParameters

_THROTTLE = 5.0
"""Wall time between two complaints of one kind [s]."""


def log_state(log: Any, run: Snapshot, parameters: SimNodeParameters) -> None:
    """Log a change of state."""
    if run.state == RunState.FAULT:
        log.error(run.detail)
    elif run.detail:
        by_service = run.state == RunState.WITHDRAWN and not parameters.safety.resume_after
        log.warning(f"{run.detail}; it comes back by the service resume" if by_service else run.detail)
    elif run.state == RunState.WAITING:
        others = [
            *(["a controller"] if not is_inside(parameters.law) else []),
            *(["a recorder"] if parameters.run.wait_for_recorder else []),
            *(["the play service"] if parameters.run.start_paused else []),
        ]
        log.info(f"waiting for {' and '.join(others)}" if others else f"the law is inside: {parameters.law.kind}")
    elif run.state == RunState.FINISHED:
        log.info(f"finished: {run.ticks} ticks, {run.time:.6g} s simulated")
    else:
        log.info(run.state.title)


def log_timing(log: Any, parameters: SimNodeParameters) -> None:
    """Warn of a law inside that is made for another control period or delay than those of the plant."""
    for sentence in timing_disagreements(parameters.law, parameters):
        log.warning(sentence)


def log_refusal(log: Any, before: Snapshot, now: Snapshot) -> None:
    """Log the drives refused since the last call, where the run continued."""
    if now.counts.drives_refused > before.counts.drives_refused and now.wanted_factor is not None:
        log.error(f"{now.refusal}; it is not applied", throttle_duration_sec=1.0)


def log_warnings(log: Any, warnings: Sequence[str]) -> None:
    """Log new warnings, not too often."""
    if warnings:
        log.warning("; ".join(warnings), throttle_duration_sec=_THROTTLE)
