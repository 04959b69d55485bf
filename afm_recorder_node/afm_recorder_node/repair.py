"""`ros2 run afm_recorder_node repair PARTIAL OUT`: completes the recording that a killed recorder has left,
and saves what is whole of a damaged one."""

import argparse
import sys
from pathlib import Path

from . import layout
from .complete import complete
from .names import check_name
from .readable import readable
from .recording import RecordingError


def repair(partial: Path, out: Path) -> tuple[int, str]:
    """Copy what is readable and unchanged into a complete recording; `partial` is not changed.

    An event in the copy tells what was left out because it had changed since it was written.

    Parameters
    ----------
    partial, out : Path

    Returns
    -------
    (int, str)
        Control ticks in it; a sentence about what was left out, empty if nothing was.

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
    with readable(partial, salvage=True) as (file, extent):
        left_out = sum(end - begin for begin, end in extent.damaged)
        note = f"{left_out} bytes of the recording were damaged, and are left out" if left_out else ""
        try:
            return complete(file, [out], note=note)[1][layout.POSITION.entity], note
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
        ticks, left_out = repair(arguments.partial, arguments.out)
    except (RecordingError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.out} holds {ticks} ticks")
    if left_out:
        print(f"warning: {left_out}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
