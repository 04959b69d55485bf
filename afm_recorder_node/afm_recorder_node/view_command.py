"""`ros2 run afm_recorder_node view A.rrd B.rrd`: several recordings in one viewer, side by side. Needs no ROS.

The viewer shows one recording at a time, and a plot only what is in it. So they are put together into one, each below
an entity of its own, with an arrangement that shows the same signal of all of them in one plot.
"""

import argparse
import re
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from . import layout, pictures, results
from .complete import chunks, ending, series, widen
from .layout import DEFLECTION, DRIVE, ERROR, LATERAL_FORCE, NORMAL_FORCE, POSITION, Signal
from .live import Server
from .readable import readable, recordings
from .recording import RecordingError
from .screens import Range, Ranges, tabbed
from .screens import readable as readable_range
from .streams import send_blueprint

APPLICATION = "afm_together"
"""Another one than that of a recording: its arrangement takes the place of no other one."""
COLORS = (
    ("red", (214, 69, 65)),
    ("blue", (58, 110, 200)),
    ("green", (60, 150, 80)),
    ("orange", (230, 140, 30)),
    ("violet", (140, 90, 190)),
    ("brown", (130, 90, 60)),
)
"""Of the curves of each recording; there are no more recordings than colours."""
_LEFT_OUT = (layout.PARAMETERS, layout.SCORE, layout.SCENE, pictures.LINES)


def names(paths: Sequence[Path]) -> list[str]:
    """A word for each recording: its name, or that of the first folder upwards that tells them apart."""
    parts = [path.absolute().with_suffix("").parts for path in paths]
    for depth in range(1, min(map(len, parts))):
        found = [re.sub(r"\W", "_", each[-depth], flags=re.ASCII) for each in parts]
        if len(set(found)) == len(found):
            return found
    return [f"recording_{number}" for number, _ in enumerate(paths, 1)]


def together(paths: Sequence[Path], target: Path) -> None:
    """Write several recordings into one file, for the viewer.

    Raises
    ------
    RecordingError
        If one cannot be read, or has been changed since it was written; if there are too many.
    FileExistsError
        If there is something at `target`.
    """
    if not 2 <= len(paths) <= len(COLORS):
        raise RecordingError(f"{len(paths)} recordings are not allowed: it must be 2 to {len(COLORS)}")
    if target.exists():
        raise FileExistsError(f"{target} exists: give another name, nothing is overwritten")
    entities: dict[str, set[str]] = {}
    ranges: dict[tuple[str, int], Range] = {}
    with ExitStack() as files:
        there = [files.enter_context(readable(path)) for path in paths]
        stream = files.enter_context(ending(rr.RecordingStream(APPLICATION, send_properties=False)))
        stream.set_sinks(rr.FileSink(str(target)))
        for (file, extent), name, (_, rgb) in zip(there, names(paths), COLORS, strict=False):
            entities[name] = _put(stream, file, name, ranges, whole=extent.complete)
            for each in (*layout.TICKS, *layout.CHANNELS):
                series = rr.SeriesLines(names=[f"{name}: {title}" for title in each.names], colors=[rgb] * each.width)
                stream.log(f"/{name}{each.entity}", series, static=True)
        send_blueprint(stream, arrangement(entities, ranges), APPLICATION)


def _put(
    stream: rr.RecordingStream, file: Path, name: str, ranges: dict[tuple[str, int], Range], *, whole: bool
) -> set[str]:
    """All that the viewer shows of a recording; its entities."""
    found = set()
    try:
        for chunk in chunks(file, whole=whole):
            entity = chunk.entity_path
            if entity.startswith("/__") or entity.startswith(_LEFT_OUT):
                continue
            stream.send_chunks(chunk.with_entity_path(f"/{name}{entity}"))
            found.add(entity)
            rows = None if chunk.is_static else series(chunk.to_record_batch())
            if rows is not None and len(rows[0]):
                widen(ranges, entity, rows[1].reshape(len(rows[0]), -1))
    except (RuntimeError, ValueError) as error:
        raise RecordingError(f"{name} is no readable recording: {error}") from error
    return found


