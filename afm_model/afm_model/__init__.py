"""Virtual atomic force microscope: contact, friction, plants, control laws. Needs no ROS."""

from importlib.metadata import PackageNotFoundError, version

from .command import Command
from .comparing import Comparison, compare
from .controller import Controller
from .errors import DivergenceError, DriveError, ParameterError, PartError, VerbError
from .instrument import Block, Instrument, ScoreSummary
from .parameters import ControllerParameters, InstrumentParameters, SimParameters, build, flatten, specifications
from .scenario import Scenario, ScenarioError, load_scenario
from .shipped import scenario_names
from .simulation import Simulation, simulate
from .sweeping import SweepError, sweep

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
    "Instrument",
    "InstrumentParameters",
    "ParameterError",
    "PartError",
    "Scenario",
    "ScenarioError",
    "ScoreSummary",
    "SimParameters",
    "Simulation",
    "SweepError",
    "VerbError",
    "build",
    "compare",
    "flatten",
    "load_scenario",
    "scenario_names",
    "simulate",
    "specifications",
    "sweep",
]
