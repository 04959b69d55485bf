"""`ros2 run afm_recorder_node repair RECORDING OUT`: copies what is whole of a damaged recording."""

import argparse
import sys
from pathlib import Path

from .growing import GrowingFile
from .names import RECORD
from .record import open_record
from .record_writer import RecordWriter
from .recording import RecordingError


def repair(source: Path, out: Path) -> tuple[int, str]:
    """Copy the messages that are whole and unchanged into a new recording; `source` is not changed.

    Parameters
    ----------
    source, out : Path

    Returns
    -------
    (int, str)
        Messages in it; a sentence about what was left out, empty if nothing was.

    Raises
    ------
    RecordingError
        If `source` is no recording.
    OSError
        If `out` exists, or cannot be written.
    """
    out = out.with_suffix(RECORD)
    if out.exists():
        raise OSError(f"{out} exists: give another name, nothing is overwritten")
    record = open_record(source, salvage=True)
    left_out = f"{record.damaged} bytes of the recording were damaged, and are left out" if record.damaged else ""
    definitions: dict[str, str] = {}
    writer = RecordWriter(GrowingFile(out), definitions.__getitem__, record.about)
    for each in record.raw():
        definitions[each.kind] = each.definition
        writer.put(each.topic, each.kind, each.time_ns, each.received_ns, each.data)
        if writer.count % 100 == 0 and not writer.flush():
            raise OSError(writer.file.problem)
    missing = "; ".join(filter(None, (record.missing, left_out)))
    writer.close((record.end or {}) | {"complete": "false" if missing else "true", "missing": missing})
    return writer.count, left_out


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="repair", description="Make a whole recording of one that broke off or is damaged; the old file stays."
    )
    parser.add_argument("recording", type=Path, help="recording.mcap")
    parser.add_argument("out", type=Path, help="the recording to write; it must not exist")
    arguments = parser.parse_args()
    try:
        count, left_out = repair(arguments.recording, arguments.out)
    except (RecordingError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.out.with_suffix(RECORD)} holds {count} messages")
    if left_out:
        print(f"warning: {left_out}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
