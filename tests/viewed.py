"""Views of records, and what is in them, read with rerun's own reader."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray
from recorded import Topic, record
from rerun.chunk import Chunk, RrdReader

from afm_recorder_node import layout
from afm_recorder_node.views import make_view


def view(path: Path, messages: Iterable[Topic], **given: Any) -> Path:
    """The view run.rrd of a record run.mcap of messages."""
    make_view(record(path.with_suffix(".mcap"), messages, **given), path)
    return path


def chunks(path: Path, entity: str = "") -> Iterator[Chunk]:
    """What a view holds, of one entity or of all."""
    reader = RrdReader(path)
    for store in reader.recordings():
        for chunk in reader.stream(store=store):
            if not entity or chunk.entity_path == entity:
                yield chunk


def series(path: Path, entity: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Times [ns] and numbers of a signal, in order of time."""
    times, values = [np.empty(0, np.int64)], []
    for chunk in chunks(path, entity):
        if not chunk.is_static:
            batch = chunk.to_record_batch()
            times.append(batch.column(layout.TIMELINE).cast("int64").to_numpy())
            values.append(batch.column("Scalars:scalars").flatten().to_numpy().reshape(len(times[-1]), -1))
    time = np.concatenate(times)
    order = np.argsort(time, kind="stable")
    return time[order], np.concatenate(values)[order].squeeze()


def column(path: Path, entity: str, component: str) -> list[Any]:
    """Values of a component, one for each row that has it."""
    found = [chunk.to_record_batch() for chunk in chunks(path, entity)]
    return [each for batch in found if component in batch.schema.names for each in batch.column(component).to_pylist()]


def events(path: Path) -> list[tuple[int, str]]:
    """Times [ns] and texts of the events, in order of time."""
    found = []
    for chunk in chunks(path, layout.EVENTS):
        batch = chunk.to_record_batch()
        times = batch.column(layout.TIMELINE).cast("int64").to_pylist()
        found += [(time, text[0]) for time, text in zip(times, batch.column("TextLog:text").to_pylist(), strict=True)]
    return sorted(found)


def panels(part: object) -> list[rrb.View]:
    """Views of an arrangement."""
    if isinstance(part, rrb.View):
        return [part]
    return [panel for inner in part.contents for panel in panels(inner)]  # type: ignore[attr-defined]
