"""The net under a change that is to change no number: hashes of many short runs and verbs, in process, without ROS.

    python tests/bits.py            # or `make bits`: compare with bits.json; exit code 1 if a hash differs
    python tests/bits.py --write    # after a change that is meant to change numbers; prints what has changed

The compositions are in bits.yaml. Their bits are those of every machine, but for FITTED: there scipy fits what was
measured. What the C library and numpy give is hashed as well, so that another machine is told from other code.
"""

import argparse
import ast
import dataclasses
import hashlib
import json
import math
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
import yaml

from afm_model import Controller, Scenario, build, load_scenario, simulate
from afm_model.microscope import Local, Microscope
from afm_model.parts.signals import Measurement
from afm_model.run import OVER, Latency, Listeners, Replay, Run, SimulatedLink, VirtualClock, simulate_realtime

FILE = Path(__file__).with_suffix(".json")
CASES = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text())
NAMES = [*CASES["runs"], *CASES["sessions"]]
FITTED = (
    "verbs, amplitude curve down to a share",
    *("verbs, tune, contact resonance", "verbs, thermal tune, sensitivity", "verbs, wedge"),
)
"""Compositions with the result of a fit by scipy, or of functions of numpy, whose last bits are those of a machine and
of a version; their trajectory is not."""
Hashes = dict[str, str]

# Where `examples.parts` is found.
sys.path.append(str(Path(__file__).parents[1]))


def digest(parts: Iterable[Any]) -> str:
    """SHA-256 of the bytes of arrays and numbers; every NaN is the same one."""
    found = hashlib.sha256()
    for part in parts:
        values = np.ascontiguousarray(part)
        if values.dtype.kind in "biuf":
            values = values.astype(np.float64)
            values[np.isnan(values)] = np.nan
        found.update(values.tobytes())
    return found.hexdigest()


@cache
def elementary() -> Hashes:
    """Hashes of what elementary functions give on this machine, in compiled code and in numpy."""
    x = np.random.default_rng(1).uniform(0.01, 4.0, 5000)
    names = ("sin", "cos", "tan", "tanh", "sinh", "cosh", "exp", "expm1", "log", "log10")

    @numba.njit
    def compiled(x):  # type: ignore[no-untyped-def]
        y = np.empty((x.size, 13))
        for i, v in enumerate(x):
            y[i, :5] = math.sin(v), math.cos(v), math.tan(v), math.tanh(v), math.sinh(v)
            y[i, 5:10] = math.cosh(v), math.exp(v), math.expm1(v), math.log(v), math.log10(v)
            y[i, 10:] = v ** (2.0 / 3.0), math.hypot(v, 1.0), math.erfc(v)
        return y

    matrix = x[:144].reshape(12, 12)  # no larger than those of the laws
    by_numpy = [
        *(getattr(np, name)(x) for name in names),
        x ** (2.0 / 3.0),
        np.hypot(x, 1.0),
        np.fft.rfft(x).view(float),
    ]
    by_numpy += [matrix @ matrix, np.linalg.solve(matrix, x[:12]), np.linalg.eigvalsh(matrix + matrix.T)]
    tall = x[:3000].reshape(1000, 3)  # as in a fit of scipy
    by_numpy += [tall.T @ tall, *np.linalg.svd(tall, full_matrices=False)]
    return {"compiled": digest([compiled(x)]), "numpy": digest(by_numpy)}


