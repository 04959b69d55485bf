"""Virtual atomic force microscope: contact, friction, plants, control laws. Needs no ROS."""

from .control import Controller
from .errors import ParameterError
from .instrument import Block, DivergenceError, DriveError, Instrument, ScoreSummary
from .parameters import ControllerParameters, InstrumentParameters, SimParameters, build, flatten, specifications
from .scenario import Scenario, ScenarioError, load_scenario
from .simulate import Simulation, simulate
from .sweep import SweepError, sweep

__all__ = [
    "Block",
    "Controller",
    "ControllerParameters",
    "DivergenceError",
    "DriveError",
    "Instrument",
    "InstrumentParameters",
    "ParameterError",
    "Scenario",
    "ScenarioError",
    "ScoreSummary",
    "SimParameters",
    "Simulation",
    "SweepError",
    "build",
    "flatten",
    "load_scenario",
    "simulate",
    "specifications",
    "sweep",
]
