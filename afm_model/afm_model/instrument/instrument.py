"""The virtual instrument: measurement out, drive in, tick by tick, without a clock and without a transport."""

import math
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import address_at, record_at, size
from ..core.errors import DivergenceError, DriveError, ParameterError
from ..parameters import InstrumentParameters
from ..parts.drives_ahead import Command, CommandRecord, problem, three_voltages
from ..parts.header import BlockHeader
from ..parts.part import Channel
from ..parts.signals import PiezoDrive
from .block import Layouts, LoopState, fill_loop, layout_of, line_slots
from .controller import Controller, external_law
from .draws import Draws
from .faults import Faults
from .limit_guard import Guard
from .readings import CLIPPED, STEEP, Readings
from .rows import Block, Cut, Rows
from .runtime_changes import Orders
from .score import ScoreSummary, summarize
from .tick import DIVERGED, DRAW_TICKS, MOVED, RANGE, REFUSED, STOPPED, UNREAD, advance, start
from .wire import Wire

_Array = NDArray[np.float64]
_ZERO_AT_START = (
    *("measurement", "applied", "commanded", "regulated", "effective"),
    *("truth", "detection", "displacement", "score", "asked", "asked_next", "delivery", "read", "drifted"),
    "plant_ledger",
)
"""Records that are empty when a run begins."""
_K, _ROW, _DRAW, _DONE, _RANDOM = (LoopState.names.index(name) for name in ("k", "row", "draw", "done", "random"))