def _value(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (SyntaxError, ValueError):
        return {"true": True, "false": False}.get(text, text)


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return flat


def _changes(words: list[str]) -> dict[str, str]:
    """Text by name; sets are replaced by what they hold."""
    found: dict[str, str] = {}
    for word in words:
        name, is_change, text = word.partition("=")
        found |= {name: text} if is_change else _changes(CASES["sets"][word].split())
    return found


def scenario(words: list[str], folder: Path, law_of: str = "afm_controller_node") -> tuple[Scenario, dict[str, Any]]:
    """A scenario with changes, written to a file and read as any other; and what is said of the latency."""
    surface = np.arange(1024).reshape(32, 32) * 7919 % 11 * 0.02
    np.save(folder / "map.npy", surface)
    np.save(folder / "strength.npy", 0.5 + surface)
    base, *changes = words
    content = {} if base == "-" else yaml.safe_load(load_scenario(base).path.read_text())
    sections = {key: _flat(section["ros__parameters"]) for key, section in content.items()}
    owners = {"law": f"/**/{law_of}", "microscope": "/**", "latency": "latency"}
    for name, text in _changes(changes).items():
        section = sections.setdefault(owners.get(name.split(".")[0], "/**/afm_sim_node"), {})
        section[name] = _value(text.format(map=folder / "map.npy", strength=folder / "strength.npy"))
        if text == "":
            del section[name]
    latency = {name.removeprefix("latency."): value for name, value in sections.pop("latency", {}).items()}
    file = folder / "scenario.yaml"
    file.write_text(yaml.safe_dump({key: {"ros__parameters": section} for key, section in sections.items()}))
    parts = [value for section in sections.values() for name, value in section.items() if name.endswith(".kind")]
    return load_scenario(file, parts=[part for part in parts if ":" in part]), latency


class Asked:
    """A law of ours as an object of somebody else's: asked tick by tick."""

    def __init__(self, law: Controller) -> None:
        self._law = law

    def answer(self, measurement: Any) -> Any:
        """See `afm_model.run.simulated.Law`."""
        return self._law.answer(measurement)


class Proportional:
    """A law in Python."""

    def answer(self, measurement: Any) -> Any:
        """See `afm_model.run.simulated.Law`."""
        y = measurement.view(Measurement)[0]
        error = y.reference_position - np.array([y.position[0], y.position[1], y.deflection])
        return [3e9, 3e9, 5e7] * error + [6e4, 6e4, 8e3] * (y.reference_velocity - y.velocity)


def _of_run(sha256: str, score: Any, results: list[Any]) -> Hashes:
    numbers = [getattr(score, field.name) for field in dataclasses.fields(score)]
    return {"trajectory": sha256, "score": digest(numbers), "results": digest(results)}


def _of_blocks(sha256: str, score: Any, blocks: list[Any], counts: Any) -> Hashes:
    parts = [part for block in blocks for part in (block.measurements, block.states, block.drives, block.samples)]
    return _of_run(sha256, score, [*parts, [float(getattr(counts, name)) for name in counts.__slots__]])


def _run(given: Scenario, law: Any) -> Hashes:
    """In lockstep, with a law that answers at once or one inside; at first some ticks by steps."""
    clock, blocks = VirtualClock(), []
    link = SimulatedLink(law, clock, lambda: 0.0, given.sim.plant.control_period)
    run = Run(given.sim, link, clock, Listeners(block=lambda block, _: blocks.append(block)), block_ticks=500)
    run.step()
    for ticks in (1, 37) if given.sim.run.start_paused else ():
        assert run.step_by(ticks) == ""
        while run.stepping:
            run.step()
    if given.sim.run.start_paused:
        assert run.play() == ""
    while run.state not in OVER:
        run.step()
    return _of_blocks(run.instrument.trajectory_sha256(), run.instrument.score(), blocks, run.snapshot().counts)


def _pace(pacing: str, words: list[str], folder: Path) -> Hashes:
    given, latency = scenario(words, folder, "afm_sim_node" if pacing == "inside" else "afm_controller_node")
    law = Controller(given.controller)
    if pacing in ("lockstep", "inside"):
        return _run(given, law)
    if pacing == "realtime":
        late = simulate_realtime(given.sim, law, build(Latency, latency))
        return _of_blocks(late.trajectory_sha256, late.score, late.blocks, late.snapshot.counts)
    of = {"simulate": given.controller, "asked": Asked(law), "object": Proportional(), "replay": given.controller}
    run = simulate(given.sim, of[pacing])
    if pacing == "replay":
        run = simulate(given.sim, Replay(run.drive, given.sim.plant.delay_ticks))
    return _of_run(run.trajectory_sha256, run.score, [run.measurements, run.truth, run.drive, run.samples])


def _numbers(result: Any) -> list[Any]:
    """What a word of the microscope has returned."""
    if hasattr(result, "data_vars"):
        return [result[name] for name in sorted(result.variables) if result[name].dtype.kind in "biuf"]
    if hasattr(result, "attrs"):
        return [result.values, *(result.attrs[name] for name in sorted(result.attrs) if name != "units")]
    return list(vars(result).values()) if dataclasses.is_dataclass(result) else []


def _cancel(microscope: Microscope, after: int, fields: dict[str, Any]) -> list[Any]:
    """Ctrl-C behind line number `after` of a scan."""
    microscope.on_line = lambda line: signal.raise_signal(signal.SIGINT) if line.index == after else None
    try:
        microscope.scan(**fields)
    except KeyboardInterrupt:
        image = microscope.outcome.result
    microscope.on_line = None
    return [image.lines_done, *(image.data[key] for key in sorted(image.data))]


def _session(first: str, words: list[dict[str, dict[str, Any]]], folder: Path) -> Hashes:
    """Words of the microscope, one after the other: of each what it returned, and the trajectory up to its end."""
    given, _ = scenario(first.split(), folder)
    local = Local(given.sim, given.controller, hashed=True)
    hashes: Hashes = {}
    with Microscope(local) as microscope:
        for number, (word, fields) in enumerate(pair for each in words for pair in each.items()):
            if word == "cancel":
                found = _cancel(microscope, fields["after"], {k: v for k, v in fields.items() if k != "after"})
            else:
                found = _numbers(getattr(microscope, word)(**fields))
            hashes[f"{number} {word}"] = digest([*found, microscope.state.setpoint, *microscope.state.place])
            hashes[f"{number} trajectory"] = local.instrument.trajectory_sha256()
    return hashes


def compute(name: str, folder: Path) -> Hashes:
    """Hashes of the composition `name`, one of NAMES; in `folder` files are made on the way."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # such as that a law is made for another rate
        if name in CASES["sessions"]:
            first, *words = CASES["sessions"][name]
            return _session(first, words, folder)
        pacing, *changes = CASES["runs"][name].split()
        return _pace(pacing, changes, folder)


def kept() -> dict[str, Any]:
    """What is in the file: hashes of `functions`, and `hashes` by the names of compositions."""
    return json.loads(FILE.read_text()) if FILE.exists() else {"functions": {}, "hashes": {}}


def difference(name: str, found: Hashes) -> str:
    """What is not as it was kept, in a clause; empty if all is."""
    before = kept()["hashes"].get(name, {})
    differ = [each for each in before | found if before.get(each) != found.get(each)]
    return f"{name}: {', '.join(differ)}" if differ else ""


def other_machine() -> str:
    """Whether elementary functions give other bits than where the file was written, in a sentence; empty if not."""
    before = kept()["functions"]
    differ = [name for name, found in elementary().items() if before.get(name) != found]
    if not before or not differ:
        return ""
    return (
        f"elementary functions ({', '.join(differ)}) give other bits here than where {FILE.name} was written, which "
        "may be the reason: write it anew here with code that is known to be good, then compare"
    )


def fitted(told: str) -> bool:
    """Whether it is the result of a fit alone that differs, as it may on another machine; a trajectory may not."""
    name, _, clause = told.rpartition(": ")
    return name in FITTED and "trajectory" not in clause and bool(other_machine())


def main() -> int:
    """Entry point; the exit code is 1 if a hash differs that is the same on every machine."""
    parser = argparse.ArgumentParser(prog="python tests/bits.py", description="Compare hashes of runs with those kept.")
    parser.add_argument("--write", action="store_true", help=f"keep in {FILE.name} what is found")
    parser.add_argument("parts", nargs="*", help="only compositions whose names contain one of these")
    arguments = parser.parse_args()
    names = [name for name in NAMES if not arguments.parts or any(part in name for part in arguments.parts)]
    if arguments.write and arguments.parts and set(names) & set(FITTED) and other_machine():
        parser.error("results of fits are those of this machine, the file is of another: write all compositions")
    hashes = kept()["hashes"]
    differ = [f"{name}: there is no such composition any more" for name in hashes if name not in NAMES]
    begin = time.process_time()
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            hashes[name] = compute(name, Path(folder))
        differ += filter(None, [difference(name, hashes[name])])
    print(*differ, sep="\n", end="\n" * bool(differ))
    print(f"{len(names)} compositions, {len(differ)} differ; {time.process_time() - begin:.0f} s of processor time")
    faults = [told for told in differ if not fitted(told)]
    if differ and not faults:
        print("only results of fits, whose last bits are those of a machine and of scipy; no trajectory differs")
    elif differ and (sentence := other_machine()):
        print(sentence)
    if arguments.write:
        # Results of fits and of functions are those of one machine: they are kept together.
        functions = kept()["functions"] if arguments.parts else elementary()
        content = {"functions": functions, "hashes": {name: hashes[name] for name in NAMES if name in hashes}}
        FILE.write_text(json.dumps(content, indent=1) + "\n")
    return 1 if faults and not arguments.write else 0


if __name__ == "__main__":
    sys.exit(main())
