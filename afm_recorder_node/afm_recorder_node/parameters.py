"""Parameters of the recorder."""

from pydantic import Field

from afm_model.parameters import Group


class RecorderParameters(Group):
    """Where a recording goes, and what is in it."""

    path: str = Field(
        "recording.mcap",
        description="file of the messages of a run; recording.rrd for the viewer is made next to it when the run has "
        "ended. After a reset of the instrument a new one begins, recording-2.mcap. No file is replaced: the first of "
        "these names that is free is taken",
    )
    title: str = Field("", description="what the viewer calls the run; empty: by the name of the file")
    exchanges: bool = Field(
        False, description="keep every message of measurement and piezo_drive too, some 300 bytes a tick"
    )
    view: bool = Field(True, description="make recording.rrd when a run has ended")
