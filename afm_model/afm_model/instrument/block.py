"""The instrument's memory: one float64 array, laid out from the records of the chosen parts.

In order: the header, which has the places of everything else; the loop's own record; constants of the parts; what is
recorded of a tick (states of the parts, measurement, applied drive); what travels inside a tick; sums of the score;
places of the channels; the line of drives on their way; the maps of sample and plant, and its ledger.
"""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import Record, place, record_at, size
from ..core.errors import ParameterError, PartError
from ..parameters import InstrumentParameters
from ..parts.assembly import Assembled, assembled
from ..parts.channels import OPTIONAL, STANDARD
from ..parts.header import BlockHeader
from ..parts.part import Channel
from ..parts.signals import (
    Actuation,
    Delivery,
    Detection,
    Displacement,
    Drive,
    Measurement,
    PiezoDrive,
    Setpoint,
    Surface,
    Truth,
)
from .drift import DriftConstants, DriftState, drift_constants
from .limits import GuardState, LimitConstants
from .score import ScoreSums
from .sensors import SensorConstants, SensorState, sensor_constants

FAMILIES = ("plant", "detector", "piezo", "onboard", "sample", "program", "fault")
"""Families inside the instrument, in the order of their states in the hash: that of the plant comes first."""
GROUPS = {family: "reference" if family == "program" else family for family in FAMILIES}
"""Group of parameters in which a part is chosen."""


class LoopState(Record):
    k: int  # control tick since the start
    row: int  # its row in the block that is recorded
    draw: int  # its row in the random numbers
    done: int  # ticks done in the last call
    substeps: int  # integration steps in a control period
    stride: int  # integration steps in a period of the virtual ADC
    quiet: int  # whether of the samples of a tick the first alone is made, see `Instrument`
    update: int  # integration steps between two updates of the DAC
    delay: int  # control periods from a command to the piezo
    clipped: int  # updates of the drive since the start that were beyond its range
    steep: int  # that were steeper than the slew limit
    in_force: int  # measurement that the drive in force answers
    received: int  # address of the command that has arrived last
    score_tick: int  # first tick that is scored
    control_period: Annotated[float, "s"]
    dac_period: Annotated[float, "s"]
    period_ns: Annotated[float, "ns"]  # the same
    sample_period: Annotated[float, "s"]  # of the virtual ADC
    drive_lsb: Annotated[float, "V"]
    drive_limit: Annotated[float, "V"]
    slew_step: float  # largest change at an update [V]; 0: any
    deflection_sensitivity: Annotated[float, "m/V"]
    lateral_sensitivity: Annotated[float, "N/V"]
    halt: int  # index of a number that stops ticking when it is not 0; 0: none
    random: int  # address of the random numbers, see Draws
    rows: int  # of what is recorded: states of the parts and measurement at tick k, drive applied from it on
    width: int  # numbers in a row
    samples: int  # of the samples, (channels, columns)
    columns: int
    # What a tick keeps until its end.
    command: int  # address of the command in force
    column: int  # of the newest sample
    noise: int  # next numbers of the detector and of the position sensors
    position_noise: int
    next_update: int  # integration step of the next update of the DAC
    z_given: int  # whether a limit has z
    phase: int  # of the guard before the tick


