"""Results as labelled arrays of xarray: with names, units and what is needed to understand them later.

Attributes are numbers and text only, so that `dataset.to_netcdf(path)` and `xarray.open_dataset(path)` keep all.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..program.force_curve import APPROACH, DWELL, RETRACT
from .results import DIRECTIONS, Calibration, Curve, Image, Line, Loop, PathRecord
from .verbs import Verb

if TYPE_CHECKING:
    import xarray

_Array = NDArray[np.float64]
LONG_NAMES = {
    "height": "height of the sample, as z was driven",
    "error": "deflection less its setpoint",
    "lateral": "lateral force of the sample on the tip",
    "friction": "half the difference of trace and retrace of the lateral force",
    "crosstalk": "half the sum of trace and retrace of the lateral force",
    "z": "z as driven, positive towards the sample",
    "deflection": "deflection of the cantilever",
    "force": "vertical force on the tip by its deflection, positive away from the sample",
    "phase": "part of the force curve",
    "position": "along the line, as asked for",
    "time": "simulated time",
    "x": "x as asked for",
    "y": "y as asked for",
}


def _xarray() -> Any:
    try:
        import xarray
    except ImportError:
        raise ImportError("labelled arrays need xarray, which is not installed: pip install xarray") from None
    return xarray


def labelled(result: Any) -> "xarray.Dataset | xarray.DataArray | Any":
    """A result of a verb as labelled arrays.

    Parameters
    ----------
    result : Image, Line, Curve, sequence of Curve, Loop, PathRecord or Calibration

    Returns
    -------
    xarray.Dataset, of a Calibration xarray.DataArray
        What has no labelled form is returned as it is.

    Raises
    ------
    ImportError
        If xarray is not installed.
    """
    for kind, convert in _CONVERTERS.items():
        if isinstance(result, kind):
            return convert(result)
    if isinstance(result, Sequence) and result and all(isinstance(each, Curve) for each in result):
        return curves(result)
    return result


def _variable(dims: tuple[str, ...], values: Any, name: str, unit: str) -> tuple[tuple[str, ...], Any, dict[str, str]]:
    return dims, values, {"units": unit, "long_name": LONG_NAMES.get(name, name)}


def _attributes(verb: Verb, more: Mapping[str, Any]) -> dict[str, Any]:
    given: dict[str, Any] = {"verb": type(verb).__name__, **verb.model_dump(), **more}
    return {name: int(value) if isinstance(value, bool) else value for name, value in given.items()}


def image(result: Image) -> "xarray.Dataset":
    """A scan: its channels over (direction, y, x); friction and crosstalk over (y, x).

    x and y are places in the frame, from its centre; the coordinates `place_x` and `place_y` are those on the sample.
    """
    scan, x, y = result.scan, result.x, result.y
    cosine, sine = np.cos(scan.angle), np.sin(scan.angle)
    # With the slow axis off every line is at the middle of the frame.
    slow = y if scan.slow_axis else np.zeros_like(y)
    places = {
        "place_x": scan.centre_x + cosine * x[None, :] - sine * slow[:, None],
        "place_y": scan.centre_y + sine * x[None, :] + cosine * slow[:, None],
    }
    variables = {
        name: _variable(("direction", "y", "x"), np.stack([result.data[name, way] for way in DIRECTIONS]), name, unit)
        for name, unit in result.units.items()
        if name not in ("x", "y")
    }
    # A measured place along x is no coordinate.
    for name in {"x", "y"} & set(result.units):
        values = np.stack([result.data[name, way] for way in DIRECTIONS])
        variables[f"measured_{name}"] = (
            ("direction", "y", "x"),
            values,
            {"units": result.units[name], "long_name": f"{name} as measured"},
        )
    if "lateral" in result.units:
        for name, values in (("friction", result.friction()), ("crosstalk", result.crosstalk())):
            variables[name] = _variable(("y", "x"), values, name, result.units["lateral"])
    coordinates = {
        "direction": list(DIRECTIONS),
        "x": ("x", x, {"units": "m", "long_name": "along the fast direction, from the centre of the frame"}),
        "y": ("y", y, {"units": "m", "long_name": "along the slow direction, from the centre of the frame"}),
        **{
            name: (("y", "x"), values, {"units": "m", "long_name": f"{name[-1]} on the sample, as asked for"})
            for name, values in places.items()
        },
    }
    more = {
        "start": result.start,
        "line_rate_reached": result.line_rate,
        "lines_done": result.lines_done,
        "complete": result.complete,
        **result.metadata,
    }
    return _xarray().Dataset(variables, coordinates, _attributes(scan, more))


def line(result: Line) -> "xarray.Dataset":
    """One direction of a line of a scan, over its pixels from left to right."""
    variables = {name: (("pixel",), values, {"long_name": name}) for name, values in result.channels.items()}
    return _xarray().Dataset(
        variables, attrs={"index": result.index, "direction": result.direction, "start": result.time}
    )


def _curve_variables(result: Curve) -> dict[str, tuple[_Array, str]]:
    channels, units = result.record.channels, result.record.units
    found = {name: (values, units.get(name, "1")) for name, values in channels.items()}
    force = channels["deflection"] * result.deflection_sensitivity * result.spring_constant
    return found | {"force": (force, "N")}


CURVE_NUMBERS = (
    *("triggered", "trigger", "approach_rate", "retract_rate", "deflection_sensitivity", "spring_constant"),
    *("x", "y"),
)
"""Fields of a curve that are single numbers."""
_FLAGS = {"flag_values": [APPROACH, DWELL, RETRACT], "flag_meanings": "approach dwell retract"}


def curve(result: Curve) -> "xarray.Dataset":
    """A force curve over time: `z`, `deflection`, `lateral`, `phase` and `force`."""
    variables: dict[str, Any] = {
        name: _variable(("time",), values, name, unit) for name, (values, unit) in _curve_variables(result).items()
    }
    variables["phase"][2].update(_FLAGS)
    attributes = {name: getattr(result, name) for name in CURVE_NUMBERS}
    attributes["triggered"] = int(result.triggered)
    time = {"time": _variable(("time",), result.record.time, "time", "s")}
    return _xarray().Dataset(variables, time, attributes)


def curves(results: Sequence[Curve]) -> "xarray.Dataset":
    """Force curves over (curve, sample); shorter ones end with NaN. Their numbers are coordinates along `curve`."""
    longest = max(len(each.record.time) for each in results)

    def padded(parts: list[_Array]) -> _Array:
        return np.stack([np.pad(each, (0, longest - len(each)), constant_values=np.nan) for each in parts])

    every = [_curve_variables(each) for each in results]
    variables: dict[str, Any] = {
        name: _variable(("curve", "sample"), padded([each[name][0] for each in every]), name, unit)
        for name, (_, unit) in every[0].items()
    }
    variables["phase"][2].update(_FLAGS)
    variables["time"] = _variable(("curve", "sample"), padded([each.record.time for each in results]), "time", "s")
    units = {"x": "m", "y": "m", "trigger": "V", "approach_rate": "m/s", "retract_rate": "m/s"}
    units |= {"deflection_sensitivity": "m/V", "spring_constant": "N/m", "triggered": "1"}
    coordinates = {
        name: ("curve", [float(getattr(each, name)) for each in results], {"units": units[name]})
        for name in CURVE_NUMBERS
    }
    return _xarray().Dataset(variables, coordinates)


def loop(result: Loop) -> "xarray.Dataset":
    """Lines to and fro over time: `position`, `lateral`, `deflection`."""
    units = {"position": "m", "lateral": "N", "deflection": "m"}
    variables = {name: _variable(("time",), getattr(result, name), name, unit) for name, unit in units.items()}
    time = {"time": _variable(("time",), result.time, "time", "s")}
    return _xarray().Dataset(variables, time, _attributes(result.verb, {}))


def path(result: PathRecord) -> "xarray.Dataset":
    """What was measured along a path, over time."""
    record = result.record
    variables = {
        name: _variable(("time",), values, name, record.units.get(name, "1"))
        for name, values in record.channels.items()
    }
    time = {"time": _variable(("time",), record.time, "time", "s")}
    # The names x and y are those of the places measured at.
    corners = {"corners_x": list(result.verb.x), "corners_y": list(result.verb.y)}
    attributes = {name: value for name, value in _attributes(result.verb, corners).items() if name not in ("x", "y")}
    return _xarray().Dataset(variables, time, attributes)


def calibration(result: Calibration) -> "xarray.DataArray":
    """A number with its standard uncertainty and its details as attributes."""
    attributes = {"units": result.unit, "uncertainty": result.estimate.uncertainty, **result.details}
    return _xarray().DataArray(result.estimate.value, attrs=attributes)


_CONVERTERS: dict[type, Any] = {
    Image: image,
    Line: line,
    Curve: curve,
    Loop: loop,
    PathRecord: path,
    Calibration: calibration,
}
