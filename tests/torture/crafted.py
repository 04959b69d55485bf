"""Recordings that somebody has made by hand: parts that run code, texts that are none, names of terminals."""

import contextlib
import io
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

import recorded
from afm_msgs.msg import Score
from recorded import Topic
from support import Graph

from afm_bringup import identify_command, replay_command
from afm_model.core.schema import flatten
from afm_model.parameters import SimParameters
from afm_recorder_node import inspect_command
from afm_recorder_node.recording import IncompleteRecording
from torture.family import Try
from torture.outcome import Outcome

_KINDS = [f"{group}.kind" for group in ("sample", "piezo", "plant", "reference", "detector", "onboard", "fault", "law")]
_PIECES = (
    "[",
    "]",
    "{",
    "}",
    ":",
    "- ",
    "&a ",
    "*a",
    "!!python/name:os.system",
    "\n",
    " ",
    "null",
    "\x1b[2J",
    "9" * 400,
)


def _text(rng: Random) -> str:
    piece = rng.choice([*_PIECES, "".join(chr(rng.randrange(1, 0x2500)) for _ in range(rng.randrange(1, 30)))])
    return piece * rng.choice([1, 1, 1, 50])


def _messages(rng: Random) -> Iterator[Topic]:
    """A run as a recorder writes it, with something wrong in its texts."""
    values: dict[str, Any] = dict(flatten(SimParameters()))
    for name in rng.sample(_KINDS, rng.randrange(1, 3)):
        values[name] = rng.choice(["evilmod:X", "evilmod:", ":", "\x1b[31m", "os:system", "flat\n"])
    for name in rng.sample(sorted(values), rng.randrange(4)):
        values[rng.choice([name, name + _text(rng), _text(rng)])] = rng.choice([_text(rng), None, float("nan"), [True]])
    kinds = (bool, int, float, str, list, type(None))
    known = {name: each for name, each in values.items() if isinstance(each, kinds) and each != []}
    yield recorded.parameters(rng.choice(["afm_sim_node", "afm_sim_node", _text(rng)]), known)
    yield from recorded.Run(20).block(0, 20)
    yield recorded.event(1e-5, _text(rng))
    yield "score", Score(ticks=20, trajectory_sha256=_text(rng), reason=_text(rng), run_id=1)


@contextmanager
def family(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """Each is answered in a sentence, and nothing of it is run."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "evilmod.py").write_text("raise SystemExit('evilmod was run')\n")
    sys.path.insert(0, str(folder))

    def one(rng: Random, outcome: Outcome) -> None:
        path = folder / f"{outcome.number}.mcap"
        path.unlink(missing_ok=True)
        about = {"title": _text(rng), "namespace": "/afm"}
        recorded.record(path, _messages(rng), {"missing": _text(rng) if rng.random() < 0.3 else ""}, about)
        codes = []
        for main, options in (
            (inspect_command.main, []),
            (inspect_command.main, ["--table"]),
            (replay_command.main, []),
            (identify_command.main, []),
        ):
            with (
                contextlib.redirect_stdout(io.StringIO()) as out,
                contextlib.redirect_stderr(io.StringIO()) as err,
                warnings.catch_warnings(),
            ):
                warnings.simplefilter("ignore", IncompleteRecording)
                codes.append(main([str(path), *options]))
            told = out.getvalue() + err.getvalue()
            assert "\x1b" not in told and "Traceback" not in told, told[-300:]
        assert "evilmod" not in sys.modules, "a module that the recording names was imported"
        outcome.what = "refused in a sentence" if 2 in codes[:1] else "read, nothing run"

    try:
        yield one
    finally:
        sys.path.remove(str(folder))
