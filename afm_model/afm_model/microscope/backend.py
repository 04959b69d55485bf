"""What carries out verbs: an instrument in this process (`local`), or one that runs somewhere else."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Self

from ..core.errors import ParameterError
from ..core.schema import Value
from ..parts.onboard import NO_DEFLECTION
from .collect import Reading
from .image import Line
from .results import MicroscopeState, Outcome, Progress
from .verb import Verb
from .view import CALIBRATIONS

OnProgress = Callable[[Progress], None]
OnLine = Callable[[Line], None]


class LoopSettings(ABC):
    """What can be set at any time, between two ticks. All raise ParameterError if it is not allowed."""

    @abstractmethod
    def set_loop(self, **settings: Any) -> None:
        """Change loop settings, names of `afm_model.parts.onboard.ONBOARD_SETTINGS`, or calibrations, as `use`."""

    def use(self, /, *results: Any, **numbers: float) -> None:
        """Compute forces with what was calibrated, from now on: setpoints, triggers, curves, images and their notes.

        A setpoint that is a force stays one, so that the tip presses differently; one that is a voltage stays too. With
        another probe nothing is calibrated.

        Parameters
        ----------
        *results : Calibration, or its labelled array
            As the verbs bring them back; their units say what they are of.
        **numbers : float
            spring_constant [N/m], deflection_sensitivity [m/V] (for vertical motion), lateral_sensitivity [N/V], known
            from elsewhere; 0: by the parameters of plant and detector again.
        """
        kinds = {unit: name for name, unit in CALIBRATIONS.items()}
        for each in results:
            unit = getattr(each, "attrs", {}).get("units", getattr(each, "unit", ""))
            if unit not in kinds:
                raise ParameterError(f"{each} is not allowed: it must be a calibration, in one of {', '.join(kinds)}")
            numbers[kinds[unit]] = float(getattr(each, "value", each))
        if unknown := [name for name in numbers if name not in CALIBRATIONS]:
            raise ParameterError(f"{unknown[0]} is no calibration: there are {', '.join(CALIBRATIONS)}")
        self.set_loop(**numbers)

    def set_setpoint(
        self,
        *,
        force: float | None = None,
        voltage: float | None = None,
        amplitude: float | None = None,
        share: float | None = None,
    ) -> None:
        """Setpoint of the deflection, as vertical force [N] or as voltage [V]; of a tip that taps, of the amplitude [m]
        or as its share of the free amplitude. One of them.
        """
        told = {"force": force, "voltage": voltage, "amplitude": amplitude, "share": share}
        given = {name: value for name, value in told.items() if value is not None}
        if len(given) != 1:
            every = " with ".join(f"{name} = {value}" for name, value in given.items()) or "no setpoint"
            raise ParameterError(f"{every} is not allowed: give one of them, {', '.join(told)}")
        if force is None and voltage is None:
            ((name, value),) = given.items()
            if not value > 0.0:
                raise ParameterError(f"{name} = {value:g} is not allowed: it must be > 0")
            self.set_loop(setpoint_amplitude=amplitude or 0.0, setpoint_share=share or 0.0)
        else:
            self.set_loop(setpoint_force=force or 0.0, setpoint_voltage=voltage or (0.0 if force else NO_DEFLECTION))

    def set_gains(self, proportional: float | None = None, integral: float | None = None) -> None:
        """Gains of the z loop, P [m/V] and I [m/(V s)]; None: as it is."""
        given = {"proportional_gain": proportional, "integral_gain": integral}
        self.set_loop(**{name: value for name, value in given.items() if value is not None})

    def set_feedback(self, mode: str) -> None:
        """What the z loop does with an approached tip; a withdrawn tip stays withdrawn.

        on: it follows the setpoint. hold: z stays where it is. off: the same, and verbs that need the loop are refused.
        external: z is driven by the controller.
        """
        self.set_loop(feedback=mode)

    def set_z_limits(self, low: float | None = None, high: float | None = None) -> None:
        """Set the least and the largest z [m], positive towards the sample, for the loop and all verbs; None: as it is.

        Limits that z is beyond now are refused.
        """
        given = {"low": low, "high": high}
        self.set_loop(**{name: value for name, value in given.items() if value is not None})


class Backend(LoopSettings):
    """Carries out verbs, one after the other. Use it as a context manager, or `close` it."""

    outcome: Outcome | None = None
    """How the last verb has ended, with all that was measured; also of one that was stopped, or ended by an error.
    """

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @abstractmethod
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

    @abstractmethod
    def objection(self, verb: Verb) -> str:
        """Why a verb cannot be begun now, one sentence; empty if it can."""

    @property
    @abstractmethod
    def state(self) -> MicroscopeState:
        """Where the microscope stands."""

    @abstractmethod
    def read_signals(self, *names: str) -> dict[str, Reading]:
        """Read signals as they are now, value and unit by name; at any moment, also during a verb.

        Parameters
        ----------
        *names : str
            As channels of a scan: height, z, error, deflection, lateral, x, y, and every channel that is sampled; none:
            all that exist.

        Raises
        ------
        ParameterError
            If a signal does not exist.
        """

    @abstractmethod
    def stop(self, *, stay: bool = False) -> None:
        """End the verb that is being done; what was measured is kept.

        To be called from a callback, or from another thread than that which waits for the verb.

        Parameters
        ----------
        stay : bool
            False: the tip is withdrawn. True: the scanner comes to rest, and the tip stays on the sample with the
            feedback as it is set, or z where it is if it was not on the sample; a verb that has opened the loop brings
            the tip back, and where it cannot the tip is withdrawn.
        """

    @abstractmethod
    def pause(self) -> None:
        """Let time stand still in the middle of a verb, until `resume` or `stop`; called as `stop` is.

        Raises
        ------
        VerbError
            If nothing is being done.
        """

    @abstractmethod
    def resume(self) -> None:
        """Go on after `pause`, or give the loop back its z after a withdrawal by a limit (`safety.*`): the tip is then
        withdrawn, not approached.

        Raises
        ------
        VerbError
            If neither has happened, or a limit is still passed.
        """

    @abstractmethod
    def exchange(self, group: str, changes: Mapping[str, Value]) -> None:
        """Put in another sample or probe (groups sample, plant); only with the tip withdrawn. Time begins again."""

    def set_sample(self, changes: Mapping[str, Value]) -> None:
        """Another sample, by parameters `sample.*` without their prefix; see `exchange`."""
        self.exchange("sample", changes)

    def set_probe(self, changes: Mapping[str, Value]) -> None:
        """Another cantilever, by parameters `plant.*` without their prefix, such as lever; see `exchange`."""
        self.exchange("plant", changes)

    @abstractmethod
    def close(self) -> None:
        """Withdraw the tip and let go of the instrument."""
