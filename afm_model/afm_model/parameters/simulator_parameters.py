"""Parameters of the simulator: the instrument, how it runs in time, its own limits, and the law inside it."""

from collections.abc import Mapping
from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from ..core.schema import Group, NonNegative, Positive, Unit, Value, build, chosen_group, flatten
from ..law import ExternalLaw
from ..law.sampled import TIMING, SampledLaw
from ..parts.ticks import ticks_of
from ..plant.lever.parameters import LeverGroup
from .instrument_parameters import ControllerParameters, InstrumentParameters
from .microscope_parameters import known_of

_SHARED = ("scanner.", "cantilever.", "scales.", "contact.", "sample.")
"""Parameters of simulator and controller with the same names, without a lever."""
_OF_PIEZO = tuple(f"piezo.{name}" for name in ("sensitivity_x", "sensitivity_y", "sensitivity_z", "limit"))


def is_inside(law: Group) -> bool:
    """Whether the law of a simulator is inside it."""
    return not isinstance(law, ExternalLaw)


def controller_of(sim: InstrumentParameters, law: Group) -> ControllerParameters:
    """The controller whose law is inside this simulator: it believes the microscope to be what it is.

    Parameters
    ----------
    sim : InstrumentParameters
    law : Group
        Its group `law`; not the external one.

    Raises
    ------
    ParameterError
        If the law does not allow them.
    """
    own: dict[str, Value] = {f"law.{name}": value for name, value in flatten(law).items()}
    given = flatten(sim)
    piezo = {name: given[name] for name in _OF_PIEZO}
    plant: Group = sim.plant
    if isinstance(plant, LeverGroup):
        known = known_of(plant, piezo, own)
    else:
        known = piezo | {name: value for name, value in given.items() if name.startswith(_SHARED)}
    return build(ControllerParameters, known | own)


def timing_inside(model: type[Group], values: Mapping[str, Value]) -> dict[str, Value]:
    """Period and delay of the plant for a law inside the simulator, as far as `values` leave them out.

    Parameters
    ----------
    model : type[Group]
        Of any node.
    values : mapping
        By dotted names.
    """
    if "law.kind" not in values or not issubclass(model, InstrumentParameters) or "law" not in model.model_fields:
        return {}
    if not issubclass(chosen_group(model, "law", values), SampledLaw):
        return {}
    plant = chosen_group(model, "plant", values)
    return {
        f"law.{name}": values.get(f"plant.{of}", plant.model_fields[of].default)
        for name, of in zip(TIMING, ("control_period", "delay_ticks"), strict=True)
        if f"law.{name}" not in values
    }


class Safety(Group):
    """When the instrument takes the drive itself, and how it gives it back: docs/safe_states.md. By default all off."""

    travel_limit: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="position of the scanner along x or y beyond which the sample is withdrawn; 0: no limit"
    )
    force_limit: Annotated[NonNegative, Unit("N")] = Field(
        0.0, description="normal force beyond which the sample is withdrawn; 0: no limit"
    )
    contact_timeout: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="simulated time out of contact after which the sample is withdrawn; 0: never"
    )
    validity: bool = Field(
        False, description="withdraw the sample where the normal force is outside what the plant holds for"
    )
    unrecorded: bool = Field(
        False, description="hold the run while the recorder cannot write its file (topic recorder_status)"
    )
    resume_after: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="simulated time withdrawn after which the instrument resumes by itself; 0: by the service only"
    )
    approach_speed: Annotated[Positive, Unit("m/s")] = Field(
        5e-6, description="speed of the sample towards the tip after resume"
    )
    approach_force: Annotated[NonNegative, Unit("N")] = Field(
        0.0, description="normal force beyond which an approach is given up; 0: safety.force_limit"
    )
    approach_timeout: Annotated[Positive, Unit("s")] = Field(
        1.0, description="simulated time without contact after which an approach is given up"
    )
    settle_time: Annotated[NonNegative, Unit("s")] = Field(
        1e-3, description="simulated time in contact after which the controller has the drive again"
    )

    @property
    def guarded(self) -> bool:
        """Whether there is any limit to look at."""
        return bool(self.travel_limit or self.force_limit or self.contact_timeout or self.validity)


class RunParameters(Group):
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
    clock_each_tick: bool = Field(
        False,
        description="publish /clock with every measurement, not only 50 times a second of wall time, for controllers "
        "with use_sim_time and timers; in lockstep it shows the end of the control period that waits for its drive",
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
    return_speed: Annotated[Positive, Unit("m/s")] = Field(
        2e-6,
        description="realtime: speed of each axis on the way back to the drive of a controller that was silent",
    )


class SimParameters(InstrumentParameters):
    """The instrument and how it runs: all parameters of the simulator."""

    run: RunParameters = RunParameters()
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
