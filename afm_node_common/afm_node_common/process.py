"""Parameters of the process that a node runs in; the physics does not depend on them."""

from typing import Annotated

from annotated_types import Ge, Lt
from pydantic import Field

from afm_model.parameters import ControllerParameters, Group, SimParameters


class Process(Group):
    """Settings of the operating system for the control loop of a node. One that is not granted causes a warning."""

    fifo_priority: Annotated[int, Ge(0), Lt(99)] = Field(
        0,
        description="priority of the control loop's thread under SCHED_FIFO, one less than that of the threads that "
        "bring its messages; 0: ordinary scheduling",
    )
    cpu: Annotated[int, Ge(-1), Lt(4096)] = Field(
        -1, description="processor to which the control loop's thread is bound; -1: any"
    )
    lock_memory: bool = Field(False, description="keep all memory of the process from being paged out")
    parts: str = Field(
        "",
        description="parts of your own, module:NAME, that messages may choose while the node runs; separated by commas",
    )


class InProcess(Group):
    """The group `process` among the parameters of a node."""

    process: Process = Process()


class SimNodeParameters(SimParameters):
    """All parameters of the simulator node."""

    process: Process = Process()


class ControllerNodeParameters(ControllerParameters):
    """All parameters of the controller node."""

    process: Process = Process()
