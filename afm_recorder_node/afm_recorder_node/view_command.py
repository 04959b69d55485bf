"""`ros2 run afm_recorder_node view A.mcap B.mcap`: recordings in a web browser, several side by side. Needs no ROS.

The viewer shows one recording at a time, and a plot only what is in it. So several are drawn into one, each below its
own entity, with an arrangement that shows the same signal of all of them in one plot.
"""

import argparse
import re
import signal
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import rerun.blueprint as rrb

from . import layout, pictures, result_views
from .canvas import Range, send_blueprint
from .layout import DEFLECTION, DRIVE, ERROR, LATERAL_FORCE, NORMAL_FORCE, POSITION, ROUND_TRIP
from .live import LiveServer
from .places import open_recording, recordings
from .recording import RecordingError
from .screens import Plots, Ranges, plane, tabbed
from .view_writer import ViewWriter
from .views import light, make_view, written

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


def names(paths: Sequence[Path]) -> list[str]:
    """Return a word for each recording: its name, or that of the first folder upwards that differs for all of them."""
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
    OSError
        If there is something at `target`, or it cannot be written.
    """
    if not 2 <= len(paths) <= len(COLORS):
        raise RecordingError(f"{len(paths)} recordings are not allowed: it must be 2 to {len(COLORS)}")
    entities: dict[str, Iterable[str]] = {}
    ranges: dict[tuple[str, int], Range] = {}
    found = [open_recording(path) for path in paths]
    with written(target, APPLICATION) as (stream, expected):
        for record, name, (_, color) in zip(found, names(paths), COLORS, strict=False):
            writer = ViewWriter(stream, record.about, name, below=f"/{name}", color=color, ranges=ranges)
            writer.draw(record)
            entities[name] = writer.canvas.sent
            expected.update({f"/{name}{entity}": rows for entity, rows in writer.canvas.sent.items()})
        send_blueprint(stream, arrangement(entities, ranges), APPLICATION)


def arrangement(entities: Mapping[str, Iterable[str]], ranges: Ranges | None = None) -> rrb.Blueprint:
    """The same signal of all recordings in one plot; loops, images, results and scores side by side.

    Parameters
    ----------
    entities : mapping of str to iterable of str
        Entities of each recording, by the name below which they stand.
    ranges : mapping, optional
        Of all of them together.
    """
    colored = ", ".join(f"{name} {color}" for name, (color, _) in zip(entities, COLORS, strict=False))
    pictured = {name: found for name, each in entities.items() if (found := pictures.pictures(each))}
    drawn = {name: titled for name, each in entities.items() if (titled := result_views.titles(each))}
    plots = Plots(ranges or {}, [f"/{name}" for name in entities])
    texts = [
        rrb.Tabs(
            rrb.TextDocumentView(name=f"{name}: {color}", origin=f"/{name}{layout.RUN}"),
            rrb.TextLogView(name="Events", origin=f"/{name}{layout.EVENTS}"),
        )
        for name, (color, _) in zip(entities, COLORS, strict=False)
    ]
    signals = rrb.Vertical(
        rrb.Grid(
            rrb.Tabs(*plots.three(f"Tracking error ({colored})", ERROR)),
            rrb.Tabs(*plots.three("Drive", DRIVE)),
            rrb.Tabs(plots.one("Lateral force, x", LATERAL_FORCE), plots.one("Normal force", NORMAL_FORCE)),
            rrb.Tabs(*plots.three("Position", POSITION)),
            rrb.Tabs(plots.one("Deflection", DEFLECTION), plots.one("Round trip", ROUND_TRIP)),
            rrb.Tabs(*(plane(f"Friction loop: {name}", f"/{name}{layout.FRICTION_LOOP}") for name in entities)),
            grid_columns=3,
        ),
        rrb.Horizontal(*texts),
        row_shares=[3, 1],
        name="Signals",
    )
    screens: list[rrb.Container] = []
    if pictured:
        images = (pictures.view(found, name, f"/{name}") for name, found in pictured.items())
        screens.append(rrb.Vertical(*images, name="Scans"))
    if drawn:
        columns = (
            rrb.Vertical(
                *(plane(f"{name}: {title}", f"/{name}{entity}") for entity, title in found.items()),
                rrb.TextDocumentView(name="Result", origin=f"/{name}{layout.RESULT}"),
            )
            for name, found in drawn.items()
        )
        screens.append(rrb.Horizontal(*columns, name="Results"))
    return tabbed(screens, signals)


@contextmanager
def _served(paths: Sequence[Path]) -> Iterator[str]:
    """Serve recordings to the viewer in a browser; the link. Raises as `together`."""
    with tempfile.TemporaryDirectory(prefix="afm_view_") as folder:
        file = Path(folder) / "view.rrd"
        if len(paths) > 1:
            together(paths, file)
        else:
            make_view(paths[0], file)
        with LiveServer(source=file) as server:
            server.wait()
            yield server.link


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="view", description="Show recordings in a web browser, several of them side by side; print the link."
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="files, folders, or patterns such as 'out/*/*.mcap'"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="write a file for `rerun` in place of serving it")
    given = parser.parse_args()
    light()
    try:
        paths = recordings(given.recordings)
        if given.out:
            together(paths, given.out) if len(paths) > 1 else make_view(paths[0], given.out)
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
