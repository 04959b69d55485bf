"""Results as labelled arrays: names, dimensions, units and what is needed to understand them later.

Attributes are numbers, text and lists of them only, so that they go over topics, and `dataset.to_netcdf(path)` and
`xarray.open_dataset(path)` keep all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.optional import needed

if TYPE_CHECKING:
    import xarray

LONG_NAMES = {
    "height": "height of the sample, as z was driven",
    "error": "what the z loop regulates, less its setpoint",
    "amplitude": "amplitude of the deflection, by the lock-in",
    "amplitude_error": "amplitude less its setpoint",
    "lateral": "lateral force of the sample on the tip",
    "friction": "half the difference of trace and retrace of the lateral force",
    "crosstalk": "half the sum of trace and retrace of the lateral force",
    "z": "z as driven, positive towards the sample",
    "deflection": "deflection of the cantilever",
    "deflection_voltage": "deflection of the cantilever, as the photodiode shows it",
    "lateral_voltage": "lateral signal of the photodiode",
    "force": "vertical force on the tip by its deflection, positive away from the sample",
    "phase": "part of the force curve",
    "position": "along the line, as asked for",
    "time": "simulated time",
    "x": "x as asked for",
    "y": "y as asked for",
}

_LAG = "lag of the deflection relative to the reference of the lock-in, less the phase offset"


class Variable(NamedTuple):
    """One array; a tuple as xarray takes it."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


def variable(dims: Sequence[str], values: ArrayLike, name: str, unit: str) -> Variable:
    """An array with its unit (SI) and, by its name, a long name."""
    # Of a force curve, a phase is something else.
    told = _LAG if (name, unit) == ("phase", "rad") else LONG_NAMES.get(name, name)
    return Variable(tuple(dims), np.asarray(values), {"units": unit, "long_name": told})


@dataclass(frozen=True)
class Arrays:
    """Named arrays; what a verb of one's own may bring back.

    Parameters
    ----------
    variables, coordinates : mapping of str to Variable
    attributes : mapping
        Numbers, text and lists of them.
    """

    variables: Mapping[str, Variable]
    coordinates: Mapping[str, Variable] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def arrays(self) -> "Arrays":
        """Itself, as every result has them."""
        return self


def attributes(fields: Any, more: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a verb, and more, as attributes."""
    given: dict[str, Any] = {"verb": type(fields).__name__, **fields.model_dump(), **more}
    return {name: int(value) if isinstance(value, bool) else value for name, value in given.items()}


def arrays_of(result: Any) -> Arrays | None:
    """A result of a verb as arrays, or several of one kind together; None if it has no such form."""
    if isinstance(result, Sequence) and result and hasattr(type(result[0]), "together"):
        found: Arrays = type(result[0]).together(result)
        return found
    return result.arrays() if hasattr(result, "arrays") else None


def to_xarray(result: Any) -> "xarray.Dataset | xarray.DataArray | Any":
    """A result of a verb as labelled arrays of xarray.

    Parameters
    ----------
    result : Image, Line, Curve, sequence of Curve, Loop, PathRecord, Calibration or Arrays

    Returns
    -------
    xarray.Dataset; of a Calibration xarray.DataArray
        What has no labelled form is returned as it is.

    Raises
    ------
    ImportError
        If xarray is not installed.
    """
    arrays = arrays_of(result)
    if arrays is None:
        return result
    xarray = needed("xarray", "a labelled array")
    if set(arrays.variables) == {""}:
        return xarray.DataArray(arrays.variables[""].values, attrs=dict(arrays.variables[""].attributes))
    return xarray.Dataset(dict(arrays.variables), dict(arrays.coordinates), dict(arrays.attributes))