class Layout:
    """Places of all records in the block of an instrument with these parameters.

    Raises
    ------
    ParameterError
        If a part is not known, or a channel.
    PartError
        If a part cannot be compiled.
    """

    kept: NDArray[np.float64] | None = None
    """A block as it was made, for further instruments."""

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
        self._records: dict[str, tuple[int, type[Record]]] = {}
        self._end = size(BlockHeader)
        self._add("loop", LoopState)
        for family, each in self.parts.items():
            self.places |= each.places
            self._add(f"{family}_constants", each.part.constants)
        self.places["hashed"] = self._end
        for family, each in self.parts.items():
            if each.part.recorded:
                self._add(f"{family}_state", each.part.state)
        self.places["hashed_end"] = self._end
        self._add("measurement", Measurement)
        self._add("applied", Drive)
        for name in ("regulated", "effective"):
            self._add(name, Actuation)
        self._add("commanded", PiezoDrive)
        self.places["received"] = 0
        self._add("asked", Setpoint)
        self._add("asked_next", Setpoint)
        self._add("truth", Truth)
        self._add("detection", Detection)
        self._add("surface", Surface)
        self._add("displacement", Displacement)
        self._add("delivery", Delivery)
        self._add("score", ScoreSums)
        self._add("sensors", SensorConstants)
        self._add("read", SensorState)
        self._add("drift", DriftConstants)
        self._add("drifted", DriftState)
        self._add("limits", LimitConstants)
        self._add("guard", GuardState)
        self.channels = self._channels(parameters)
        self.places["channel_count"] = len(self.channels)
        self.places["channels"] = self._reserve(len(self.channels))
        self.places["line"] = self._reserve(line_slots(parameters) * size(PiezoDrive))
        self._map = _map_of(self.parts["sample"], parameters)
        self.places["sample_map"] = self._reserve(self._map.size)
        self._plant_map = _map_of(self.parts["plant"], parameters)
        self.places["plant_map"] = self._reserve(self._plant_map.size)
        self._add("plant_ledger", plant.ledger)
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

    def _add(self, name: str, record: type[Record]) -> None:
        self.places[name] = self._reserve(size(record))
        self._records[name] = (self.places[name], record)

    def _channels(self, parameters: InstrumentParameters) -> tuple[Channel, ...]:
        known = {channel.name: channel for channel in (*STANDARD, *OPTIONAL)}
        for family, each in self.parts.items():
            known |= {
                channel.name: Channel(channel.name, channel.unit, _field(family, each.part, channel), channel.scale)
                for channel in each.part.channels
            }
        wanted = [name.strip() for name in parameters.detector.channels.split(",") if name.strip()]
        if unknown := [name for name in wanted if name not in known]:
            raise ParameterError(
                f"detector.channels = {parameters.detector.channels} is not allowed: there is no channel "
                f"{', '.join(unknown)}; there are {', '.join(known)}"
            )
        standard = [channel.name for channel in STANDARD]
        return tuple(known[name] for name in dict.fromkeys([*standard, *wanted]))

    def place(self, field: str) -> int:
        """Index of the number `record.field`, or `record.vector.x`."""
        name, *path = field.split(".")
        start, record = self._records[name]
        if path[0] not in record.names:
            raise PartError(f"{name} has no field {path[0]}: it has {', '.join(record.names)}")
        return start + place(record, path[0]) + ("xyz".index(path[1]) if len(path) > 1 else 0)

    def make(self, parameters: InstrumentParameters) -> NDArray[np.float64]:
        """A block with header, constants and map; everything else is zero."""
        if self.kept is not None:
            return self.kept.copy()
        block = np.zeros(self.size)
        header = record_at(block, 0, BlockHeader)
        for name in BlockHeader.names:
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
        start, record = self._records[name]
        return block[start : start + size(record)]


Layouts = dict[int, tuple[InstrumentParameters, Layout]]
"""By the identity of the parameters."""


def layout_of(parameters: InstrumentParameters, layouts: Layouts | None) -> Layout:
    """Layout of an instrument: the one that is kept for the very same parameters, or a new one, which is kept then."""
    if layouts is None:
        return Layout(parameters)
    known = layouts.get(id(parameters))
    if known is None:
        layout = Layout(parameters)
        # A part in Python keeps what it has raised.
        if not any(each.in_python for each in layout.parts.values()):
            layout.kept = layout.make(parameters)
            layouts[id(parameters)] = parameters, layout
        return layout
    return known[1]


def fill_loop(c: LoopState, parameters: InstrumentParameters) -> None:
    """Write the constants of the compiled loop itself into its record."""
    plant, detector, piezo = parameters.plant, parameters.detector, parameters.piezo
    c.substeps = plant.substeps
    c.stride = round(detector.sample_period / plant.dt)
    dac_period = piezo.dac_period or plant.control_period
    c.update = round(dac_period / plant.dt)
    c.dac_period = dac_period
    c.delay = plant.delay_ticks
    c.score_tick = parameters.score_tick
    c.control_period = plant.control_period
    c.period_ns = plant.control_period * 1e9
    c.sample_period = detector.sample_period
    c.drive_lsb = 2.0 * piezo.limit / 2**piezo.dac_bits if piezo.dac_bits > 0 else 0.0
    c.drive_limit = piezo.limit
    c.slew_step = piezo.slew_limit * dac_period
    c.deflection_sensitivity = detector.deflection_sensitivity
    c.lateral_sensitivity = detector.lateral_sensitivity


def line_slots(parameters: InstrumentParameters) -> int:
    """Places in the line of commands on their way: one for each, and one for the newest."""
    delay = parameters.plant.delay_ticks
    return delay + 1 if delay else 0


def _field(family: str, part: Any, channel: Channel) -> str:
    """A channel of a part, as `Layout.place` finds it: of its state, or of the ledger of a plant."""
    of_ledger = family == "plant" and channel.field in part.ledger.names
    return f"{family}_{'ledger' if of_ledger else 'state'}.{channel.field}"


def _map_of(each: Assembled, parameters: InstrumentParameters) -> NDArray[np.float64]:
    """Map of a sample or plant, or none."""
    make = getattr(each.part, "map", None)
    if make is None:
        return np.zeros(0)
    return np.ascontiguousarray(make(parameters), np.float64).reshape(-1)
