"""Recordings that somebody has made by hand: parts that run code, texts that are none, names of terminals."""

import contextlib
import io
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from random import Random

import rerun as rr
from recorded import Run
from support import Graph

from afm_bringup import identify_command, replay_command
from afm_model.core.schema import flatten
from afm_model.parameters import SimParameters
from afm_model.parameters.strict_yaml import yaml_text
from afm_recorder_node import inspect_command, layout
from afm_recorder_node.writer import RecordingWriter
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


def _text(rng: Random, values: dict[str, object]) -> str:
    """Parameters as a recorder writes them, with something wrong in them as a rule."""
    text = yaml_text({"afm_sim_node": {"ros__parameters": values}})
    for _ in range(rng.randrange(4)):
        at = rng.randrange(len(text) + 1)
        piece = rng.choice([*_PIECES, "".join(chr(rng.randrange(32, 0x2500)) for _ in range(rng.randrange(1, 30)))])
        text = text[:at] + piece * rng.choice([1, 1, 1, 50]) + text[at + rng.choice([0, 0, 5, 500]) :]
    return text


@contextmanager
def family(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """Each is answered in a sentence, and nothing of it is run."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "evilmod.py").write_text("raise SystemExit('evilmod was run')\n")
    sys.path.insert(0, str(folder))

    def one(rng: Random, outcome: Outcome) -> None:
        values: dict[str, object] = dict(flatten(SimParameters()))
        for name in rng.sample(_KINDS, rng.randrange(1, 3)):
            values[name] = rng.choice(["evilmod:X", "evilmod:", ":", "\x1b[31m", "os:system", "flat\n"])
        path = folder / f"{outcome.number}.rrd"
        path.unlink(missing_ok=True)
        with closing(RecordingWriter(path)) as writer:
            Run(20).write(writer, 0, 20)
            entity = rng.choice((layout.PARAMETERS, layout.PARAMETERS, layout.PARAMETERS, layout.SCORE))
            writer._sink.static(entity, rr.TextDocument(_text(rng, values)))
        codes = []
        for main, options in (
            (inspect_command.main, []),
            (inspect_command.main, ["--table"]),
            (replay_command.main, []),
            (identify_command.main, []),
        ):
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
                codes.append(main([str(path), *options]))
            told = out.getvalue() + err.getvalue()
            assert "\x1b" not in told and "Traceback" not in told, told[-300:]
        assert "evilmod" not in sys.modules, "a module that the recording names was imported"
        outcome.what = "refused in a sentence" if 2 in codes[:1] else "read, nothing run"

    try:
        yield one
    finally:
        sys.path.remove(str(folder))
