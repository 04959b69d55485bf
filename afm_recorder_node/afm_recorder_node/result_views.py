"""What verbs have brought back, as the viewer shows it: tables, and curves over what they depend on. Needs no ROS."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr

from afm_model.analysis import force_curve
from afm_model.core import registry
from afm_model.core.prefix import text
from afm_model.microscope.arrays import Arrays, Variable
from afm_model.microscope.image import Image
from afm_model.microscope.verb import find
from afm_model.program.force_curve import APPROACH, DWELL, RETRACT
from afm_node_common.decoding import InvalidMessage

from .diagram import BLUE, ORANGE, Axis, Diagram, DiagramLine
from .gathering import Result
from .layout import RESULT

FORCE_CURVE, FRICTION_LOOP = f"{RESULT}/force", f"{RESULT}/lateral"
_TITLES = {
    FORCE_CURVE: "Force over z",
    FRICTION_LOOP: "Lateral force over position",
    f"{RESULT}/amplitude": "Amplitude",
    f"{RESULT}/phase": "Phase",
}
"""Diagrams in the order in which they are shown."""
_ROWS = 8
"""Curves that are listed, and drawn, the last ones."""
_UNITS = {
    **{"Hz": "Hz", "m": "m", "rad": "rad", "V": "V", "N_m": "N/m", "m_V": "m/V", "m_rtHz": "m/sqrt(Hz)"},
    **{"N": "N", "s": "s", "N_V": "N/V"},
}
"""By the end of a name: f0_Hz is in Hz."""
_KNOWN = {
    "ThermalTune": "spring constant",
    "CalibrateSensitivity": "sensitivity of the deflection",
    "CalibrateLateral": "sensitivity of the lateral signal",
}
"""What the one number of a result is."""


def titles(entities: Iterable[str]) -> dict[str, str]:
    """Diagrams among these entities with their titles, in the order in which they are shown."""
    there = {entity.rpartition("/")[0] for entity in entities if entity.startswith(f"{RESULT}/")}
    return {entity: title for entity, title in _TITLES.items() if entity in there}


def diagrams(result: Result) -> dict[str, Diagram]:
    """Curves of a result, by entity."""
    found = {name: each.values for name, each in result.arrays.variables.items()}
    along = result.arrays.coordinates.get("frequency")
    if {"z", "force", "phase"} <= found.keys():
        return {
            FORCE_CURVE: Diagram(Axis("z from the turn, towards the sample", "m"), Axis("force", "N"), _forces(found))
        }
    if {"position", "lateral"} <= found.keys():
        loop = DiagramLine(found["position"], found["lateral"], "trace and retrace", BLUE)
        return {FRICTION_LOOP: Diagram(Axis("position along the line", "m"), Axis("lateral force", "N"), [loop])}
    if along is not None and {"amplitude", "phase"} <= found.keys():
        fitted = found.get("fitted_amplitude")
        swept = {
            name: [DiagramLine(along.values, found[name], "measured", BLUE)]
            + ([DiagramLine(along.values, fitted, "fit", ORANGE)] if fitted is not None and name == "amplitude" else [])
            for name in ("amplitude", "phase")
        }
        return _both(Axis("frequency of the drive", "Hz"), swept)
    if {"z", "amplitude", "phase"} <= found.keys() and found["z"].ndim == 2:
        named = (("approach", BLUE), ("retract", ORANGE))
        ways = {
            name: [DiagramLine(z, y, *how) for z, y, how in zip(found["z"], found[name], named, strict=False)]
            for name in ("amplitude", "phase")
        }
        return _both(Axis("z, towards the sample", "m"), ways)
    return {}


def _both(x: Axis, curves: Mapping[str, Sequence[DiagramLine]]) -> dict[str, Diagram]:
    units = {"amplitude": "m", "phase": "rad"}
    return {f"{RESULT}/{name}": Diagram(x, Axis(name, units[name]), curves[name]) for name in units}


def _forces(found: Mapping[str, Any]) -> list[DiagramLine]:
    drawn = []
    for z, force, phase in zip(*(np.atleast_2d(found[name])[-_ROWS:] for name in ("z", "force", "phase")), strict=True):
        if np.isfinite(z).any():
            turn = float(np.nanmax(z))
            for part, name, color in ((APPROACH, "approach", BLUE), (RETRACT, "retract", ORANGE)):
                inside = phase == part
                drawn.append(DiagramLine(z[inside] - turn, force[inside], name, color))
    return drawn


# Tables.


def markdown(result: Result) -> str:
    """A result as a table with units."""
    arrays = result.arrays
    told = "" if result.status == "complete" else f" ({result.status})"
    lines = [f"### {result.verb}{told}", ""]
    if {"z", "force", "phase", "deflection_voltage"} <= arrays.variables.keys():
        lines += _curve_table(arrays)
    else:
        lines += _table(("", "value", "standard uncertainty"), _numbers(result))
    lines += [f"- {name}: {', '.join(map(str, each.values.shape))}" for name, each in _drawn_nowhere(result)]
    return "\n".join(lines)


def of_image(number: int, image: Image) -> str:
    """What a scan has come to up to now, as a table with units."""
    scan = image.scan
    lines = [f"### Scan {number}", ""]
    lines.append(
        f"{image.lines_done} of {scan.lines} lines of {scan.pixels} pixels, "
        f"{text(scan.size_x, 'm')} x {text(scan.height, 'm')}, {text(scan.line_rate, 'Hz')}"
    )
    rows = []
    made = [(f"{name}, {way}", values, image.units[name]) for (name, way), values in image.data.items()]
    if "lateral" in image.units:
        made.append(("friction", image.friction(), image.units["lateral"]))
    for name, values, unit in made:
        there = values[np.isfinite(values)]
        if there.size:
            numbers = (there.mean(), there.std(), there.min(), there.max())
            rows.append((name, *(text(float(each), unit, 3) for each in numbers)))
    return "\n".join([*lines, "", *_table(("", "mean", "rms about it", "least", "largest"), rows)])


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


def _numbers(result: Result) -> Iterator[tuple[str, str, str]]:
    """Name, value and uncertainty of each number of a result that the verb was not asked with."""
    for name, (dims, values, about) in result.arrays.variables.items():
        if not dims and values.dtype.kind in "fiu":
            unit, spread = str(about.get("units", "1")), about.get("uncertainty")
            known = name or _KNOWN.get(result.verb, "value")
            yield known, text(float(values), unit), _text(spread, unit)
            yield from _attributes({k: v for k, v in about.items() if k not in ("units", "uncertainty", "long_name")})
    asked = _fields(result.verb)
    yield from _attributes({name: value for name, value in result.arrays.attributes.items() if name not in asked})


def _attributes(values: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    for name, value in values.items():
        if isinstance(value, int | float) and not name.endswith("_uncertainty"):
            ends = [end for end in _UNITS if name.endswith(f"_{end}")]
            end = max(ends, key=len, default="")
            unit = _UNITS.get(end, "1")
            shown = name.removesuffix(f"_{end}").replace("_", " ") if end else name.replace("_", " ")
            yield shown, text(float(value), unit), _text(values.get(f"{name}_uncertainty"), unit)


def _text(value: Any, unit: str) -> str:
    return text(float(value), unit, 2, "") if isinstance(value, int | float) else ""


def _fields(verb: str) -> set[str]:
    """Names of what a verb is asked with; also how it is called."""
    snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in verb).removeprefix("_")
    # Its name comes from a message: nothing is imported for it.
    return {"verb", *(find(snake).model_fields if snake in registry.names("verb") else ())}


def _curve_table(arrays: Arrays) -> list[str]:
    """A row for each force curve: force at the turn, largest pull, way in contact."""
    found = {name: np.atleast_2d(each.values) for name, each in arrays.variables.items()}
    given = {**{name: each.values for name, each in arrays.coordinates.items()}, **arrays.attributes}
    count = len(found["z"])
    numbers = {
        name: np.broadcast_to(np.asarray(given.get(name, np.nan), np.float64), count)
        for name in ("deflection_sensitivity", "spring_constant", "triggered", "x", "y")
    }
    rows = []
    for k in range(count)[-_ROWS:]:
        moving = np.isfinite(found["z"][k]) & (found["phase"][k] != DWELL)
        z, volts = found["z"][k][moving], found["deflection_voltage"][k][moving]
        stiffness = float(numbers["spring_constant"][k])
        adhesion = contact = "-"
        largest = float(found["force"][k][moving].max(initial=-np.inf))
        try:
            read = force_curve(z, volts * float(numbers["deflection_sensitivity"][k]), stiffness)
            largest -= stiffness * read.baseline.value
            adhesion = " ± ".join(
                filter(None, (text(read.adhesion.value, "N", 3), _text(read.adhesion.uncertainty, "N")))
            )
            contact = text(float(z.max()) - read.contact_point, "m", 3)
        except (ValueError, FloatingPointError):
            pass
        place = f"{text(float(numbers['x'][k]), 'm', 3)}, {text(float(numbers['y'][k]), 'm', 3)}"
        turned = "by its trigger" if numbers["triggered"][k] else "at the end of its way"
        rows.append((str(k + 1), turned, text(largest, "N", 3, "-"), adhesion, contact, place))
    return _table(("curve", "turned", "force there", "largest pull", "z in contact", "x, y"), rows)


def _drawn_nowhere(result: Result) -> Iterator[tuple[str, Variable]]:
    """Yield the arrays of a result that is not drawn and not listed."""
    if not diagrams(result):
        yield from ((name, each) for name, each in result.arrays.variables.items() if each.dims)


def document(words: str) -> rr.ComponentColumnList:
    """A text as one row of the view."""
    return rr.TextDocument.columns(text=[words], media_type=[rr.MediaType.MARKDOWN])


def drawings(result: Result) -> dict[str, rr.ComponentColumnList]:
    """Table and diagrams of a result, by entity, one row each.

    Raises
    ------
    InvalidMessage
        If its arrays do not fit together.
    """
    try:
        drawn = {entity: diagram.draw() for entity, diagram in diagrams(result).items()}
        parts = {f"{entity}/{name}": part for entity, named in drawn.items() for name, part in named.items()}
        return {RESULT: document(markdown(result)), **parts}
    # Arrays of any shape and name may come; what numpy says of them is of any kind.
    except Exception as error:
        raise InvalidMessage(f"a result of {result.verb} that cannot be drawn: {error}") from None
