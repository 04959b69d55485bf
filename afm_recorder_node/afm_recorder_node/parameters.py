"""Parameters of the recorder."""

from typing import Annotated

from annotated_types import Ge, Lt
from pydantic import Field

from afm_model.parameters import Group


class RecorderParameters(Group):
    """Where a recording goes."""

    path: str = Field(
        "recording.rrd",
        description="file of the recording, complete when the recorder ends and recording.partial.rrd until then; "
        "after a reset of the instrument a new one begins, recording-2.rrd. No file is "
        "replaced: the first of these names that is free is taken",
    )
    every: Annotated[int, Ge(1), Lt(2**31)] = Field(
        1,
        description="keep one control tick and one sample of each channel in so many, for runs of hours; such a "
        "recording cannot be replayed. Events, parameters, scans and the score are whole",
    )
    title: str = Field("", description="what the viewer calls the run; empty: by the name of the file")
