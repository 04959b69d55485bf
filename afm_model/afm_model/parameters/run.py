"""Parameters of how the instrument runs in time."""

from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from ..core.schema import Group, NonNegative, Positive, Unit
from ..law import ExternalLaw
from ..parts.timing import ticks_of
from .controller import ControllerParameters
from .instrument import InstrumentParameters
from .law_inside import controller_of, is_inside
from .safety import Safety


class Run(Group):
    """How the instrument runs in time."""

    mode: Literal["lockstep", "realtime"] = Field(
        "lockstep",
        description="lockstep: each tick waits for the drive that answers it; realtime: paced by the steady clock",
    )
    duration: Annotated[NonNegative, Unit("s")] = Field(0.0, description="simulated time to run; 0: endless")
    wait_for_recorder: bool = Field(False, description="do not start before a recorder receives every stream")
    start_paused: bool = Field(False, description="wait for the play service even when a controller is there")
    exit_when_finished: bool = Field(
        False, description="end the node when the duration is over, or with exit code 1 at a FAULT"
    )
    real_time_factor: Positive = Field(1.0, description="realtime: simulated seconds per wall second")
    spin_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="realtime: wall time before each deadline in which the clock is polled instead of slept for"
    )
    catch_up: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="realtime: a tick that begins late by no more wall time than this leaves no period out, the next "
        "ones follow without waiting; one period at least",
    )
    telemetry_rate: Annotated[float, Ge(0), Le(50), Unit("Hz")] = Field(
        50.0, description="messages on topic telemetry per second of wall time, at most; 0: none"
    )
    lockstep_timeout: Annotated[Positive, Unit("s")] = Field(
        5.0, description="lockstep: wall time without an answer after which the controller is reported"
    )
    watchdog_timeout: Annotated[Positive, Unit("s")] = Field(
        0.2, description="realtime: wall time without a drive after which the sample is retracted"
    )
    retract_distance: Annotated[Positive, Unit("m")] = Field(
        240e-9,
        description="how far below its rest the sample is retracted or withdrawn; pull-off takes some 126 nm",
    )
    retract_time: Annotated[Positive, Unit("s")] = Field(
        0.01, description="simulated time in which the sample is retracted or withdrawn"
    )


class SimParameters(InstrumentParameters):
    """The instrument and how it runs: all parameters of the simulator."""

    run: Run = Run()
    safety: Safety = Safety()
    law: ExternalLaw = ExternalLaw()

    @property
    def controller_inside(self) -> ControllerParameters | None:
        """What the law inside the simulator goes by; None: the law is elsewhere."""
        return controller_of(self, self.law) if is_inside(self.law) else None

    @model_validator(mode="after")
    def _law_inside_allows(self) -> "SimParameters":
        _ = self.controller_inside
        return self

    @property
    def total_ticks(self) -> int:
        """Control ticks of the whole run; 0: endless."""
        if self.run.duration == 0.0:
            return 0
        return max(1, ticks_of(self.run.duration, self.plant.control_period))
