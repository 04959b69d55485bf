"""Parameters of the instrument's own limits."""

from typing import Annotated

from pydantic import Field

from ..core.schema import Group, NonNegative, Positive, Unit


class Safety(Group):
    """When the instrument takes the drive itself, and how it gives it back: docs/safe_states.md. All off by default."""

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
