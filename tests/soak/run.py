"""A session that lasts, and what each of its processes uses meanwhile."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import yaml
from afm_msgs.msg import InstrumentStatus
from support import TIMEOUT, Graph, Observer, session

from afm_model.parameters.scenario_files import scenario_file
from soak.sampling import Sample, sample

_ENDLESS = 1e6
"""Simulated time that no run reaches [s]."""
_ENDING = 900.0
"""Wall time that the end may take [s]: the recording of half an hour is copied once, and made complete."""


def endless(name: str, path: Path) -> Path:
    """A shipped scenario without an end, written to `path`."""
    content = yaml.safe_load(scenario_file(name).read_text())
    content["/**/afm_sim_node"]["ros__parameters"]["run"]["duration"] = _ENDLESS
    path.write_text(yaml.safe_dump(content))
    return path


def soak(
    scenario: Path,
    out: Path,
    *,
    seconds: float,
    warm_up: float,
    every: float,
    told: Callable[[str], object],
    ticks: int = 0,
) -> Mapping[str, list[Sample]]:
    """Run a session for a time, then end it as Ctrl-C does.

    Parameters
    ----------
    scenario : Path
        Of a run that lasts longer.
    out : Path
        Folder of the session's results.
    seconds : float
        Wall time that is sampled, after `warm_up` [s].
    warm_up : float
        Wall time since the run has begun that is not [s].
    every : float
        Between two samples [s].
    told : callable
        Called now and then with a line that tells how far it is.
    ticks : int
        Control ticks that are warming up as well, however long a busy machine takes for them.

    Returns
    -------
    mapping
        Samples of each process of the session, by name.

    Raises
    ------
    AssertionError
        If the session does not end as it should.
    """
    out.mkdir(parents=True, exist_ok=True)
    with Graph(rest=0.1) as graph, session(scenario, out, folder=out) as command:
        observer = graph.add(Observer())
        command.wait_until(lambda: observer.status.state == InstrumentStatus.RUNNING, graph)
        names = {command.process.pid: "session"} | {pid: _name(line) for pid, line in command.descendants.items()}
        samples: dict[str, list[Sample]] = {name: [] for name in names.values()}
        command.wait_until(lambda: observer.status.ticks >= ticks, graph)
        begin = time.monotonic()
        due = begin + warm_up
        told_at = begin
        while due <= begin + warm_up + seconds:
            command.wait_until(lambda due=due: time.monotonic() >= due, graph, warm_up + every + TIMEOUT)
            try:
                for pid, name in names.items():
                    samples[name].append(sample(pid))
            except OSError:
                command.wait(graph, _ENDING)
                raise AssertionError(f"the session has ended by itself: {command.text}") from None
            if time.monotonic() >= told_at + 60.0:
                told_at = time.monotonic()
                told(f"{(told_at - begin) / 60.0:.0f} min, {observer.status.ticks} ticks: {_memory(samples)}")
            due += every
        command.interrupt()
        code = command.wait(graph, _ENDING)
        assert code == 130, f"the session ended with code {code}: {command.text}"
    return samples


def _name(line: str) -> str:
    """Name of a process of a session by its command line."""
    for word in line.split():
        if Path(word).stem in ("afm_sim_node", "afm_controller_node", "afm_recorder_node", "cleanup"):
            return Path(word).stem
    raise AssertionError(f"no process of a session: {line}")


def _memory(samples: Mapping[str, list[Sample]]) -> str:
    return ", ".join(f"{name} {series[-1].memory / 1e6:.1f} MB" for name, series in samples.items())