def arrangement(entities: dict[str, set[str]], ranges: Ranges | None = None) -> rrb.Blueprint:
    """The same signal of all recordings in one plot; loops, images, results and scores side by side.

    Parameters
    ----------
    entities : dict of str to set of str
        Entities of each recording, by the name below which they stand.
    ranges : mapping, optional
        Of all of them together.
    """
    told = ", ".join(f"{name} {color}" for name, (color, _) in zip(entities, COLORS, strict=False))
    pictured = {name: found for name, each in entities.items() if (found := pictures.pictures(each))}
    drawn = {name: titled for name, each in entities.items() if (titled := results.titles(each))}

    def plot(name: str, each: Signal, axis: int | None = None) -> rrb.TimeSeriesView:
        shown = rr.SeriesLines.from_fields(visible_series=[axis in (None, k) for k in range(3)])
        contents = [f"/{recording}{each.entity}" for recording in entities]
        known = (ranges or {}).get((each.entity, axis or 0))
        span = readable_range(*known) if known else None
        return rrb.TimeSeriesView(
            name=f"{name} [{each.unit}]",
            origin="/",
            contents=contents,
            overrides=None if axis is None else {entity: shown.visualizer() for entity in contents},
            plot_legend=rrb.PlotLegend(visible=False),
            axis_y=rrb.ScalarAxis(range=span) if span else None,
        )

    def three(name: str, each: Signal) -> rrb.Container:
        return rrb.Tabs(*(plot(f"{name}, {axis}", each, k) for k, axis in enumerate("xyz")))

    signals = rrb.Vertical(
        rrb.Grid(
            three(f"Tracking error ({told})", ERROR),
            three("Drive", DRIVE),
            rrb.Tabs(plot("Lateral force, x", LATERAL_FORCE), plot("Normal force", NORMAL_FORCE)),
            three("Position", POSITION),
            rrb.Tabs(plot("Deflection", DEFLECTION), plot("Round trip", layout.ROUND_TRIP)),
            rrb.Tabs(
                *(
                    rrb.Spatial2DView(
                        name=f"Friction loop: {name}", origin=f"/{name}{layout.FRICTION_LOOP}", contents="$origin/**"
                    )
                    for name in entities
                )
            ),
            grid_columns=3,
        ),
        rrb.Horizontal(
            *(
                rrb.Tabs(
                    rrb.TextDocumentView(name=f"{name}: {color}", origin=f"/{name}{layout.RUN}"),
                    rrb.TextLogView(name="Events", origin=f"/{name}{layout.EVENTS}"),
                )
                for name, (color, _) in zip(entities, COLORS, strict=False)
            )
        ),
        row_shares=[3, 1],
        name="Signals",
    )
    screens: list[rrb.Container] = []
    if pictured:
        screens.append(
            rrb.Vertical(*(pictures.view(found, name, f"/{name}") for name, found in pictured.items()), name="Scans")
        )
    if drawn:
        screens.append(
            rrb.Horizontal(
                *(
                    rrb.Vertical(
                        *(
                            rrb.Spatial2DView(name=f"{name}: {title}", origin=f"/{name}{entity}", contents="$origin/**")
                            for entity, title in found.items()
                        ),
                        rrb.TextDocumentView(name="Result", origin=f"/{name}{layout.RESULT}"),
                    )
                    for name, found in drawn.items()
                ),
                name="Results",
            )
        )
    return tabbed(screens, signals, "together")


@contextmanager
def _served(paths: Sequence[Path]) -> Iterator[str]:
    """Serve recordings to the viewer in a browser; the link. Raises as `together`."""
    with ExitStack() as stack:
        if len(paths) > 1:
            file = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="afm_view_"))) / "together.rrd"
            together(paths, file)
        else:
            file, _ = stack.enter_context(readable(paths[0]))
        server = stack.enter_context(Server(source=file))
        server.wait()
        yield server.link


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="view", description="Show recordings in a web browser, several of them side by side; print the link."
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="files, folders, or patterns such as 'out/*/*.rrd'"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="write several into one file for `rerun` in place of serving them"
    )
    given = parser.parse_args()
    try:
        paths = recordings(given.recordings)
        if given.out:
            together(paths, given.out)
            return 0
        with _served(paths) as link:
            print(f"{link}\nCtrl-C ends it.", flush=True)
            over = threading.Event()
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, lambda *_: over.set())
            over.wait()
    except (RecordingError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
