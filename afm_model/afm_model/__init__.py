"""Virtual atomic force microscope: contact, friction, plants, control laws. Needs no ROS."""

from importlib.metadata import PackageNotFoundError, version

from .core.errors import DivergenceError, DriveError, ParameterError, PartError, VerbError
from .instrument import Block, Instrument, ScoreSummary
from .instrument.controller import Controller
from .instrument.height_loop import HeightLoop
from .instrument.preview import Preview, preview_reference
from .parameters import (
    ControllerParameters,
    InstrumentParameters,
    SimParameters,
    build,
    changed,
    flatten,
    specifications,
)
from .parameters.scenario import Scenario, ScenarioError, load_scenario
from .parameters.scenario_files import scenario_names
from .parts.drives_ahead import Command
from .run.simulation import Simulation, simulate
from .studies import Comparison, compare
from .studies.many import simulate_many
from .studies.scatter import SweepError
from .studies.sweep import sweep

try:
    __version__ = version("afm_model")
except PackageNotFoundError:  # run from its sources
    __version__ = "unknown"

__all__ = [
    "Block",
    "Command",
    "Comparison",
    "Controller",
    "ControllerParameters",
    "DivergenceError",
    "DriveError",
    "HeightLoop",
    "Instrument",
    "InstrumentParameters",
    "ParameterError",
    "PartError",
    "Preview",
    "Scenario",
    "ScenarioError",
    "ScoreSummary",
    "SimParameters",
    "Simulation",
    "SweepError",
    "VerbError",
    "build",
    "changed",
    "compare",
    "flatten",
    "load_scenario",
    "preview_reference",
    "scenario_names",
    "simulate",
    "simulate_many",
    "specifications",
    "sweep",
]