class Instrument(Readings):
    """The microscope between two control ticks.

    Usage: read `measurement`, decide on a drive, call `tick`; when `block_full`, call `take_block`. `measurement` is
    one array that every tick overwrites: copy what you keep.

    Parameters
    ----------
    parameters : InstrumentParameters
    block_ticks : int
        Control ticks in a block.
    hashed : bool
        False: no `trajectory_sha256`, which takes a tenth of the time of a tick of two steps.
    sampled : bool
        False: nobody looks at the samples between two ticks, or at their count beyond the range. They are not made
        where nothing else needs them: what is measured at a tick, and moves, has the same bits.
    layouts : dict, optional
        Where the layouts of instruments with the very same parameters are kept.

    Raises
    ------
    ParameterError
        If the tip does not touch the sample at rest, or the piezo's range does not reach to there.
    """

    def __init__(
        self,
        parameters: InstrumentParameters,
        block_ticks: int = 500,
        *,
        hashed: bool = True,
        sampled: bool = True,
        layouts: Layouts | None = None,
    ) -> None:
        self.parameters = parameters
        try:
            self._layout = layout = layout_of(parameters, layouts)
            self._block = layout.make(parameters)
        except ArithmeticError as error:
            raise ParameterError(f"some parameter is too large or too small to compute with ({error})") from None
        self.channels: tuple[Channel, ...] = layout.channels
        """What the rows of `Block.samples` are."""
        self._block_ticks = block_ticks
        self.samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
        self._draws = Draws(layout, self.samples_per_tick)
        self._state = self._block[layout.places["hashed"] : layout.places["hashed_end"]]
        self._recorded = Rows(block_ticks, self._state.size, len(layout.channels), self.samples_per_tick, hashed=hashed)
        self._loop = layout.array(self._block, "loop").view(np.int64)
        self._commanded = CommandRecord(layout.array(self._block, "commanded"))
        self._voltage: Any = memoryview(self._commanded.voltage)  # type: ignore[arg-type]  # an array is a buffer
        self._horizon_count, self._sequence = self._commanded.horizon_count, self._commanded.sequence
        self.measurement = layout.array(self._block, "measurement")
        self._lost = memoryview(layout.array(self._block, "delivery"))  # type: ignore[arg-type]
        self._faults = Faults(layout, self._block, parameters)
        self.orders = Orders(layout, self._block, parameters)
        """Orders and settings during the run."""
        self.guard = Guard(layout, self._block, parameters)
        """Its own limits."""
        self._external = external_law()
        self._assembled = [each for each in layout.parts.values() if each.in_python]
        loop = layout.record(self._block, "loop")
        fill_loop(loop, parameters)
        loop.quiet = not sampled and self._memoryless(loop)
        self._point_at_arrays()
        self.reset()

    def reset(self) -> None:
        """Return to the start: at rest, in contact, tick 0, the same random numbers again."""
        layout, block, parameters = self._layout, self._block, self.parameters
        self._draws.reset(parameters.plant.seed)
        self._loop[[_K, _ROW, _DRAW, _DONE, CLIPPED, STEEP]] = 0
        for name in _ZERO_AT_START:
            layout.array(block, name)[:] = 0.0
        for family, each in layout.parts.items():
            each.fill_start(block, layout.places[f"{family}_state"], parameters)
        self.orders.reset()
        plant = layout.parts["plant"].part
        constants, state = layout.record(block, "plant_constants"), layout.record(block, "plant_state")
        held = plant.rest(parameters, constants, state, block)  # type: ignore[attr-defined]
        limit = parameters.piezo.limit
        for axis, volts in zip("xyz", held, strict=True):
            if 0.0 < limit < abs(volts):
                raise ParameterError(
                    f"piezo.limit = {limit:g} V is not allowed: to hold the tip at reference.z_r = "
                    f"{parameters.reference.z_r:g} m takes {volts:.4g} V along {axis}"
                )
        for name in ("applied", "regulated", "effective"):
            layout.array(block, name)[:3] = held
        self.guard.reset(layout.array(block, "applied"))
        for family in ("onboard", "piezo"):
            part: Any = layout.parts[family].part
            if part.state.names:
                part.begin(parameters, layout.record(block, f"{family}_state"), held)
        line = layout.places["line"]
        on_their_way = [line + slot * size(PiezoDrive) for slot in range(line_slots(parameters))]
        for command in (layout.places["commanded"], *on_their_way):
            u = record_at(block, command, PiezoDrive)
            u.sequence, u.voltage[:], u.horizon_count = -1, held, 0
        loop = layout.record(block, "loop")
        loop.in_force, loop.received = -1, address_at(block, layout.places["commanded"])
        self._faults.reset()
        self._recorded.reset()
        self.ticks = self._drawn = self._prepared = self._row = 0
        noise, position_noise = self._draws.first()
        start(block, noise, position_noise, np.zeros(max(layout.parts["fault"].part.draws, 1)))
        self._raise_errors()

    def _memoryless(self, loop: LoopState) -> bool:
        """Whether no part does anything at a sample between two ticks that it would not do at the next tick."""
        header = record_at(self._block, 0, BlockHeader)
        sensors, drift = self.record("sensors"), self.record("drift")
        looks = header.program_watch or header.onboard_regulate or self._layout.parts["piezo"].part.state.names
        imperfect = sensors.positions or sensors.deflection or drift.on or self.has_faults
        return bool(loop.update >= loop.substeps and not looks and not imperfect)

    @property
    def has_faults(self) -> bool:
        """Whether any fault is there, now or later."""
        return self._faults.there

    @property
    def unasked(self) -> bool:
        """Whether a fault has lost the measurement of this tick: there is no answer, and `tick(None)` continues."""
        return bool(self._lost[0])

    def set_faults(self, parameters: InstrumentParameters) -> None:
        """Put other faults in force from the next tick on: `parameters` differ from those of now by them alone.

        Raises
        ------
        ParameterError
            If `fault.kind` is not `scheduled`.
        """
        self._faults.put_in_force(parameters)
        # Gains and setpoint of the loop inside may have changed since the start.
        self.parameters = parameters.model_copy(update={"onboard": self.parameters.onboard})
        self._prepared = min(self._drawn, self._faults.until)

    def order(self, order: Any) -> None:
        """Order what the program does from this tick on. Once it is done, `close_loop` stops after that very tick.

        Parameters
        ----------
        order : Order
            Of `afm_model.program.orders`, for the program `verbs`.

        Raises
        ------
        ParameterError
            If `reference.kind` is a program that takes no orders.
        """
        self.orders.put_in_force(order, self.ticks)

    def set_onboard(self, parameters: InstrumentParameters) -> None:
        """Change the loop inside from the next tick on: `parameters` differ from those of now by `onboard`
        and `calibration` alone.

        Raises
        ------
        ParameterError
            If it is another loop.
        """
        self.orders.set_onboard(parameters)
        self.parameters = parameters

    @property
    def recorded_ticks(self) -> int:
        """Ticks in the block up to now."""
        return self._row

    @property
    def block_end(self) -> int:
        """Tick at which the block is full."""
        return self.ticks - self._row + self._block_ticks

    @property
    def block_full(self) -> bool:
        """Whether the block must be taken before the next tick."""
        return self._row == self._block_ticks

    def tick(self, drive: _Array | Command | DriveError | None, sequence: int | None = None) -> bool:
        """Apply a drive for one control period; `measurement` is then that of the next tick.

        True if an order is done with it, or a limit has acted: see `orders` and `guard`.

        With plant.delay_ticks it is applied so many ticks later, and now the one of so many ticks ago.

        Parameters
        ----------
        drive : ndarray (3,) [V], or Command; None: the one commanded last goes on; a DriveError is raised
        sequence : int, optional
            Tick of the measurement that it answers; this one if not given.

        Raises
        ------
        DriveError
            If it is not three numbers, or one of its numbers is NaN or infinite; nothing has moved then.
        DivergenceError
            If the position is beyond RANGE: the loop is unstable, or the step is too coarse for this contact.
        RuntimeError
            If the block is full.
        """
        if self._row == self._block_ticks or self.ticks == self._prepared:
            self._prepare()
        if drive is not None:
            try:
                self._voltage[:] = drive  # an array of three float64, and nothing else
                self._horizon_count[0] = 0
            except (TypeError, ValueError):
                self._write_drive(drive)
            self._sequence[0] = self.ticks if sequence is None else sequence
        outcome: int = advance(self._external, 1.0, self._block)
        return self._counted(outcome, outcome != REFUSED)

    def exchange(self, wire: Wire) -> bool | None:
        """Apply the drive that a peer has sent, and write the next measurement: a `tick` from message to message.

        None, with nothing done, if what came is no plain answer to the measurement that was sent. Raises as `tick`.
        """
        if self._row == self._block_ticks or self.ticks == self._prepared:
            self._prepare()
        outcome: int = advance(wire.block, 1.0, self._block)
        return None if outcome == UNREAD else self._counted(outcome, outcome != REFUSED)

    def _counted(self, outcome: int, ticks: int) -> bool:
        """Count ticks that were made, and report what they came to; whether the last one is the last of an order."""
        self.ticks += ticks
        self._row += ticks
        # At this rate every call is felt.
        if outcome != MOVED or self._assembled:
            self._conclude(outcome)
        return outcome == STOPPED

    def _write_drive(self, drive: Any) -> None:
        """Write what is commanded, whatever it came as: the kernel always gets the same kind of array."""
        if isinstance(drive, DriveError):
            raise drive
        if isinstance(drive, Command):
            self._commanded.write(drive)
        else:
            self._commanded.voltage[:] = three_voltages(drive)
            self._horizon_count[0] = 0

    def close_loop(self, controller: Controller, ticks: int) -> bool:
        """Close the loop with a law for `ticks` ticks, or to the end of the block: `tick` many times, in one piece.

        It ends sooner, and is True, after the tick with which an order is done (`order`) or a limit has acted.
        Raises as `tick`, and PartError if a law in Python has raised something.
        """
        end = self.ticks + min(ticks, max(self._block_ticks - self._row, 1))
        while self.ticks < end:
            due = self.due(end - self.ticks)
            if self.ended(controller, advance(controller.block, float(due), self._block)):
                return True
        return False

    def due(self, ticks: int) -> int:
        """How many ticks, of so many that are wanted, compiled code can make now; prepares them."""
        self._horizon_count[0] = 0
        self._loop[_DONE] = 0
        self._prepare()
        return min(self.ticks + ticks, self._prepared) - self.ticks

    def ended(self, controller: Controller, outcome: int) -> bool:
        """Count the ticks that compiled code has made, and report what they came to, see `close_loop`."""
        controller.raise_errors()
        return self._counted(outcome, int(self._loop[_DONE]))

    def _prepare(self) -> None:
        """What a tick needs: a row in the block, random numbers, the faults of these ticks."""
        if self._row == self._block_ticks:
            raise RuntimeError("the block is full: call take_block before the next tick")
        if self.ticks == self._prepared:
            if self.ticks == self._drawn:
                # Zeros last for ever.
                self._drawn = self._drawn + DRAW_TICKS if self._draws.draw(self.parameters) else sys.maxsize
            if self.ticks == self._faults.until:
                self._faults.renew(self.ticks)
            self._prepared = min(self._drawn, self._faults.until)

    def _conclude(self, outcome: int) -> None:
        """Report what the last tick came to."""
        if self._assembled:
            self._raise_errors()
        if outcome == REFUSED:
            raise DriveError(self._describe_refused())
        if outcome == DIVERGED:
            raise DivergenceError(
                f"the motion diverged (beyond {RANGE:g} m) at {self.time:g} s under a drive of "
                f"{self._commanded.voltage} V, first along {self._diverged_along()}: the loop is unstable, or "
                f"plant.dt = {self.parameters.plant.dt:g} s is too long"
            )

    def _describe_refused(self) -> str:
        """What is wrong with what is commanded."""
        if bad := [f"{axis} = {v} V" for axis, v in zip("xyz", self._voltage, strict=True) if not math.isfinite(v)]:
            return f"drive {', '.join(bad)} is not allowed: every voltage must be a finite number"
        return problem(self._commanded.read())

    def _diverged_along(self) -> str:
        """Axes along which the position is beyond RANGE, or is no number."""
        position = self._layout.record(self._block, "truth").position
        return " and ".join(axis for axis, x in zip("xyz", position, strict=True) if not abs(x) < RANGE)

    def take_block(self) -> Block:
        """The ticks since the last call, at any time; a block may hold fewer ticks than a full one, or none."""
        cut = self.cut_block()
        self.hash_cut()
        return self.block_of(cut)

    def cut_block(self) -> Cut:
        """`take_block` in three pieces, each of some microseconds: what was recorded goes, a new block begins.

        Then `hash_cut`, and `block_of` what was cut off.
        """
        cut = self._recorded.cut(self.ticks - self._row, self._row)
        self._point_at_arrays()
        self._row = self._loop[_ROW] = 0
        return cut

    def _point_at_arrays(self) -> None:
        """Give the compiled loop the addresses of the arrays outside of the block."""
        rows, samples = self._recorded.rows, self._recorded.samples
        self._loop[_RANDOM : _RANDOM + 5] = (
            *(self._draws.numbers.ctypes.data, rows.ctypes.data, rows.shape[1]),
            *(samples.ctypes.data, samples.shape[1]),
        )

    def hash_cut(self) -> None:
        """Hash what was cut off: it counts in `trajectory_sha256` with or without this."""
        self._recorded.hash_cut()

    def block_of(self, cut: Cut) -> Block:
        """The block that was cut off."""
        return self._recorded.block(cut)

    def skip_block(self) -> None:
        """Discard the ticks since the last block: `take_block` without a result."""
        self._recorded.skip(self._row)
        self._row = self._loop[_ROW] = 0

    def trajectory_sha256(self) -> str:
        """SHA-256 over the bytes of the states of all parts at every tick up to now, this one included.

        The law is no part of the instrument: a trajectory has the same hash wherever its law runs.

        Raises
        ------
        RuntimeError
            If the instrument was made with hashed=False.
        """
        return self._recorded.digest(self._row, self._state)

    def score(self) -> ScoreSummary:
        """Score of the run up to now."""
        return summarize(self._block, self._layout.places["score"], self.parameters)

    def _raise_errors(self) -> None:
        for each in self._assembled:
            each.raise_errors()
