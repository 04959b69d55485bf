"""A session that makes an image: starts simulator and recorder, approaches, scans, withdraws, writes files."""

import math
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from afm_model import Scenario
from afm_model.core.errors import ParameterError, VerbError, reason
from afm_model.microscope.image import Image
from afm_model.microscope.results import COMPLETE, Outcome, Standing
from afm_model.microscope.results import Progress as Told
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Approach, Scan, Withdraw
from afm_node_common import topics
from afm_node_common.runner import StopSignal

from .follow import Follower
from .remote import Remote
from .results_folder import RECORDING
from .session import Session
from .session_nodes import INSIDE
from .session_start import SessionError, say

if TYPE_CHECKING:
    from afm_recorder_node.recording import Recording

PNG, SHEET, GWY, SXM, TABLE = "scan.png", "channels.png", "scan.gwy", "scan.sxm", "scan.csv"
_SILENCE = 10.0
"""Wall time from one word of how far it is to the next, where there is no terminal for a bar [s]."""
_LINES_TIMEOUT = 10.0
"""Wall time without a new line at the recorder after which those that are missing are lost [s]."""


class ScanSession(Session):
    """One image, by the verbs of the microscope over topics.

    Parameters
    ----------
    scenario : Scenario
        With `reference.kind` verbs.
    out : Path
        Folder of the results.
    scan : Scan
    approach : Approach, optional
    namespace : str
    live : bool
        As of `Session`.
    """

    names = (PNG, SHEET, GWY, SXM, TABLE)

    def __init__(
        self,
        scenario: Scenario,
        out: Path,
        scan: Scan,
        approach: Approach | None = None,
        *,
        namespace: str = topics.NAMESPACE,
        live: bool = False,
    ) -> None:
        super().__init__(scenario, out, INSIDE, namespace=namespace, live=live)
        self._scan, self._approach = scan, approach or Approach()
        self._image: Image | None = None
        self._wall: dict[str, float] = {}
        self._failure = ""
        self._ticks = 0
        """Control ticks at the end of the last verb."""

    def _watch(self, follower: Follower) -> None:
        """Do the verbs, one after the other."""

        def check() -> None:
            if self._stop.requested:
                remote.stop()
            else:
                self._check()

        with Remote(self.namespace, check=check) as remote:
            try:
                self._do(remote)
                self._wait_until_recorded()
            except KeyboardInterrupt:
                self._stop.requested = True
            finally:
                if remote.outcome is not None and isinstance(remote.outcome.result, Image):
                    self._image = remote.outcome.result
        if self._stop.requested:
            if self._image is not None and self._image.lines_done:
                self._write(self._image)
            raise StopSignal

    def _do(self, remote: Remote) -> None:
        for verb in (self._approach, self._scan, Withdraw()):
            name = type(verb).__name__
            begin = time.monotonic()
            outcome = self._execute(remote, verb)
            self._wall[name] = time.monotonic() - begin
            if isinstance(outcome.result, Image):
                self._image = outcome.result
            elif isinstance(outcome.result, Standing):
                self._ticks = round(outcome.result.time / self.scenario.sim.plant.control_period)
            if self._stop.requested:
                return
            if outcome.status != COMPLETE:
                # What was scanned up to there is written all the same.
                self._failure = f"{name}: {outcome.message}"
                return
            if not self._console.is_terminal:
                say(f"{name}: done in {self._wall[name]:.1f} s")

    def _execute(self, remote: Remote, verb: Verb) -> Outcome:
        with Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TextColumn("{task.fields[detail]}", markup=False),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
        ) as progress:
            name, said = type(verb).__name__, time.monotonic()
            bar = progress.add_task(f"{name:<8}", total=1.0, detail="")

            def told(news: Told) -> None:
                nonlocal said
                if not math.isfinite(news.fraction):
                    return
                progress.update(bar, completed=news.fraction, detail=news.detail)
                if not self._console.is_terminal and time.monotonic() > said + _SILENCE:
                    said = time.monotonic()
                    say(f"{name}: {100.0 * news.fraction:.0f} %, {news.detail}")

            try:
                outcome = remote.execute(verb, told)
            except (ParameterError, VerbError) as error:
                raise SessionError(str(error)) from None
            if outcome.status == COMPLETE:
                progress.update(bar, completed=1.0, detail="")
        return outcome

    def _wait_until_recorded(self) -> None:
        """Wait for the last lines at the recorder, and for the last word of the simulator: time stands still now."""
        lines, before = 2 * self._image.lines_done if self._image is not None else 0, -1

        def arrived() -> int:
            return int(self._monitor.recorder.lines) if self._monitor.recorder is not None else 0

        def more(before: int) -> bool:
            return self._check_alive() or arrived() > before

        def told() -> bool:
            status, recorder = self._monitor.status, self._monitor.recorder
            if status is None or recorder is None:
                return False
            # Neither is a word from before the last verb.
            return self._ticks <= min(status.ticks, recorder.ticks) and recorder.ticks <= status.ticks

        while arrived() < lines and arrived() > before:
            before = arrived()
            self._monitor.spin_until(partial(more, before), _LINES_TIMEOUT)
        self._monitor.spin_until(lambda: self._check_alive() or told(), _LINES_TIMEOUT)

    def _finish(self, missing: str | None) -> None:
        from afm_recorder_node.reader import read_recording
        from afm_recorder_node.recording import RecordingError

        image, recording = self._image, None
        if image is None:
            raise SessionError(self._failure or "nothing was scanned")
        if missing is None:
            try:
                recording = read_recording(self._folder.work / RECORDING, every=1_000_000)
                missing = _not_recorded(image, recording)
            except RecordingError as error:
                missing = str(error)
        try:
            self._write(image)
        except OSError as error:
            missing = missing or f"{error.filename or self._folder.work} cannot be written: {reason(error)}"
        paths = self._folder.publish(complete=missing is None)
        self._show(image, paths)
        for failure in (self._failure, missing):
            if failure:
                raise SessionError(failure)

    def _write(self, image: Image) -> None:
        """The files of an image, in the folder of what is under way."""
        from afm_model.files import write_gwy, write_sheet, write_sxm, write_table

        from .session_pictures import write_scan_picture

        title = self.scenario.header.title or self.scenario.name
        work = self._folder.work
        write_scan_picture(work / PNG, image, title)
        write_sheet(work / SHEET, image, title)
        write_gwy(work / GWY, image)
        write_sxm(work / SXM, image)
        write_table(work / TABLE, image)

    def _show(self, image: Image, paths: Sequence[Path]) -> None:
        from afm_model.core.prefix import prefixed
        from afm_model.files.layer_statistics import figures

        table = Table(title=escape(self.scenario.header.title or self.scenario.name), title_justify="left")
        for heading, justify in (("", "left"), ("mean", "right"), ("least", "right"), ("largest", "right")):
            table.add_column(heading, justify=justify)  # type: ignore[arg-type]
        for each in figures(image):
            numbers = (each.mean, each.least, each.largest)
            factor, unit = prefixed(each.unit, *numbers)
            table.add_row(escape(f"{each.title} [{unit}]"), *(f"{factor * number:.4g}" for number in numbers))
        console = Console(width=None if Console().is_terminal else 100)
        console.print(table)
        lasted = image.lines_done / image.line_rate if image.line_rate else math.nan
        console.print(
            f"{image.lines_done} of {image.scan.lines} lines of {image.scan.pixels} pixels, {lasted:.3g} s of the "
            f"instrument's time, {self._wall.get('Scan', math.nan):.3g} s of yours."
        )
        print("\nResults:", *map(str, paths))
        print(f"Look at {self.out / PNG}; open {self.out / GWY} with Gwyddion, and the recording with:")
        print(f"rerun {self.out / RECORDING}")


def _not_recorded(image: Image, recording: "Recording") -> str | None:
    """A sentence about what of the image is not in the recording, if anything."""
    found = recording.images[-1] if recording.images else Image.empty(image.scan, image.units)
    lacking = sum(
        not np.array_equal(ours, theirs, equal_nan=True)
        for key, values in image.data.items()
        for ours, theirs in zip(values, found.data.get(key, np.full(image.scan.lines, np.nan)), strict=False)
    )
    return f"the recording is incomplete: {lacking} rows of the images are not in it" if lacking else None
