"""A microscope that is given verbs, other samples, other probes and resets, and what its processes use meanwhile."""

import random
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import yaml
from quick_lever import INSTRUMENT, LAW
from std_srvs.srv import Trigger
from support import TIMEOUT, Command, executable

from afm_bringup.remote import Remote
from afm_model.microscope.verbs import Approach, ForceCurve, FrictionLoop, MoveTo, Scan, Withdraw
from afm_node_common import topics
from soak.sampling import Sample, sample

SIMULATOR, RECORDER = NAMES = ("afm_sim_node", "afm_recorder_node")
_APPROACH = Approach(rate=10e-6, range=2e-6, settle=2e-3)
_VERBS = (
    MoveTo(x=5e-9, y=-5e-9),
    ForceCurve(lift=100e-9, ramp=200e-9, approach_rate=5e-6, retract_rate=5e-6, trigger_force=20e-9),
    FrictionLoop(length=40e-9, line_rate=20.0),
    Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=4, line_rate=20.0, overscan=0.2, speed=5e-6),
)


class VerbSoak:
    """A simulator with its law inside, a recorder, and a client in this process. Use as a context manager.

    Parameters
    ----------
    out : Path
        Folder for parameters, output and recordings; a recording that is complete is removed.
    """

    def __init__(self, out: Path) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self._out, self._rng = out, random.Random(1)
        parameters = out / "parameters.yaml"
        parameters.write_text(yaml.safe_dump({"/**/afm_sim_node": {"ros__parameters": INSTRUMENT | LAW}}))
        arguments = {SIMULATOR: ["--params-file", parameters], RECORDER: ["-p", f"path:={out / 'run.rrd'}"]}
        self._commands = {
            name: Command(
                executable(name, name), "--ros-args", *arguments[name], "-r", f"__ns:=/{topics.NAMESPACE}", folder=out
            )
            for name in NAMES
        }
        self._remote = Remote(patience=TIMEOUT)
        self.rounds = self.recordings = 0

    def __enter__(self) -> "VerbSoak":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._remote.close()
            for command in self._commands.values():
                command.interrupt()
                command.process.wait(TIMEOUT)
        finally:
            for command in self._commands.values():
                command.__exit__()

    def round(self) -> dict[str, Sample]:
        """Some verbs, then another sample, another probe or a reset, with which the next recording begins."""
        self._remote.execute(_APPROACH)
        for verb in self._rng.choices(_VERBS, k=4):
            self._remote.execute(verb)
        self._remote.execute(Withdraw())
        match self.rounds % 3:
            case 0:
                self._remote.exchange("sample", {"width": self._rng.uniform(10e-9, 30e-9)})
            case 1:
                self._remote.exchange("plant", {"tip_radius": self._rng.uniform(10e-9, 30e-9)})
            case 2:
                self._remote._remote.call(Trigger, topics.RESET)
        self.rounds += 1
        for path in self._out.glob("run*.rrd"):
            if not path.stem.endswith((".partial", ".closing")):
                path.unlink()
                self.recordings += 1
        return {name: sample(command.process.pid) for name, command in self._commands.items()}


def soak_verbs(
    out: Path, *, seconds: float, warm_up: float, told: Callable[[str], object], rounds: int = 0
) -> tuple[Mapping[str, list[Sample]], int]:
    """Rounds for a wall time, and so many at least; those of the warm-up [s] before are not sampled.

    Returns
    -------
    (mapping, int)
        Samples of each process by name; recordings completed.
    """
    samples: dict[str, list[Sample]] = {name: [] for name in NAMES}
    with VerbSoak(out) as microscope:
        begin = told_at = now = time.monotonic()
        while now < begin + warm_up + seconds or len(samples[SIMULATOR]) < rounds:
            used, now = microscope.round(), time.monotonic()
            if now >= begin + warm_up:
                for name in NAMES:
                    samples[name].append(used[name])
            if now >= told_at + 60.0:
                told_at = now
                memory = ", ".join(f"{name} {used[name].memory / 1e6:.1f} MB" for name in NAMES)
                told(f"{(now - begin) / 60.0:.0f} min, {microscope.recordings} recordings: {memory}")
    return samples, microscope.recordings
