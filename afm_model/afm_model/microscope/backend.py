"""What carries out verbs: an instrument in this process (`local`), or one that runs somewhere else."""

from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from ..core.schema import Value
from .image import Line
from .results import MicroscopeState, Outcome, Progress
from .verb import Verb

OnProgress = Callable[[Progress], None]
OnLine = Callable[[Line], None]


class Backend(Protocol):
    """Carries out verbs, one after the other."""

    def execute(self, verb: Verb, on_progress: OnProgress | None = None, on_line: OnLine | None = None) -> Outcome:
        """Do a verb and wait for its end.

        Parameters
        ----------
        verb : Verb
        on_progress, on_line : callable, optional
            Called now and then with how far it is, and with every line of a scan.

        Raises
        ------
        VerbError
            If it cannot be begun: one sentence why.
        """
        ...

    def objection(self, verb: Verb) -> str:
        """Why a verb cannot be begun now, one sentence; empty if it can."""
        ...

    @property
    def state(self) -> MicroscopeState:
        """Where the microscope stands."""
        ...

    def set_setpoint(self, *, force: float = 0.0, voltage: float = 0.0) -> None:
        """Setpoint of the deflection, as force of the cantilever [N] or as voltage [V]."""
        ...

    def set_gains(self, proportional: float | None = None, integral: float | None = None) -> None:
        """Gains of the z loop, P [m/V] and I [m/(V s)]; None: as it is."""
        ...

    def set_feedback(self, mode: Literal["on", "hold", "off", "external"]) -> None:
        """What the z loop does with an approached tip."""
        ...

    def resume(self) -> None:
        """Give the loop back its z behind a withdrawal by a limit (`safety.*`): the tip is withdrawn, not approached.

        Raises
        ------
        VerbError
            If no limit has withdrawn the sample, or one is still passed.
        """
        ...

    def set_sample(self, changes: Mapping[str, Value]) -> None:
        """Another sample, by parameters `sample.*` without their prefix; only with the tip withdrawn.

        Time begins anew.
        """
        ...

    def set_probe(self, changes: Mapping[str, Value]) -> None:
        """Another cantilever, by parameters `plant.*` without their prefix, such as lever; as `set_sample`."""
        ...

    def close(self) -> None:
        """Withdraw the tip and let go of the instrument."""
        ...
