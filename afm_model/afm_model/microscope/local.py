"""A microscope in this process: time passes while a verb is being done, and stands still in between."""

import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any

from ..core.errors import ParameterError, VerbError
from ..core.schema import Value
from ..instrument import Instrument
from ..instrument.controller import Controller
from ..law import require_plant, timing_disagreements, warn_of_timing
from ..parameters import ControllerParameters, InstrumentParameters, changed
from ..run.context import RunContext
from ..run.engine import Engine
from ..run.pacing import Compiled, Pacing
from ..run.state import RunState
from .backend import Backend, OnLine, OnProgress
from .collect import Reading
from .image import Line
from .interrupts import Interrupted, Interrupts
from .operator import Operator, ignore
from .prepare import with_verbs
from .results import CANCELLED, MicroscopeState, Outcome
from .verb import Verb
from .verbs import Withdraw

_BLOCK_SAMPLES = 20_000
"""Samples of a block: some hundred milliseconds of computing between two looks."""
_PAUSED = 0.05
"""Wall time between two looks in a pause [s]."""


class Local(Backend):
    """An instrument with a law along x and y, and verbs.

    Parameters
    ----------
    parameters : InstrumentParameters
        What verbs need is added: see `with_verbs`.
    controller : ControllerParameters
        The law that moves x and y.
    block_ticks : int, optional
        Control ticks between two looks at what is measured. It changes no result.
    hashed : bool
        As of Instrument.

    Warns
    -----
    TimingWarning
        If the law is made for another control period or delay than those of the plant.

    Raises
    ------
    ParameterError
        As `with_verbs` and `Instrument` do; if the law has a model of friction that is not that of the plant.
    """

    _lock: AbstractContextManager[Any] = nullcontext()
    """Held while engine and operator are used; here nobody else uses them."""
    _clock: Callable[[], float] | None = None
    """Wall time [s]; None: the run does not look at it."""

    def __init__(
        self,
        parameters: InstrumentParameters,
        controller: ControllerParameters,
        *,
        block_ticks: int | None = None,
        hashed: bool = False,
    ) -> None:
        parameters = with_verbs(parameters)
        require_plant(controller, parameters.plant)
        warn_of_timing(timing_disagreements(controller.law, parameters), stacklevel=3)
        self._controller, self._given_ticks, self._hashed = controller, block_ticks, hashed
        self._going, self._stopped, self._stay = threading.Event(), False, False
        self._going.set()
        self._begin(parameters)

    def _begin(self, parameters: InstrumentParameters) -> None:
        per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
        self.engine = Engine(
            parameters,
            self._pacing,
            clock=self._clock,
            block_ticks=self._given_ticks or max(1, _BLOCK_SAMPLES // per_tick),
            operate=self._operate,
            hashed=self._hashed,
        )
        self.engine.step()

    def _pacing(self, context: RunContext) -> Pacing:
        return Compiled(context, Controller(self._controller), by_clock=True)

    def _operate(self, instrument: Instrument) -> Operator:
        self.operator = Operator(instrument)
        return self.operator

    @property
    def instrument(self) -> Instrument:
        """Another one after `exchange`."""
        return self.engine.instrument

    @property
    def state(self) -> MicroscopeState:
        """See `Backend`."""
        return self.operator.state

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.instrument.time

    def objection(self, verb: Verb) -> str:
        """See `Backend`."""
        return self.operator.objection(verb)

    def execute(self, verb: Verb, on_progress: OnProgress | None = None, on_line: OnLine | None = None) -> Outcome:
        """See `Backend`. Whatever breaks the verb off, the tip is withdrawn, and `outcome` has what was measured.

        Raises
        ------
        Interrupted
            After Ctrl-C.
        BaseException
            What `on_progress` or `on_line` has raised.
        """
        operator, lines = self.operator, list[Line]()
        operator.on_line, call = lines.append, on_line or ignore
        self.outcome, self._stopped = None, False
        with self._lock:
            self.engine.begin(verb)
        with Interrupts() as interrupts:
            try:
                while operator.busy:
                    if self._going.wait(_PAUSED):
                        self.step()
                    # Between two steps: what they raise leaves no block half collected.
                    for line in lines:
                        call(line)
                    lines.clear()
                    if on_progress is not None:
                        on_progress(operator.progress)
                    if interrupts.there or self._stopped:
                        self._going.set()
                        with self._lock:
                            operator.cancel(
                                "interrupted" if interrupts.there else "stopped",
                                stay=self._stay and not interrupts.there,
                            )
                if interrupts.there or (self._stopped and not self._stay):
                    self._end()
            except BaseException:
                self._end()
                raise
            finally:
                self._going.set()
        self.outcome = self.outcome or operator.outcome()
        if interrupts.there:
            raise Interrupted(self.outcome)
        return self.outcome

    def _end(self) -> None:
        """Bring a verb to its end, and the tip to a safe place, also where it has just come to its end by itself."""
        operator = self.operator
        operator.on_line = ignore
        with self._lock:
            operator.cancel("stopped by an error")
        try:
            self._wait()
        finally:
            self.outcome = operator.outcome()
        if self._withdraw():
            self.outcome = replace(
                self.outcome, status=CANCELLED, message="the verb was stopped at its end; the tip is withdrawn"
            )

    def _withdraw(self) -> bool:
        """Take the tip away if it is near and time can go on; after a fault nothing moves any more."""
        if not (self.state.near and self.engine.ticking):
            return False
        with self._lock:
            self.engine.begin(Withdraw())
        self._wait()
        return True

    def _wait(self) -> None:
        while self.operator.busy:
            self.step()

    def stop(self, *, stay: bool = False) -> None:
        """See `Backend`."""
        self._stay = stay
        self._stopped = True

    def read_signals(self, *names: str) -> dict[str, Reading]:
        """See `Backend`."""
        return self.operator.read_signals(*names)

    def pause(self) -> None:
        """See `Backend`."""
        if not self.operator.busy:
            raise VerbError("nothing is being done: there is nothing to pause")
        self._going.clear()

    def step(self) -> None:
        """Go on to the end of a block, or of an order; for who does not want to wait for a whole verb."""
        self.engine.step()
        if self.engine.error is not None:
            raise self.engine.error

    def resume(self) -> None:
        """See `Backend`."""
        if not self._going.is_set():
            self._going.set()
            return
        if self.engine.state != RunState.WITHDRAWN:
            raise VerbError(f"the run is {self.engine.state.title}: there is nothing to resume")
        if problem := self.engine.bring_back():
            raise VerbError(problem)

    def set_loop(self, **settings: Any) -> None:
        """See `Backend`."""
        with self._lock:
            self.operator.set_loop(**settings)

    def exchange(self, group: str, changes: Mapping[str, Value]) -> None:
        """Another sample, probe, detector or piezo; see `exchanged`."""
        with self._lock:
            self._begin(exchanged(self.instrument.parameters, self.state, group, changes))

    def close(self) -> None:
        """See `Backend`."""
        with self._lock:
            self.operator.cancel()
        self._wait()
        self._withdraw()


_OF_THE_LOOP = ("control_period", "delay_ticks", "seed")
"""Parameters of the group `plant` that belong to the control loop and to the run."""


def exchanged(parameters: Any, state: MicroscopeState, group: str, changes: Mapping[str, Value]) -> Any:
    """Parameters with another sample or probe.

    Parameters
    ----------
    parameters : InstrumentParameters
    state : MicroscopeState
    group : str
        sample, plant, detector or piezo.
    changes : mapping
        Names without the group; with another `kind` as in `afm_model.changed`.

    Raises
    ------
    VerbError
        If the tip is not withdrawn, or something is being done.
    ParameterError
        If a name or value is not allowed.
    """
    what = "probe" if group == "plant" else group
    if state.near or state.doing:
        raise VerbError(f"another {what} is not allowed while the tip may touch the sample: withdraw it first")
    if group == "plant" and (others := [name for name in _OF_THE_LOOP if name in changes]):
        raise ParameterError(
            f"plant.{others[0]} is no property of a probe: it is chosen with the scenario, when the instrument starts"
        )
    news = {f"{group}.{name}": value for name, value in changes.items()}
    # What was calibrated belongs to the probe of before.
    return changed(parameters, news, afresh=["calibration"] * (group == "plant"))
