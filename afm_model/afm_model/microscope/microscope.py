"""A microscope to work with, in this process or somewhere else, in the words of automated microscopy.

    with Microscope("two_materials") as microscope:
        microscope.approach()
        image = microscope.scan(size_x=1e-6, pixels=128, lines=128, line_rate=2.0)
        curve = microscope.get_spectrum(x=100e-9, y=0.0, trigger_force=20e-9)

Every verb is a word (`afm_model.microscope.verbs`, or one that an installed package offers): it takes the fields of the
verb, in SI units, waits for the end, and returns labelled arrays of xarray. A few words more are made of them.
"""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..core import registry
from ..core.errors import ParameterError, VerbError
from ..core.schema import Value
from ..parameters import ControllerParameters, SimParameters, changed
from ..parameters.scenario import Scenario, changed_instrument, following, load_scenario
from .arrays import to_xarray
from .backend import Backend, LoopSettings, OnLine, OnProgress
from .collect import Reading
from .live_local import Live
from .local import Local
from .results import COMPLETE, MicroscopeState, Outcome
from .signatures import takes_fields_of, word_of
from .verb import Verb, find
from .verbs import ForceCurve, MoveTo, Scan, ScanPath

if TYPE_CHECKING:
    import xarray


class Microscope(LoopSettings):
    """What a microscope can do.

    Time passes while it does something, and stands still in between. In real time, with `run={"mode": "realtime"}` or
    somewhere else, it goes on: the loop follows, the sample drifts. Ctrl-C, `stop` and an error in a callback end a
    verb: the tip is withdrawn (with `stop(stay=True)` it stays), and `outcome` has what was measured. At the end,
    `close` or a `with`, the tip is withdrawn.

    Parameters
    ----------
    preset : str, path, Scenario or Backend
        One of `afm_model.scenario_names()`, such as two_materials, a file, or what carries out verbs somewhere else.
    controller : ControllerParameters, optional
        The law that moves x and y; that of the scenario if not given.
    on_progress, on_line : callable, optional
        Called now and then with how far a verb is (`Progress`), and with every `Line` of a scan.
    engaged : bool
        True: approach before anything else.
    **changes : mapping
        Groups of parameters of the instrument that differ from the preset's: `sample={"width": 50e-9}`. With another
        `kind` as in `afm_model.changed`. The preset's law follows another control period or delay.

    Warns
    -----
    TimingWarning
        If the law is made for another control period or delay than those of the plant.

    Raises
    ------
    ScenarioError, ParameterError
        If there is no such preset, or a parameter is not allowed.

    """

    def __init__(
        self,
        preset: "str | os.PathLike[str] | Scenario | Backend" = "two_materials",
        controller: ControllerParameters | None = None,
        *,
        on_progress: OnProgress | None = None,
        on_line: OnLine | None = None,
        engaged: bool = False,
        **changes: Mapping[str, Value],
    ) -> None:
        self.on_progress, self.on_line = on_progress, on_line
        self.backend = self._backend(preset, controller, changes)
        if engaged and not self.state.approached:
            try:
                self.do("approach")
            except BaseException:
                self.close()
                raise

    @staticmethod
    def _backend(
        preset: "str | os.PathLike[str] | Scenario | Backend",
        controller: ControllerParameters | None,
        changes: Mapping[str, Mapping[str, Value]],
    ) -> Backend:
        if not isinstance(preset, str | os.PathLike | Scenario):
            if changes or controller is not None:
                raise ParameterError(
                    f"{', '.join([*changes, *(['controller'] if controller is not None else [])])}: not allowed with a "
                    f"microscope that runs somewhere else, which has its own"
                )
            return preset
        scenario = preset if isinstance(preset, Scenario) else load_scenario(preset)
        sim = _changed(scenario, changes)
        if controller is None:
            own = sim.controller_inside
            controller = changed(scenario.controller, following(scenario, sim)) if own is None else own
        return (Live if sim.run.mode == "realtime" else Local)(sim, controller)

    def __enter__(self) -> "Microscope":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Withdraw the tip, and let go of the instrument."""
        self.backend.close()

    @property
    def outcome(self) -> Outcome | None:
        """How the last verb has ended, with its result as it is written to files (`afm_model.files`)."""
        return self.backend.outcome

    def stop(self, *, stay: bool = False) -> None:
        """See `Backend`: `VerbError` is raised where the verb was begun."""
        self.backend.stop(stay=stay)

    def read_signals(self, *names: str) -> dict[str, Reading]:
        """See `Backend`."""
        return self.backend.read_signals(*names)

    def pause(self) -> None:
        """See `Backend`."""
        self.backend.pause()

    def resume(self) -> None:
        """See `Backend`. After a limit the next verb is an approach."""
        self.backend.resume()

    @property
    def state(self) -> MicroscopeState:
        """Where it stands: approached, feedback, setpoint [V], gains, place [m]."""
        return self.backend.state

    def do(self, verb: Verb | str, **fields: Any) -> Any:
        """Do a verb and wait for its end.

        Parameters
        ----------
        verb : Verb or str
            A verb with its fields, or the name of one (`module:NAME` for one of your own).
        **fields
            Of the verb, where it is given by its name.

        Returns
        -------
        xarray.Dataset, DataArray or Standing
            See `afm_model.microscope.to_xarray`.

        Raises
        ------
        VerbError
            If it cannot be begun, or has not come to its end; `outcome` of the error, and of the microscope, then has
            what was measured.

        Warns
        -----
        UserWarning
            If the result needs a remark, such as that z was at the end of its range.
        """
        return to_xarray(self.measure(verb, **fields))

    def measure(self, verb: Verb | str, **fields: Any) -> Any:
        """Do a verb as `do`; return its result as it is written to files, without importing xarray."""
        if isinstance(verb, str):
            try:
                verb = find(verb).of(fields)
            except ParameterError as error:
                raise VerbError(str(error)) from None
        outcome = self.backend.execute(verb, self.on_progress, self.on_line)
        if outcome.status != COMPLETE:
            broken_off = VerbError(outcome.message)
            broken_off.outcome = outcome
            raise broken_off
        if outcome.message:
            warnings.warn(outcome.message, stacklevel=4)
        return outcome.result

    def objection(self, verb: Verb) -> str:
        """Why a verb cannot be begun now, one sentence; empty if it can."""
        return self.backend.objection(verb)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """The word of a verb: `microscope.friction_loop(length=20e-9)`."""
        verbs = registry.names("verb")
        if name not in verbs:
            raise AttributeError(f"a microscope has no {name}; its verbs are {', '.join(verbs)}")
        return word_of(find(name), partial(self.do, name))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *registry.names("verb")]

    # Words made of verbs.

    @takes_fields_of(MoveTo)
    def move_to(self, x: float, y: float, **fields: Value) -> Any:
        """Move to a place [m]; fields of `MoveTo`."""
        return self.do("move_to", x=x, y=y, **fields)

    go_to = move_to

    @takes_fields_of(Scan)
    def get_scan(self, **fields: Value) -> "xarray.Dataset":
        """An image, line by line; fields of `Scan`."""
        return self.do("scan", **fields)

    @takes_fields_of(Scan)
    def scan_individual_line(
        self, direction: Literal["horizontal", "vertical"] = "horizontal", coord: float = 0.0, **fields: Value
    ) -> "xarray.Dataset":
        """One line, trace and retrace.

        Parameters
        ----------
        direction : str
            horizontal: along x; vertical: along y.
        coord : float [m]
            Where it crosses the other axis.
        **fields
            Of `Scan`; `centre_x` is where the middle of a horizontal line is, `centre_y` that of a vertical one.
        """
        if direction == "horizontal":
            along: dict[str, Value] = {"centre_y": coord}
        elif direction == "vertical":
            along = {"centre_x": coord, "angle": 0.5 * np.pi}
        else:
            raise VerbError(f"direction = {direction} is not allowed: it must be horizontal or vertical")
        return self.do("scan", **{"lines": 1, "slow_axis": False, **along, **fields})

    @takes_fields_of(ScanPath)
    def scan_arbitrary_path(self, path_points: ArrayLike, **fields: Value) -> "xarray.Dataset":
        """Measure along straight lines from place to place.

        Parameters
        ----------
        path_points : array_like (n, 2) [m]
            x and y of the places, in turn.
        **fields
            Of `ScanPath`.
        """
        points = np.asarray(path_points, np.float64)
        if points.ndim != 2 or points.shape[1] != 2:
            raise VerbError(f"path_points of shape {points.shape} are not allowed: they must be of shape (n, 2)")
        return self.do("scan_path", x=points[:, 0].tolist(), y=points[:, 1].tolist(), **fields)

    @takes_fields_of(ForceCurve)
    def get_spectrum(
        self,
        location: Sequence[float] | None = None,
        *,
        x: float | None = None,
        y: float | None = None,
        **fields: Value,
    ) -> "xarray.Dataset":
        """Force curves at a place [m], given as a pair or as x and y, or where the scanner stands; fields of
        `ForceCurve`.
        """
        if location is not None:
            if np.shape(location) != (2,) or (x, y) != (None, None):
                raise VerbError("location must be a pair (x, y), given without x and y")
            x, y = location
        if x is not None or y is not None:
            at = self.state.place
            self.move_to(at[0] if x is None else x, at[1] if y is None else y)
        return self.do("force_curve", **fields)

    # Settings.

    def set_loop(self, **settings: Any) -> None:
        """See `LoopSettings`."""
        self.backend.set_loop(**settings)

    def set_sample(self, **changes: Value) -> None:
        """Put in another sample, by parameters `sample.*`; only with the tip withdrawn. Simulated time begins again."""
        self.backend.set_sample(changes)

    def set_probe(self, **changes: Value) -> None:
        """Another cantilever, by parameters `plant.*`, such as `lever`; as `set_sample`."""
        self.backend.set_probe(changes)


def _changed(scenario: Scenario, changes: Mapping[str, Mapping[str, Value]]) -> SimParameters:
    for group, each in changes.items():
        if not isinstance(each, Mapping):
            raise ParameterError(f"{group} = {each} is not allowed: it must be parameters by name, {group}={{...}}")
    news = {f"{group}.{name}": value for group, each in changes.items() for name, value in each.items()}
    return changed_instrument(scenario, news)
