"""`ros2 run afm_recorder_node export RECORDING --mcap FOLDER`: a recording as a bag of its instrument's messages."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from afm_model.core.errors import ResultFileError, reason
from afm_model.core.outputs import require_folder

from .reader import read_recording
from .recording import RecordingError


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="export",
        description="Write a recording as a bag of ROS 2 (MCAP) with the messages of the instrument: for Foxglove, "
        "PlotJuggler, ros2 bag. Needs `pip install rosbags`.",
    )
    parser.add_argument("recording", type=Path, help="recording of the run (.rrd)")
    parser.add_argument("--mcap", type=Path, metavar="FOLDER", help="of the bag (default: RECORDING without .rrd)")
    asked = parser.parse_args(arguments)
    folder = asked.mcap or asked.recording.with_suffix("")
    try:
        # An extra, and ROS: not for a question about the options.
        from .mcap import export

        if folder.exists():
            raise ResultFileError(f"{folder} exists: give another name, nothing is overwritten")
        require_folder(folder)
        count = export(read_recording(asked.recording), folder)
    except ModuleNotFoundError as error:
        print(f"error: {error}: `pip install rosbags` in the environment of env.sh", file=sys.stderr)
        return 1
    except (RecordingError, ResultFileError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {folder} cannot be written: {reason(error)}", file=sys.stderr)
        return 1
    print(f"{folder / (folder.name + '.mcap')} holds {count} messages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
