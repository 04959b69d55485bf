"""A recorded run played again."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..core import registry
from ..core.errors import ParameterError
from ..core.schema import Value, flatten
from ..fault import Schedule, faults_of
from ..parameters import Safety, SimParameters, build
from ..parts.drives_ahead import Command
from ..parts.signals import LONGEST_HORIZON

_Array = NDArray[np.float64]


class Recorded(Protocol):
    """What of a recording is needed to play it again: afm_recorder_node.reader.Recording has it."""

    @property
    def drive(self) -> _Array:
        """In force from each tick on (n, 3) [V]."""

    @property
    def channels(self) -> Mapping[str, Any]:
        """Sampled signals by name; `values` of each (m,)."""


class Replay:
    """A law that gives the drives of a recorded run, tick by tick.

    What faults made of these drives is in them: `simulate` leaves the faults of drives and messages out, and lets those
    of the sample act again.

    Parameters
    ----------
    drives : ndarray (n, 3) or (n, m, 3) [V]
        Applied from each tick on, as recorded: `Recording.drive`, `Simulation.drive`; or at each of the m updates of
        the DAC in a tick (`piezo.dac_period`): the channels drive_x, drive_y, drive_z at those times.
    delay_ticks : int
        `plant.delay_ticks` of the instrument. What is recorded has been delayed: it is given so many ticks sooner.
    dac_period : float [s]
        `piezo.dac_period` of the instrument, where m > 1.

    Raises
    ------
    ParameterError
        If the drives are not so many rows of three finite numbers (a recording with a gap cannot be replayed), or too
        many of them fall into the delay.
    """

    def __init__(self, drives: _Array, delay_ticks: int = 0, dac_period: float = 0.0) -> None:
        drives = np.asarray(drives, np.float64)
        if drives.ndim not in (2, 3) or drives.shape[-1] != 3 or not drives.size:
            raise ParameterError(f"drives of shape {drives.shape} cannot be replayed: they must be n rows of three")
        gaps = np.flatnonzero(~np.isfinite(drives.reshape(len(drives), -1)).all(axis=1))
        if gaps.size:
            raise ParameterError(
                f"drives with {gaps.size} gaps cannot be replayed (the first at tick {gaps[0]}): the recording must be "
                "whole"
            )
        updates = 1 if drives.ndim == 2 else drives.shape[1]
        if updates > 1 and not dac_period > 0.0:
            raise ParameterError(
                f"{updates} drives in each tick cannot be replayed without dac_period, which must be > 0 s"
            )
        if updates > 1 and updates * (delay_ticks + 1) > LONGEST_HORIZON:
            raise ParameterError(
                f"{updates} drives in each tick cannot be replayed with plant.delay_ticks = {delay_ticks}: "
                f"{LONGEST_HORIZON} on their way are the most"
            )
        self._drives = drives.reshape(-1, 3)
        self._updates = updates
        self._delay_ticks = delay_ticks
        self._dac_period = dac_period
        self._next = 0

    @classmethod
    def of(cls, recording: Recorded, parameters: SimParameters) -> "Replay":
        """The drives of a recording, at each update of the DAC where there are several in a tick.

        Parameters
        ----------
        recording : Recording
        parameters : SimParameters
            Of the instrument: `recorded_parameters`.

        Raises
        ------
        ParameterError
            If the recording has a gap; if there are several updates in a tick and their drives were not recorded.
        """
        plant, dac_period = parameters.plant, parameters.piezo.dac_period
        updates = round(plant.control_period / dac_period) if dac_period else 1
        if updates == 1:
            return cls(recording.drive, plant.delay_ticks)
        samples = round(dac_period / parameters.detector.sample_period)
        names = [f"drive_{axis}" for axis in "xyz"]
        if missing := [name for name in names if name not in recording.channels]:
            raise ParameterError(
                f"{updates} drives in each tick (piezo.dac_period = {dac_period:g} s) cannot be replayed: of channel "
                f"{missing[0]} nothing was recorded; detector.channels must name {','.join(names)}"
            )
        drives = np.stack([recording.channels[name].values for name in names], axis=-1)
        if len(drives) != len(recording.drive) * updates * samples:
            raise ParameterError(
                f"{len(drives)} samples of the drive in {len(recording.drive)} ticks cannot be replayed: there must be "
                f"{updates * samples} in each tick"
            )
        return cls(drives[::samples].reshape(-1, updates, 3), plant.delay_ticks, dac_period)

    def answer(self, measurement: _Array) -> _Array | Command:
        """Drive of the next tick [V], with those of its further updates; after the last one, that again."""
        first, last = self._next * self._updates, len(self._drives) - 1
        self._next += 1
        if self._updates == 1:
            return self._drives[min(first + self._delay_ticks, last)]
        ahead = np.minimum(first + np.arange((self._delay_ticks + 1) * self._updates), last)
        return Command(self._drives[ahead[0]], self._drives[ahead[1:]], self._dac_period)

    def reset(self) -> None:
        """Begin again."""
        self._next = 0


def replayed(parameters: SimParameters) -> SimParameters:
    """Parameters with which the drives of a run made with `parameters` give its trajectory again."""
    # Where a limit has acted, the drives are those of the instrument already.
    parameters = parameters.model_copy(update={"safety": Safety()})
    if not isinstance(parameters.fault, Schedule):
        return parameters
    left_out = tuple(f"fault.{name}." for name, fault in faults_of(parameters).items() if not fault.of_the_sample)
    if not left_out:
        return parameters
    kept = {name: value for name, value in flatten(parameters).items() if not name.startswith(left_out)}
    return build(SimParameters, kept)


def recorded_parameters(
    values: Mapping[str, Value], changes: Iterable[Any] = (), parts: Sequence[str] = ()
) -> SimParameters:
    """Return the parameters of the instrument that a recording holds, without others of its node.

    A recording chooses among the parts of this package and of installed ones; it imports nothing.

    Parameters
    ----------
    values : mapping
        Value by dotted name: `Recording.parameters["afm_sim_node"]`.
    changes : iterable, optional
        `Recording.parameter_changes`, of which the faults count that were ordered while the instrument ran: each has
        its `name` and the `new` value.
    parts : sequence of str
        Parts of your own that the recording may choose, `module:NAME` each; they are imported.

    Raises
    ------
    ParameterError
        If the instrument of today does not know a parameter of the recording, or refuses its value; if the recording
        chooses a `module:NAME` that is not in `parts`.
    """
    ordered = {each.name: each.new for each in changes if each.name.startswith("fault.")}
    known = {**values, **ordered}
    own = {name: value for name, value in known.items() if name.partition(".")[0] in SimParameters.model_fields}
    with registry.reading(parts):
        return build(SimParameters, own)
