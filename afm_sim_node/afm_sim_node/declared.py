"""The parameters of the simulator node: what may change, what is completed and refused, what follows from them."""

from collections.abc import Callable

from rclpy.node import Node

from afm_model import Controller
from afm_model.core.errors import ParameterError
from afm_node_common import topics
from afm_node_common.parameters import Declared
from afm_node_common.process import SimNodeParameters

TUNABLE = ("run.real_time_factor", "run.lockstep_timeout", "run.watchdog_timeout", "run.telemetry_rate", "law.")
"""What may change while the instrument runs; of the law one that is inside."""

_BLOCK_SAMPLES = 4000
"""Samples of a channel in a block at most."""
_BLOCK_COST = 2.5e-7
"""Wall time for each tick of a block to copy and hash it, and about as much again to write its trace [s]."""
_SMALLEST_BLOCK = 64
"""Control ticks; smaller ones cost the recorder more than they spare the loop."""


def declare(node: Node, on_change: Callable[[SimNodeParameters], None]) -> Declared[SimNodeParameters]:
    """Declare them on the node; raises ParameterError as `Declared`."""
    return Declared(
        node,
        SimNodeParameters,
        tunable=TUNABLE,
        complete=_with_verbs,
        accepts=_check_law_inside,
        on_change=on_change,
        exchanged=_exchanged,
    )


def takes_verbs(parameters: SimNodeParameters) -> bool:
    """Whether verbs are ordered."""
    return parameters.reference.kind == "verbs"


def _with_verbs(parameters: SimNodeParameters) -> SimNodeParameters:
    """With what verbs need, if they are to be ordered."""
    if not takes_verbs(parameters):
        return parameters
    from afm_model.microscope.prepare import with_verbs

    return with_verbs(parameters)


def _exchanged(parameters: SimNodeParameters) -> dict[str, str]:
    """What services change, where verbs are ordered."""
    if not takes_verbs(parameters):
        return {}
    setting = f"{topics.SET_SETPOINT}, {topics.SET_GAINS} or {topics.SET_FEEDBACK}"
    by_service = {"sample.": topics.SET_SAMPLE, "plant.": topics.SET_PROBE, "calibration.": topics.SET_CALIBRATION}
    return by_service | {"onboard.": setting}


def _check_law_inside(parameters: SimNodeParameters) -> None:
    """Raise ParameterError if the law inside cannot be computed with these parameters."""
    if (inside := parameters.controller_inside) is not None:
        if parameters.run.clock_each_tick:
            raise ParameterError(
                f"run.clock_each_tick = true is not allowed with law.kind = {parameters.law.kind}: a law inside the "
                f"simulator answers no measurement on a topic; set it to false, or law.kind to external"
            )
        Controller(inside)


def wall_period(parameters: SimNodeParameters) -> float:
    """Wall time between two ticks in real time [s]."""
    return parameters.plant.control_period / parameters.run.real_time_factor


def block_ticks(parameters: SimNodeParameters) -> int:
    """Control ticks in a block. In realtime it is handed on between two ticks, and has to fit there."""
    samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
    most = max(1, _BLOCK_SAMPLES // samples_per_tick)
    if parameters.run.mode == "lockstep":
        return most
    return min(most, max(_SMALLEST_BLOCK, round(0.5 * wall_period(parameters) / _BLOCK_COST)))
