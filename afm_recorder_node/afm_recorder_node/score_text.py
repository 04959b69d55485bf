"""The score of a recording as text with units, for a terminal and for the viewer. Needs no ROS."""

from collections.abc import Mapping

from afm_model.core.prefix import prefixed, text

_VECTORS = {"rms": "m", "max": "m", "max_percent": "%", "drive_total_variation": "V/s", "extent": "m"}
"""Vectors of a score, and their units."""
_NAMES = {
    "rms": "tracking error, rms",
    "max": "tracking error, max",
    "max_percent": "in percent of the amplitude",
    "drive_total_variation": "drive, total variation",
    "extent": "position, max",
}
_SHARES = {"stick_fraction": "stick", "contact_fraction": "in contact", "retracted_fraction": "retracted"}


def vectors(score: Mapping[str, object]) -> list[tuple[str, str, str, str]]:
    """Rows of a table: name with unit, and the values of x, y and the tip's z."""
    rows = []
    for name, unit in _VECTORS.items():
        vector = score.get(name)
        if isinstance(vector, dict):
            factor, unit = prefixed(unit, *vector.values())
            x, y, z = (f"{factor * vector[axis]:.4g}" for axis in "xyz")
            rows.append((f"{_NAMES[name]} [{unit}]", x, y, z))
    return rows


def facts(score: Mapping[str, object]) -> list[str]:
    """What is no vector, each in a few words."""
    told = [
        f"{what} {100.0 * share:.4g} %" for name, what in _SHARES.items() if isinstance(share := score.get(name), float)
    ]
    for what in ("friction", "normal_force"):
        low, high = score.get(f"{what}_min"), score.get(f"{what}_max")
        if isinstance(low, float) and isinstance(high, float):
            factor, unit = prefixed("N", low, high)
            told.append(f"{what.replace('_', ' ')} {factor * low:.4g} to {factor * high:.4g} {unit}")
    counted = {name: value for name, value in score.items() if type(value) is int and value and name != "run_id"}
    told += [f"{name.replace('_', ' ')} {value}" for name, value in counted.items()]
    trip = score.get("round_trip")
    if isinstance(trip, dict):
        told.append(
            "round trip " + ", ".join(f"{name} {text(value, 's', unknown='-')}" for name, value in trip.items())
        )
    return told


def markdown(title: str, score: Mapping[str, object] | None = None) -> str:
    """Title and score as the viewer shows them."""
    lines = [f"### {title}", ""]
    if score is None:
        return "\n".join([*lines, "No score yet."])
    lines += ["| score | x | y | z (tip) |", "|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in vectors(score)]
    lines += ["", *(f"- {fact}" for fact in facts(score))]
    lines += [f"- {name}: {score[name]}" for name in ("reason", "warning") if score.get(name)]
    return "\n".join(lines)
