"""The microscope as the commands of the table see it."""

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from afm_model import InstrumentParameters
from afm_model.core.errors import ParameterError, VerbError
from afm_model.microscope import Microscope, MicroscopeState
from afm_model.microscope.collect import Reading

from .codec import ProtocolError
from .handlers import HANDLERS
from .jobs import Jobs
from .scan_state import ScanState
from .settings import Settings
from .signal_index import Signals
from .spectrum_state import SpectrumState
from .stored import Numbers
from .stream import Stream
from .table import COMMANDS, DONE, STORED, CommandRow, Field

_TRAVEL = 500e-6
"""Of a scanner without a limit, to each side [m]."""


class Front:
    """A microscope, and what clients have set.

    Parameters
    ----------
    microscope : Microscope
        Does verbs.
    parameters : InstrumentParameters
        Of its instrument, at the start.
    folder : Path
        For files.
    asked : Microscope, optional
        For settings and signals, used under a lock: of a microscope on topics a second connection, as the first one is
        busy with a verb. Without, `microscope`, which may be used from any thread then.
    """

    def __init__(
        self,
        microscope: Microscope,
        parameters: InstrumentParameters,
        folder: Path,
        asked: Microscope | None = None,
    ) -> None:
        self.microscope, self.parameters, self.folder = microscope, parameters, folder
        self._asked = asked or microscope
        self._asking: AbstractContextManager[Any] = nullcontext() if asked is None else threading.Lock()
        self.settings, self.numbers = Settings(), Numbers()
        self.jobs = Jobs(lambda: microscope.stop(stay=True))
        piezo, loop = parameters.piezo, parameters.onboard
        travel = [piezo.limit * getattr(piezo, f"sensitivity_{axis}") or _TRAVEL for axis in "xyz"]
        low, high = max(getattr(loop, "low", -travel[2]), -travel[2]), min(getattr(loop, "high", travel[2]), travel[2])
        self.widest = (-low, -high)
        """Largest and least Z of the instrument [m]."""
        self.z_limits = self.widest
        self.limited = False
        self.ranges = [2.0 * travel[0], 2.0 * travel[1], high - low]
        """Full travel [m]."""
        self._was_on = False
        self.engaging = False
        """Whether an approach was begun by switching the controller on."""
        scanner: Any = parameters.plant.scanner_numbers or parameters.scanner
        self.resonance = float(min(scanner.f_x, scanner.f_y))
        self.signals = Signals(self.read, self.settings)
        self.scan, self.stream = ScanState(), Stream(self.signals.values)
        self.spectra = {"ZSpectr": SpectrumState(128), "BiasSpectr": SpectrumState(128)}
        self.follow_speed, self.own_speed = 2e-6, True
        self.setpoint: tuple[float, Any] = (math.nan, None)
        """As it was set last, in the unit of the controller; and what it was then [V], with the unit."""
        self.gains: tuple[float, float, float] | None = None
        """As they were set last."""
        self.asked_limits: tuple[float, float] | None = None
        """Of Z, as they were set last."""

    def read(self, *names: str) -> dict[str, Reading]:
        """Read signals as they are now."""
        with self._asking:
            return self._asked.read_signals(*names)

    @property
    def state(self) -> MicroscopeState:
        """Where the microscope stands."""
        with self._asking:
            return self._asked.state

    @property
    def z(self) -> float:
        """Z [m], larger = farther from the sample."""
        return 0.0 - self.read("z")["z"].value

    @property
    def follows(self) -> bool:
        """Whether Z is left to the loop, whose feedback may be held: the tip is not withdrawn."""
        state = self.state
        # A withdrawal, whatever its reason, leaves the feedback off.
        self._was_on = state.approached or (self._was_on and state.feedback != "off")
        return self._was_on

    @contextmanager
    def setting(self) -> Iterator[Microscope]:
        """Set something: what is refused is an error of the protocol."""
        with self._asking:
            try:
                yield self._asked
            except (ParameterError, VerbError) as error:
                raise ProtocolError(str(error)) from None

    def do(self, verb: Any, **fields: Any) -> Any:
        """Do a verb, in the thread of the jobs; its result as plain arrays."""
        return self.microscope.measure(verb, **fields)

    def serve(self, command: CommandRow, arguments: Sequence[Any]) -> Sequence[Any]:
        """Do a command; the values of its response.

        Raises
        ------
        ProtocolError
            If it is refused: the text of the error.
        """
        if command.how in STORED:
            return self.settings.serve(command, arguments)
        if command.how == DONE:
            return [field.empty for field in command.returns]
        filled = [*arguments, *(_left_out(field) for field in command.arguments[len(arguments) :])]
        try:
            return HANDLERS[command.name](self, *filled)
        except (ParameterError, VerbError) as error:
            raise ProtocolError(str(error)) from None

    def kept(self, name: str, *indices: Any) -> list[Any]:
        """Values of a setting that is stored, by the name of its Get."""
        return self.settings.of(COMMANDS[name], indices)

    def free_path(self, base: str, digits: int, suffix: str) -> Path:
        """Path of a file with the next free number after its base name."""
        ends = (path.stem[len(base) :] for path in self.folder.glob(f"{base}*{suffix}"))
        number = 1 + max((int(end) for end in ends if end.isdigit()), default=0)
        return self.folder / f"{base}{number:0{digits}d}{suffix}"

    def close(self) -> None:
        """End what is being done; the microscope is closed by who has opened it."""
        self.stream.close()
        self.jobs.close()


def _left_out(field: Field) -> Any:
    """What an argument means that a client leaves out: as it is, where there is a value for that."""
    if field.keep is None:
        return field.empty
    return field.keep if field.type in "Sfd" else int(field.keep) if math.isfinite(field.keep) else field.keep
