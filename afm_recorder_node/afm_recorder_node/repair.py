"""`ros2 run afm_recorder_node repair PARTIAL OUT`: completes the recording that a killed recorder has left."""

import argparse
import sys
from pathlib import Path

from . import layout
from .complete import complete
from .partial import check_name
from .reader import readable
from .recording import RecordingError


def repair(partial: Path, out: Path) -> int:
    """Copy the readable part into a complete recording; `partial` is not changed.

    Parameters
    ----------
    partial, out : Path

    Returns
    -------
    int
        Control ticks in it.

    Raises
    ------
    RecordingError
        If `partial` is no recording.
    OSError
        If `out` exists, or cannot be written.
    """
    out = out.absolute()
    check_name(out)
    if out.exists():
        raise OSError(f"{out} exists: give another name, nothing is overwritten")
    with readable(partial) as (file, _):
        try:
            return complete(file, out)[layout.POSITION.entity]
        except (RuntimeError, ValueError) as error:
            raise RecordingError(f"{partial} is no readable recording: {error}") from error


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="repair", description="Make a complete recording of one that broke off; the old file stays as it is."
    )
    parser.add_argument("partial", type=Path, help="recording.interrupted.rrd or recording.partial.rrd")
    parser.add_argument("out", type=Path, help="the recording to write; it must not exist")
    arguments = parser.parse_args()
    try:
        ticks = repair(arguments.partial, arguments.out)
    except (RecordingError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.out} holds {ticks} ticks")
    return 0


if __name__ == "__main__":
    sys.exit(main())
