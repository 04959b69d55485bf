"""Names of the channels of an instrument, and of the files of a recording. Needs no ROS."""

from afm_model.parts.channels import STANDARD

RECORD, VIEW = ".mcap", ".rrd"
"""Suffixes of a record, and of the view that is made from it."""
CHANNELS = {channel.name: channel.unit for channel in STANDARD}
"""SI unit of each channel that there always is, by the name of its topic."""
_TAKEN = frozenset(
    "position reference error drive round_trip events parameters score run friction_loop result scene scan".split()
)
"""What a recording shows under these names is something else."""


def is_channel(name: str) -> bool:
    """Whether a topic within the namespace may be that of a further channel."""
    return name.partition("/")[0] not in _TAKEN
