"""Images of scans in a recording: where they stand, and how the viewer shows them."""

from collections.abc import Iterable
from typing import Literal

import rerun.blueprint as rrb

from afm_model.microscope.image import RETRACE, TRACE

from .layout import SCANS

_UNITS = {"height": "nm", "error": "V", "lateral": "nN", "friction": "nN", "crosstalk": "nN", "x": "nm", "y": "nm"}
_TOGETHER = (("height",), ("friction", "crosstalk"), ("lateral",), ("error",))
"""Channels that share a place in the viewer, the most important first; each other one has its own place."""
_COLORS: Literal["inferno"] = "inferno"


def picture_of(name: str, direction: str = "") -> str:
    """Entity of the image of a channel in one direction of a scan, or of what is made of both."""
    return f"{SCANS}/{name}/{direction}" if direction else f"{SCANS}/{name}"


def pictures(entities: Iterable[str]) -> list[str]:
    """Which of these entities are images."""
    return sorted(entity for entity in entities if entity.startswith(f"{SCANS}/"))


def view(entities: Iterable[str], name: str = "Scan", below: str = "") -> rrb.Container:
    """Arrange images: those of one signal in tabs, different signals side by side.

    Parameters
    ----------
    entities : iterable of str
    name : str
        Of the arrangement.
    below : str
        Entity below which they stand.
    """
    places: dict[tuple[str, ...], list[str]] = {}
    for entity in entities:
        channel, _ = _channel(entity)
        place = next((names for names in _TOGETHER if channel in names), (channel,))
        places.setdefault(place, []).append(entity)
    known = [place for place in _TOGETHER if place in places]
    ordered = known + sorted(set(places) - set(known))
    tabs = ([_image(entity, below) for entity in sorted(places[place], key=_rank)] for place in ordered)
    return rrb.Grid(*(rrb.Tabs(*images) for images in tabs), name=name)


def _channel(entity: str) -> tuple[str, str]:
    """Name of the channel and direction; no direction if it is made of both."""
    name, _, direction = entity.removeprefix(f"{SCANS}/").rpartition("/")
    return (name, direction) if direction in (TRACE, RETRACE) else (entity.removeprefix(f"{SCANS}/"), "")


def _rank(entity: str) -> tuple[int, bool]:
    name, direction = _channel(entity)
    order = [each for names in _TOGETHER for each in names]
    return order.index(name) if name in order else len(order), direction == RETRACE


def _image(entity: str, below: str) -> rrb.TensorView:
    name, direction = _channel(entity)
    title = name.capitalize() + (f", {direction}" if direction else "")
    return rrb.TensorView(
        name=f"{title} [{_UNITS[name]}]" if name in _UNITS else title,
        origin=f"{below}{entity}",
        contents=[f"{below}{entity}"],
        scalar_mapping=rrb.TensorScalarMapping(colormap=_COLORS, mag_filter="nearest"),
        view_fit="FillKeepAspectRatio",
    )
