"""Labelled arrays as results again: what `labelled` made, as it is or read back from a file."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.schema import build
from .labelled import CURVE_NUMBERS
from .results import DIRECTIONS, Curve, Image, Record
from .verbs import Scan

if TYPE_CHECKING:
    import xarray

_MEASURED = "measured_"
_MADE = ("friction", "crosstalk", "force", "time")
"""Variables that are made of the others, or stand elsewhere in a result."""
_NUMBERS = ("start", "line_rate_reached", "lines_done", "complete", "verb")


def as_image(scan: "Image | xarray.Dataset") -> Image:
    """A scan as `Image`, from that or from its labelled arrays.

    Raises
    ------
    ValueError
        If it is something else.
    """
    if isinstance(scan, Image):
        return scan
    attributes: Mapping[str, Any] = getattr(scan, "attrs", {})
    if attributes.get("verb") != "Scan":
        raise ValueError(f"this is no scan, neither an Image nor the labelled arrays of one: {type(scan).__name__}")
    plain = {str(name): _plain(value) for name, value in attributes.items()}
    variables = {str(name): values for name, values in scan.data_vars.items() if name not in _MADE}
    units = {name.removeprefix(_MEASURED): values.attrs["units"] for name, values in variables.items()}
    data = {
        (name.removeprefix(_MEASURED), way): np.asarray(values.sel(direction=way), dtype=np.float64)
        for name, values in variables.items()
        for way in DIRECTIONS
    }
    return Image(
        build(Scan, {name: plain[name] for name in Scan.model_fields}),
        units,
        data,
        start=plain["start"],
        line_rate=plain["line_rate_reached"],
        lines_done=plain["lines_done"],
        complete=bool(plain["complete"]),
        metadata={name: str(value) for name, value in plain.items() if name not in (*Scan.model_fields, *_NUMBERS)},
    )


def as_curves(curves: "Curve | Sequence[Curve] | xarray.Dataset") -> list[Curve]:
    """Force curves as `Curve`, from those or from their labelled arrays, of one or of many.

    Raises
    ------
    ValueError
        If it is something else.
    """
    if isinstance(curves, Curve):
        return [curves]
    if isinstance(curves, Sequence) and all(isinstance(each, Curve) for each in curves):
        return list(curves)
    if not {"z", "deflection", "phase"} <= set(getattr(curves, "data_vars", ())):
        raise ValueError(f"these are no force curves, neither Curve nor their labelled arrays: {type(curves).__name__}")
    dataset: Any = curves
    if "curve" not in dataset.dims:
        return [_curve(dataset, np.asarray(dataset.time), dataset.attrs)]
    found = []
    for number in range(dataset.sizes["curve"]):
        one = dataset.isel(curve=number)
        time = np.asarray(one.time)
        measured = np.isfinite(time)
        numbers = {name: one[name].item() for name in CURVE_NUMBERS}
        found.append(_curve(one.isel(sample=measured), time[measured], numbers))
    return found


def _curve(dataset: Any, time: Any, numbers: Mapping[str, Any]) -> Curve:
    variables = {str(name): values for name, values in dataset.data_vars.items() if name not in _MADE}
    record = Record(
        np.asarray(time, dtype=np.float64),
        {name: np.asarray(values, dtype=np.float64) for name, values in variables.items()},
        {name: values.attrs["units"] for name, values in variables.items()},
    )
    plain = {name: _plain(numbers[name]) for name in CURVE_NUMBERS}
    return Curve(record=record, **plain | {"triggered": bool(plain["triggered"])})


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
