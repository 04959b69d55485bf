"""The command line of `scan`, and the sample of a first image: a letter one step high, a corner of another material.

Letter and corner look different in every direction, so that an image shows whether rows, columns and signs are right.
"""

import argparse
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from afm_model.core.errors import ParameterError, reason
from afm_model.core.schema import build
from afm_model.microscope.verbs import Approach, Scan
from afm_node_common import topics
from afm_node_common.runner import StopSignal

from .domain import NoDomainError, claimed_domain, end
from .files import config
from .scan_session import ScanSession
from .scenario_input import add_live, add_overrides, read_scenario
from .session_start import SessionError

_Array = NDArray[np.float64]

WIDTH = 1.2e-6
"""Edge of the sample, whose middle is at x = y = 0 [m]."""
STEP = 10e-9
"""Height of the letter [m]."""
STRENGTH = 0.5
"""Friction of the second material over that of the first."""
_CELLS = 480
_EDGE, _BORDER = 10e-9, 5e-9
"""Standard deviations of the filters that round the edges of the letter and the border of the materials [m]."""
_BARS = ((-300e-9, -180e-9, -350e-9, 350e-9), (-180e-9, 300e-9, 230e-9, 350e-9), (-180e-9, 120e-9, -60e-9, 60e-9))
"""The letter F: left, right, bottom, top of its bars [m]."""
_FIRST = {"contact": "first_image", "tapping": "first_tapping"}
_FRAMES: dict[str, dict[str, int | float]] = {
    "contact": {"size_x": 1e-6, "line_rate": 5.0},
    "tapping": {"size_x": 1e-6, "line_rate": 3.0, "pixels": 48, "lines": 48},
}
"""Of the first image in each mode; what is not here is the verb's default."""
_OPTIONS = {
    "size_x": "width of the frame [m]",
    "size_y": "height of the frame [m]; 0: square pixels",
    "centre_x": "middle of the frame [m]",
    "centre_y": "middle of the frame [m]",
    "angle": "of the fast direction against x, counterclockwise [rad]",
    "pixels": "in a line",
    "lines": "of the image",
    "line_rate": "lines a second; a line is trace and retrace",
    "overscan": "time of a turn over that of the image part of a line",
    "direction": "of the slow axis: up or down",
    "channels": "what is measured, separated by commas",
}


def _arguments(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="scan",
        description="Start a microscope, approach, scan an image over topics, withdraw; leave picture, .gwy, "
        ".sxm, recording, table. Without a scenario: the letter F and a corner of another material.",
    )
    parser.add_argument(
        "scenario", nargs="?", default="", help="name of a scenario, or a scenario file, with reference.kind: verbs"
    )
    parser.add_argument("--out", required=True, type=Path, help="folder for the results")
    add_overrides(parser)
    parser.add_argument(
        "--namespace",
        default=topics.NAMESPACE,
        help=f"namespace of the instrument, in place of {topics.NAMESPACE}",
    )
    parser.add_argument(
        "--mode",
        choices=tuple(_FIRST),
        help="mode of the first image (default contact); with a scenario it is the scenario's",
    )
    add_live(parser)
    for name, told in _OPTIONS.items():
        usual = Scan.model_fields[name].default
        default = _FRAMES["contact"].get(name, usual)
        tapping = _FRAMES["tapping"].get(name, default)
        shown = f"default {default}" if default != "" else "default by mode"
        if tapping != default:
            shown += f", tapping {tapping}"
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            dest=name,
            type=type(usual),
            metavar="VALUE",
            help=f"{told} ({shown})",
        )
    # Before Python 3.14 argparse takes -150e-9 for an option.
    parser._negative_number_matcher = re.compile(r"-\.?\d")
    return parser.parse_args(arguments)


def main() -> int:
    """Entry point of `ros2 run afm_bringup scan`."""
    arguments = _arguments()
    try:
        if arguments.scenario and arguments.mode:
            raise ValueError(f"--mode {arguments.mode} is not allowed with {arguments.scenario}: the scenario says it")
        mode = arguments.mode or "contact"
        given = {name: value for name in _OPTIONS if (value := getattr(arguments, name)) is not None}
        verb = build(Scan, _FRAMES[mode] | given)
        with tempfile.TemporaryDirectory() as folder:
            if arguments.scenario:
                scenario = read_scenario(arguments.scenario, arguments.overrides, arguments.parts)
            else:
                scenario = read_scenario(
                    str(_first(mode, arguments.out, Path(folder))), arguments.overrides, arguments.parts
                )
        if scenario.sim.reference.kind != "verbs":
            raise ValueError(
                f"{scenario.path}: reference.kind = {scenario.sim.reference.kind} is not allowed in a scan: it must be "
                f"verbs, as in two_materials"
            )
        claim = claimed_domain("this session")
        ScanSession(scenario, arguments.out, verb, Approach(), namespace=arguments.namespace, live=arguments.live).run()
    except StopSignal:
        return end("interrupted", 130)
    except (ParameterError, ValueError) as error:
        return end(f"error: {error}", 2)
    except OSError as error:
        return end(f"error: {error.filename or arguments.out} cannot be written: {reason(error)}", 2)
    except (SessionError, NoDomainError) as error:
        return end(f"error: {error}", 1)
    del claim
    return 0


def _first(mode: str, out: Path, folder: Path) -> Path:
    """Write the scenario of the first image; keep its sample next to the results."""
    sample = write_sample(out / "sample")
    content = yaml.safe_load(config(f"{_FIRST[mode]}.yaml").read_text())
    content["/**/afm_sim_node"]["ros__parameters"]["sample"] = sample
    path = folder / f"{_FIRST[mode]}.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def letter(x: _Array, y: _Array) -> NDArray[np.bool_]:
    """Whether places [m] are inside the letter."""
    bars = [(left <= x) & (x <= right) & (low <= y) & (y <= high) for left, right, low, high in _BARS]
    return np.logical_or.reduce(bars)


def second_material(x: _Array, y: _Array) -> NDArray[np.bool_]:
    """Whether places [m] are of the second material: below a line that rises to the right."""
    return np.asarray(x - y > 50e-9)


def write_sample(folder: Path) -> dict[str, object]:
    """Write the maps of the sample.

    Parameters
    ----------
    folder : Path
        Made if it is not there.

    Returns
    -------
    dict
        Parameters `sample.*` of the simulator.
    """
    along = (np.arange(_CELLS) + 0.5) / _CELLS * WIDTH - 0.5 * WIDTH
    # The last row of a map is at the largest y.
    x, y = np.meshgrid(along, along)
    cell = WIDTH / _CELLS
    height = STEP * gaussian_filter(letter(x, y).astype(float), _EDGE / cell)
    strength = np.where(second_material(x, y), STRENGTH, 1.0)
    folder.mkdir(parents=True, exist_ok=True)
    files = {"file": "height.npy", "strength_file": "strength.npy"}
    np.save(folder / files["file"], height)
    np.save(folder / files["strength_file"], gaussian_filter(strength, _BORDER / cell))
    paths = {name: str((folder / file).absolute()) for name, file in files.items()}
    return {"kind": "map", "width": WIDTH, **paths}
