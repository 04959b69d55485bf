"""The instrument's memory: one float64 array, laid out from the records of the chosen parts.

In order: the header, which tells where everything else stands; the loop's own record; constants of the parts; what is
recorded of a tick (states of the parts, measurement, applied drive); what travels inside a tick; sums of the score;
places of the channels; the line of drives on their way; the maps of sample and plant.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import ParameterError, PartError
from ..core.records import place, record, record_at, size
from ..parameters import InstrumentParameters
from ..parts.assembly import Assembled, assembled
from ..parts.channels import OPTIONAL, STANDARD
from ..parts.header import HEADER
from ..parts.part import Channel
from ..parts.signals import (
    ACTUATION,
    COMMAND,
    DELIVERY,
    DETECTION,
    DISPLACEMENT,
    DRIVE,
    MEASUREMENT,
    REFERENCE,
    SURFACE,
    TRUTH,
)
from .drift import DRIFT, DRIFTED, drift_constants
from .limits import GUARD, LIMITS
from .score import SUMS
from .sensors import READ, SENSORS, sensor_constants

FAMILIES = ("plant", "detector", "piezo", "onboard", "sample", "program", "fault")
"""Families inside the instrument, in the order of their states in the hash: that of the plant comes first."""
GROUPS = {family: "reference" if family == "program" else family for family in FAMILIES}
"""Group of parameters in which a part is chosen."""

LOOP = record(
    "k",  # control tick since the start
    "row",  # its row in the block that is recorded
    "draw",  # its row in the random numbers
    "done",  # ticks done in the last call
    "substeps",  # integration steps in a control period
    "stride",  # integration steps in a period of the virtual ADC
    "update",  # integration steps between two updates of the DAC
    "delay",  # control periods from a command to the piezo
    "clipped",  # updates of the drive since the start that were beyond its range
    "steep",  # that were steeper than the slew limit
    "in_force",  # measurement that the drive in force answers
    "received",  # address of the command that has arrived last
    "score_tick",  # first tick that is scored
    "control_period",  # [s]
    "dac_period",  # [s]
    "period_ns",  # the same [ns]
    "sample_period",  # of the virtual ADC [s]
    "drive_lsb",  # [V]
    "drive_limit",
    "slew_step",  # largest change at an update [V]; 0: any
    "deflection_sensitivity",  # [m/V]
    "lateral_sensitivity",  # [N/V]
    "halt",  # where in the block the number stands with which ticking stops unless it is 0; 0: nowhere
    integers=(
        "k",
        "row",
        "draw",
        "done",
        "substeps",
        "stride",
        "update",
        "delay",
        "clipped",
        "steep",
        "in_force",
        "received",
        "score_tick",
        "halt",
    ),
)


class Layout:
    """Where everything stands in the block of an instrument with these parameters.

    Raises
    ------
    ParameterError
        If a part is not known, or a channel.
    PartError
        If a part cannot be compiled.
    """

    def __init__(self, parameters: InstrumentParameters) -> None:
        self.parts: dict[str, Assembled] = {
            family: assembled(family, getattr(parameters, GROUPS[family]).kind) for family in FAMILIES
        }
        onboard: Any = self.parts["onboard"].part
        plant: Any = self.parts["plant"].part
        if onboard.excites and not plant.takes_excitation:
            raise ParameterError(
                f"onboard.kind = {parameters.onboard.kind} is not allowed with plant.kind = {parameters.plant.kind}, "
                f"whose cantilever cannot be excited: take plant.kind = lever"
            )
        self.places: dict[str, int] = {}
        self._records: dict[str, tuple[int, np.dtype[Any]]] = {}
        self._end = size(HEADER)
        self._add("loop", LOOP)
        for family, each in self.parts.items():
            self.places |= each.places
            self._add(f"{family}_constants", each.part.constants)
        self.places["hashed"] = self._end
        for family, each in self.parts.items():
            if each.part.recorded:
                self._add(f"{family}_state", each.part.state)
        self.places["hashed_end"] = self._end
        self._add("measurement", MEASUREMENT)
        self._add("applied", DRIVE)
        for name in ("regulated", "effective"):
            self._add(name, ACTUATION)
        self._add("commanded", COMMAND)
        self.places["received"] = 0
        self._add("asked", REFERENCE)
        self._add("asked_next", REFERENCE)
        self._add("truth", TRUTH)
        self._add("detection", DETECTION)
        self._add("surface", SURFACE)
        self._add("displacement", DISPLACEMENT)
        self._add("delivery", DELIVERY)
        self._add("score", SUMS)
        self._add("sensors", SENSORS)
        self._add("read", READ)
        self._add("drift", DRIFT)
        self._add("drifted", DRIFTED)
        self._add("limits", LIMITS)
        self._add("guard", GUARD)
        self.channels = self._channels(parameters)
        self.places["channel_count"] = len(self.channels)
        self.places["channels"] = self._reserve(len(self.channels))
        self.places["line"] = self._reserve(line_slots(parameters) * size(COMMAND))
        self._map = _map_of(self.parts["sample"], parameters)
        self.places["sample_map"] = self._reserve(self._map.size)
        self._plant_map = _map_of(self.parts["plant"], parameters)
        self.places["plant_map"] = self._reserve(self._plant_map.size)
        for family, each in self.parts.items():
            if not each.part.recorded:
                self._add(f"{family}_state", each.part.state)
        self.size = self._end
        # A row of the random numbers.
        draws = {family: each.part.draws for family, each in self.parts.items()}
        samples = round(parameters.plant.control_period / parameters.detector.sample_period)
        widths = {
            "disturbance": draws["plant"],
            "position_noise": 3 * samples,
            "noise": 2 * samples,
            "faults": draws["fault"],
        }
        widths["wander"] = 3
        self.draws = 0
        for name, width in widths.items():
            self.places[name] = self.draws
            self.draws += width
        self.places["draws"] = self.draws

    def _reserve(self, count: int) -> int:
        index, self._end = self._end, self._end + count
        return index

    def _add(self, name: str, dtype: np.dtype[Any]) -> None:
        self.places[name] = self._reserve(size(dtype))
        self._records[name] = (self.places[name], dtype)

    def _channels(self, parameters: InstrumentParameters) -> tuple[Channel, ...]:
        known = {channel.name: channel for channel in OPTIONAL}
        for family, each in self.parts.items():
            known |= {
                channel.name: Channel(channel.name, channel.unit, f"{family}_state.{channel.field}", channel.scale)
                for channel in each.part.channels
            }
        wanted = [name.strip() for name in parameters.detector.channels.split(",") if name.strip()]
        if unknown := [name for name in wanted if name not in known]:
            raise ParameterError(
                f"detector.channels = {parameters.detector.channels} is not allowed: there is no channel "
                f"{', '.join(unknown)}; there are {', '.join(known)}"
            )
        return (*STANDARD, *(known[name] for name in dict.fromkeys(wanted)))

    def place(self, field: str) -> int:
        """Where the number `record.field`, or `record.vector.x`, stands."""
        name, *path = field.split(".")
        start, dtype = self._records[name]
        if path[0] not in (dtype.names or ()):
            raise PartError(f"{name} has no field {path[0]}: it has {', '.join(dtype.names or ())}")
        return start + place(dtype, path[0]) + ("xyz".index(path[1]) if len(path) > 1 else 0)

    def make(self, parameters: InstrumentParameters) -> NDArray[np.float64]:
        """A block with header, constants and map; everything else is zero."""
        block = np.zeros(self.size)
        header = record_at(block, 0, HEADER)
        for name in HEADER.names or ():
            header[name] = self.places[name]
        for family, each in self.parts.items():
            each.fill_constants(block, self.places[f"{family}_constants"], parameters)
        for name, values in (("sensors", sensor_constants(parameters)), ("drift", drift_constants(parameters))):
            fields = self.record(block, name)
            for field, value in values.items():
                fields[field] = value
        for number, channel in enumerate(self.channels):
            block[self.places["channels"] + number] = self.place(channel.field)
        block[self.places["sample_map"] : self.places["sample_map"] + self._map.size] = self._map
        block[self.places["plant_map"] : self.places["plant_map"] + self._plant_map.size] = self._plant_map
        return block

    def record(self, block: NDArray[np.float64], name: str) -> Any:
        """A record of the block by name."""
        return record_at(block, *self._records[name])

    def array(self, block: NDArray[np.float64], name: str) -> NDArray[np.float64]:
        """The numbers of a record."""
        start, dtype = self._records[name]
        return block[start : start + size(dtype)]


def line_slots(parameters: InstrumentParameters) -> int:
    """Places in the line of commands on their way: one for each, and one for the newest."""
    delay = parameters.plant.delay_ticks
    return delay + 1 if delay else 0


def _map_of(each: Assembled, parameters: InstrumentParameters) -> NDArray[np.float64]:
    """Map of a sample or plant, or none."""
    make = getattr(each.part, "map", None)
    if make is None:
        return np.zeros(0)
    return np.ascontiguousarray(make(parameters), np.float64).reshape(-1)
