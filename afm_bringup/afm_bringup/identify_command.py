"""`ros2 run afm_bringup identify RECORDING`: resonances, dampings and sensitivities of the scanner from a recording."""

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from afm_model import ParameterError
from afm_model.analysis import Estimate
from afm_model.analysis.identification import AXES, IdentifiedScanner, Resonator, identify, write_parameters
from afm_model.core.errors import ResultFileError, reason
from afm_model.core.outputs import require_file
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import IncompleteRecording, RecordingError

from .domain import end


def _identified(path: Path) -> IdentifiedScanner:
    """The scanner of a recording.

    Raises
    ------
    RecordingError
        If it cannot be read.
    ParameterError
        If it is not the motion of a scanner on its own.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteRecording)  # a part of a run will do
        recording = read_recording(path)
    if len(recording.time_ticks) < 2:
        raise ParameterError("the recording holds no motion")
    # Time in a recording is in whole nanoseconds: the mean of many periods is exact.
    period = (recording.time_ticks[-1] - recording.time_ticks[0]) / (len(recording.time_ticks) - 1)
    return identify(recording.drive, recording.position, float(period))


def _print(scanner: IdentifiedScanner) -> None:
    table = Table(title="IdentifiedScanner", title_justify="left")
    for heading in ("", "resonance [Hz]", "damping ratio", "sensitivity [nm/V]", "explained"):
        table.add_column(heading, justify="right" if heading else "left")
    for axis in AXES:
        found: Resonator = getattr(scanner, axis)
        table.add_row(
            axis,
            _with_error(found.f),
            _with_error(found.xi),
            _with_error(Estimate(*(1e9 * each for each in found.sensitivity))),
            f"{100.0 * found.fit:.4g} %",
        )
    Console(width=None if Console().is_terminal else 100).print(table)


def _with_error(found: Estimate) -> str:
    """A number with as many digits as its standard error leaves, four at least."""
    value, error = found
    digits = 4
    if error > 0.0:
        digits = max(digits, int(np.ceil(np.log10(abs(value) / error))) + 1)
    return f"{value:.{min(digits, 8)}g} +- {error:.2g}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="identify",
        description="Find resonance, damping and sensitivity of each axis of the scanner, from the recording of a run "
        "with the tip off the sample such as that of scenario identify_scanner.",
    )
    parser.add_argument("recording", type=Path, help="recording of the run (.mcap)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write them as a parameter file for the controller")
    asked = parser.parse_args(arguments)
    try:
        require_file(asked.out)
        scanner = _identified(asked.recording)
        _print(scanner)
        if asked.out:
            write_parameters(scanner, asked.out, {"identified from": str(asked.recording)})
    except (RecordingError, ResultFileError) as error:  # they name the file
        return end(f"error: {error}", 1)
    except ParameterError as error:
        return end(f"error: {asked.recording}: {error}", 1)
    except OSError as error:
        return end(f"error: {asked.out} cannot be written: {reason(error)}", 1)
    return 0
