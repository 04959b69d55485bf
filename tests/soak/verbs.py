"""A microscope that is given verbs, other samples, other probes and resets, and what its processes use meanwhile."""

import os
import random
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import yaml
from afm_msgs.msg import RecorderStatus
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
        arguments = {SIMULATOR: ["--params-file", parameters], RECORDER: ["-p", f"path:={out / 'run.mcap'}"]}
        self._commands = {
            name: Command(
                executable(name, name), "--ros-args", *arguments[name], "-r", f"__ns:=/{topics.NAMESPACE}", folder=out
            )
            for name in NAMES
        }
        self._remote = Remote(patience=TIMEOUT)
        self._client = self._remote._remote
        self.rounds = self.recordings = self._ticks = 0
        self._client.node.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_recorder, 10)

    def _on_recorder(self, message: RecorderStatus) -> None:
        self._ticks = message.ticks

    def __enter__(self) -> "VerbSoak":
        return self

    def begin(self) -> None:
        """Wait until the recorder records."""
        # A run that began before the recorder listened is none that it has to complete.
        limit = time.monotonic() + TIMEOUT
        while not self._client.spin_until(lambda: self._ticks > 0, 0.5):
            if time.monotonic() > limit:
                raise TimeoutError("the recorder records nothing")
            self._remote.execute(_APPROACH)
            self._remote.execute(Withdraw())

    def __exit__(self, *_: object) -> None:
        try:
            self._remote.close()
            for command in self._commands.values():
                command.interrupt()
                command.process.wait(TIMEOUT)
        finally:
            for command in self._commands.values():
                command.__exit__()

    def _completed(self) -> bool:
        """Whether there is a recording of each round before, and none of them is open any more."""
        for path in self._out.glob("run*.rrd"):  # the views are made last
            path.unlink()
            path.with_suffix(".mcap").unlink()
            self.recordings += 1
        folder = Path(f"/proc/{self._commands[RECORDER].process.pid}/fd")
        files = []
        for entry in folder.iterdir():
            # It may be closed meanwhile.
            with suppress(FileNotFoundError):
                files.append(os.readlink(entry))
        return self.recordings == self.rounds and sum(".mcap" in file for file in files) == 1

    def round(self) -> dict[str, Sample]:
        """Some verbs, then another sample, another probe or a reset, with which the next recording begins.

        What is used is read when all recordings before are completed: at work the recorder has up to five files open.
        """
        self._remote.execute(_APPROACH)
        assert self._client.spin_until(self._completed, TIMEOUT), f"recording {self.rounds} is not completed"
        used = {name: sample(command.process.pid) for name, command in self._commands.items()}
        for verb in self._rng.choices(_VERBS, k=4):
            self._remote.execute(verb)
        self._remote.execute(Withdraw())
        match self.rounds % 3:
            case 0:
                self._remote.exchange("sample", {"width": self._rng.uniform(10e-9, 30e-9)})
            case 1:
                self._remote.exchange("plant", {"tip_radius": self._rng.uniform(10e-9, 30e-9)})
            case 2:
                self._client.call(Trigger, topics.RESET)
        self.rounds += 1
        return used


def soak_verbs(
    out: Path, *, seconds: float, warm_up: float, told: Callable[[str], object], rounds: int = 0, warm_rounds: int = 0
) -> tuple[Mapping[str, list[Sample]], int]:
    """Rounds for a wall time, and so many at least; those of the warm-up before are not sampled: a wall time [s], and
    so many rounds, however long a busy machine takes for them.

    Returns
    -------
    (mapping, int)
        Samples of each process by name; recordings, all of them completed.
    """
    samples: dict[str, list[Sample]] = {name: [] for name in NAMES}
    with VerbSoak(out) as microscope:
        microscope.begin()
        begin = told_at = now = time.monotonic()
        warm_until = begin + warm_up
        while now < warm_until + seconds or len(samples[SIMULATOR]) < rounds:
            used, now = microscope.round(), time.monotonic()
            if microscope.rounds <= warm_rounds:
                warm_until = max(warm_until, now)
            elif now >= warm_until:
                for name in NAMES:
                    samples[name].append(used[name])
            if now >= told_at + 60.0:
                told_at = now
                memory = ", ".join(f"{name} {used[name].memory / 1e6:.1f} MB" for name in NAMES)
                told(f"{(now - begin) / 60.0:.0f} min, {microscope.recordings} recordings: {memory}")
    return samples, microscope.recordings
