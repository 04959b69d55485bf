"""A session that runs a scenario from start to score: recording, picture, scorecard."""

import math
from dataclasses import dataclass

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from afm_model.core.errors import reason

from .follow import Follower, check_score
from .results_folder import CARD, PICTURE, RECORDING
from .session import Session
from .session_nodes import COMPOSED, EXTERNAL, OWN
from .session_scorecard import kinds, law_of, print_scorecard, scorecard, write_scorecard
from .session_start import SessionError

_OVERVIEW_TICKS = 250_000
"""Ticks that the picture shows at most; of a longer run one in several."""


@dataclass(eq=False)
class RunSession(Session):
    """One run of a scenario.

    Parameters
    ----------
    picture : bool
        Whether the overview is drawn.
    scenario, out, and the rest
        As of `Session`.
    """

    names = (PICTURE, CARD)

    picture: bool = True

    def _watch(self, follower: Follower) -> None:
        """Follow the run to its end."""
        # An external controller may be replaced while we run.
        controllers = 2 if self.controller == EXTERNAL else 1

        def over() -> bool:
            self._check(controllers=controllers)
            assert self._monitor.status is not None  # ready was true
            progress.update(bar, completed=self._monitor.status.ticks)
            return follower.finished()

        with Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.completed:.0f} of {task.total:.0f} ticks"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        ) as progress:
            bar = progress.add_task(self.scenario.name, total=self.scenario.sim.total_ticks)
            while not self._monitor.spin_until(over, 3600.0):
                pass

    def _finish(self, missing: str | None) -> None:
        # Here: a second in which a session that starts would only be importing.
        from afm_recorder_node.reader import read_recording
        from afm_recorder_node.recording import RecordingError

        score, status, work = self._monitor.score, self._monitor.status, self._folder.work
        assert score is not None and status is not None
        check_score(status)
        own = self.controller in (OWN, COMPOSED)
        node = " and ".join(status.controllers)
        controller = self.scenario.controller.law.kind if own else node
        recording, law = None, None
        if missing is None:
            try:
                recording = read_recording(work / RECORDING, every=math.ceil(status.ticks / _OVERVIEW_TICKS))
                law = law_of(recording, node)
                missing = f"the recording is incomplete: {recording.missing}" if recording.missing else None
            except RecordingError as error:
                missing = str(error)
        if own and law is not None:
            controller = kinds(law)
        card = scorecard(self.scenario, controller, score, status, law)
        title = f"{self.scenario.header.title or self.scenario.name} ({card['plant']} plant, {controller})"
        try:
            write_scorecard(card, work / CARD)
            if recording is not None and self.picture:
                from .session_pictures import draw_overview

                draw_overview(recording, title, work / PICTURE)
        except OSError as error:
            missing = missing or f"{error.filename or work} cannot be written: {reason(error)}"
        # The score is valid even if the recording is not.
        paths = self._folder.publish(complete=missing is None)
        print_scorecard(card, title)
        print("\nResults:", *map(str, paths))
        if missing is not None:
            raise SessionError(missing)
        print(f"Open the recording with: rerun {self.out / RECORDING}")
