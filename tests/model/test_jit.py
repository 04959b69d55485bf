"""Claims about compilation: one machine code per kernel, the same numbers without it, no stale cache."""

import json
import os
import pickle
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from afm_model.compiled import cache as kernel_cache
from afm_model.compiled import jit
from afm_model.compiled.sources import Sources, has_kernels, write

SESSION = """
import json, sys
import numpy as np
from afm_model import Controller, ControllerParameters, Instrument, InstrumentParameters, build

rows = []
for values in {values}:
    scope = Instrument(build(InstrumentParameters, values), 400)
    for kind in ("open_loop", "tanh", "sgn"):
        law = Controller(build(ControllerParameters, {{"law.kind": kind}}))
        scope.reset()
        for _ in range({ticks}):
            scope.tick(law.answer(scope.measurement))
        rows.append(list(scope.state.tolist()) + scope.measurement.tolist())
        scope.take_block()
"""
PLANTS = [
    {"plant.control_period": 4e-6, "reference.omega_x": 500.0, "reference.shape_y": "triangle", "detector.noise": 1e-3},
    {"plant.kind": "paper", "detector.adc_bits": 12, "detector.position_noise": 1e-12},
    {"plant.kind": "paper", "plant.z": "uniform"},
    {"plant.kind": "paper", "plant.z": "held"},
    {"fault.kind": "scheduled", "fault.late.kind": "jitter", "fault.late.signal": "drive", "fault.late.size": 4e-6},
]


def in_a_new_process(script: str, **environment: str) -> str:
    """Standard output of a Python script in a process of its own."""
    package = str(Path(jit.__file__).resolve().parents[1])
    path = os.pathsep.join([package, os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": path} | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=800,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_plain_python_gives_the_numbers_of_the_compiled_kernels():
    script = SESSION.format(values=repr(PLANTS), ticks=50) + (
        "from afm_model.instrument.tick import tick\nprint(json.dumps([hasattr(tick, 'signatures'), rows]))"
    )
    compiled, compiled_rows = json.loads(in_a_new_process(script))
    compiled_too, plain_rows = json.loads(in_a_new_process(script, NUMBA_DISABLE_JIT="1"))
    assert (compiled, compiled_too) == (True, False)
    one, other = np.array(compiled_rows), np.array(plain_rows)
    # Two compilers may round the last bit differently; 200 steps of a stable motion do not amplify it.
    assert (np.abs(other - one) <= 1e-9 * np.abs(one).max(axis=0)).all()


def test_a_session_compiles_each_kernel_once():
    report = """
from afm_model.instrument import controller, tick
# What kernels call among themselves they hand over as pointers; a session calls with arrays.
called = lambda signature: not any("CPointer" in str(kind) or "float64*" in str(kind) for kind in signature)
kernels = (tick.advance, tick.start, controller.answer)
print(json.dumps({{k.__name__: sum(map(called, k.signatures)) for k in kernels}}))
""".replace("{{", "{").replace("}}", "}")
    counts = json.loads(in_a_new_process(SESSION.format(values=repr(PLANTS), ticks=3) + report))
    assert counts == {"advance": 1, "start": 1, "answer": 1}


TOY = {
    "__init__.py": "",
    "callee.py": "from .jit import kernel\n\n@kernel\ndef inner(x):\n    return {factor} * x\n",
    "caller.py": "from .callee import inner\nfrom .jit import kernel\n\n"
    "@kernel\ndef outer(x):\n    return inner(x) + 1.0\n",
    "files.py": "from .caller import outer\n\nWIDTH = {factor}\n",
}
CALL = """
import sys
sys.path.insert(0, {folder!r})
from numba import types
from toy import files
from toy.caller import outer
from toy.jit import callback
result = outer(10.0)
made = callback(types.float64(types.float64), outer.py_func)
print(result, made.ctypes(10.0), sum(outer._cache_hits.values()), made.cache_hits)
"""


@pytest.fixture
def toy(tmp_path):
    """A package with two kernels, the sources of the cache copied in, and how to write and run it."""

    class Toy:
        package, cache = tmp_path / "toy", tmp_path / "cache"
        script = CALL.format(folder=str(tmp_path))

        def write(self, name: str, factor: float = 2.0, more: str = "") -> None:
            (self.package / name).write_text(TOY[name].format(factor=factor) + more)
            # Older than the process and than its cache, as after `git stash` or an edit of the callee alone.
            os.utime(self.package / name, (1e9, 1e9))

        def run(self, cache: Path | None = None) -> tuple[float, int]:
            """What the kernel gives, as a C function too, and how many of the two were found on disk."""
            environment = {"NUMBA_CACHE_DIR": str(cache or self.cache), "PYTHONDONTWRITEBYTECODE": "1"}
            result, by_callback, *hits = map(float, in_a_new_process(self.script, **environment).split())
            assert result == by_callback
            return result, int(sum(hits))

    made = Toy()
    made.package.mkdir()
    for name in ("jit.py", "cache.py", "pieces.py", "sources.py"):
        (made.package / name).write_text((Path(jit.__file__).parent / name).read_text())
        os.utime(made.package / name, (1e9, 1e9))
    for name in TOY:
        made.write(name)
    return made


def test_kernels_that_came_with_a_package_for_any_processor_are_compiled_by_nobody(toy):
    for_any = toy.cache.with_name("for_any")
    in_a_new_process(
        toy.script, NUMBA_CACHE_DIR=str(for_any), PYTHONDONTWRITEBYTECODE="1", **kernel_cache.ANY_PROCESSOR
    )
    shutil.copytree(for_any / "afm_model", toy.package.with_name("kernels"))
    assert toy.run() == (21.0, 2)
    assert not list(toy.cache.rglob("outer*"))
    toy.write("callee.py", factor=3.0)
    assert toy.run() == (31.0, 0)


def test_edit_compiles_anew_what_depends_on_it_and_nothing_else(toy):
    assert toy.run() == (21.0, 0)
    assert toy.run() == (21.0, 2)
    toy.write("files.py", factor=3.0)  # imports the kernel, is not imported by it
    toy.write("callee.py", more="    # a comment\n")
    (toy.package / "caller.py").write_text(
        '"""A docstring."""\n\n' + TOY["caller.py"].replace(":\n", ':\n    """Too."""\n')
    )
    os.utime(toy.package / "caller.py", (1e9, 1e9))
    assert toy.run() == (21.0, 2)
    # An edit in a callee of another file.
    toy.write("callee.py", factor=3.0)
    assert toy.run() == (31.0, 0)
    # Both versions stand on disk.
    toy.write("callee.py", factor=2.0)
    assert toy.run() == (21.0, 2)


def test_what_only_compiled_code_calls_is_a_piece_of_it_and_no_file(toy):
    toy.run()
    assert {file.name.partition("-")[0] for file in toy.cache.rglob("toy*/*")} == {"outer"}
    assert toy.run() == (21.0, 2)


def test_kernels_call_one_another_and_themselves_and_functions_of_others_call_them(tmp_path):
    script = tmp_path / "calls.py"
    script.write_text("""
import numba
from afm_model.compiled.jit import callback, kernel, routine

@kernel
def twice(x):
    print("twice", x)
    return 2.0 * x

@routine
def factorial(n):
    return 1.0 if n < 1 else n * factorial(n - 1)

@routine
def both(x):
    return twice(x) + factorial(x)

@numba.njit
def foreign(x):
    return both(x) + twice(x)

number = numba.float64
print(both(3.0), foreign(3.0), twice(4.0), factorial(3.0), callback(number(number), both.py_func).ctypes(4.0))
""")
    printed = "twice 3.0\ntwice 3.0\ntwice 3.0\ntwice 4.0\ntwice 4.0\n12.0 18.0 8.0 6.0 32.0\n"
    run = f"import runpy; runpy.run_path({str(script)!r})"
    # Compiled, and as it was kept.
    for _ in range(2):
        assert in_a_new_process(run, NUMBA_CACHE_DIR=str(tmp_path)) == printed


def test_routine_is_called_by_a_kernel_that_calls_it_twice_and_not_compiled_into_it(tmp_path):
    script = tmp_path / "calls.py"
    line = "    x += math.exp(-x) * math.sqrt(x)\n"
    script.write_text(f"""
import math
from afm_model.compiled.jit import kernel, routine

@routine
def long(x):
{line * 50}
    return x

@kernel
def twice(x):
    return long(x) + long(2.0 * x)

@kernel
def outer(x):
    return twice(x)

outer(1.0)
defined = [line for code in outer.inspect_llvm().values() for line in code.splitlines() if line.startswith("define")]
print(sum("long" in line for line in defined), sum("twice" in line for line in defined))
""")
    run = f"import runpy; runpy.run_path({str(script)!r})"
    assert in_a_new_process(run, NUMBA_CACHE_DIR=str(tmp_path)) == "1 0\n"


def test_processes_at_once_compile_into_one_cache(toy):
    with ThreadPoolExecutor(2) as threads:
        assert {result for result, _ in threads.map(lambda _: toy.run(), range(2))} == {21.0}
    assert toy.run() == (21.0, 2)


def test_what_one_process_compiles_another_one_waits_for(toy):
    # The first one is about to compile; the second one is asked for the same kernel meanwhile.
    begins = (
        "outer._cache.load_overload((types.float64,), outer.targetctx)\nprint('begins', flush=True)\ninput()\nresult"
    )
    first = toy.script.replace("result", begins, 1)
    waits = "from toy import cache\ncache.time.sleep = lambda _: print('waits', flush=True)\nresult"
    second = toy.script.replace("result", waits, 1)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(toy.cache), "PYTHONDONTWRITEBYTECODE": "1"}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": environment}
    with subprocess.Popen([sys.executable, "-c", first], **pipes) as one:
        assert one.stdout.readline() == "begins\n"
        with subprocess.Popen([sys.executable, "-c", second], **pipes) as other:
            assert other.stdout.readline() == "waits\n"
            one.communicate("\n", timeout=60)
            *_, last = other.communicate(timeout=60)[0].splitlines()
    assert last.split()[:3] == ["21.0", "21.0", "1"]
    assert not list(toy.cache.rglob("*.lock"))


def test_kernel_that_cannot_be_compiled_keeps_none_waiting(toy):
    fails = "try:\n    outer('text')\nexcept Exception:\n    print('fails')\nresult"
    toy.script = toy.script.replace("result", fails, 1)
    assert in_a_new_process(toy.script, NUMBA_CACHE_DIR=str(toy.cache)).startswith("fails\n21.0")
    assert not list(toy.cache.rglob("*.lock"))


@pytest.mark.long
def test_cache_that_cannot_be_written_or_read_ends_no_process(toy, tmp_path):
    occupied = tmp_path / "file"
    occupied.touch()
    assert toy.run(cache=occupied) == (21.0, 0)
    toy.run()
    for kept in toy.cache.rglob("*-*/*"):
        kept.write_bytes(b"")
    assert toy.run() == (21.0, 0)


def _opened(path: Path) -> None:
    path.chmod(path.stat().st_mode | 0o022)


def _given_away(path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can make files of another user")
    os.chown(path, 4711, 4711)


@pytest.mark.parametrize("done_to", [_opened, _given_away])
@pytest.mark.parametrize("which", ["kernel", "."])
def test_kernel_that_another_user_can_have_written_is_not_unpickled(tmp_path, which, done_to):
    kept, ran = tmp_path / "kernels" / "kernel", tmp_path / "ran"

    class Planted:
        def __reduce__(self):
            return os.mkdir, (str(ran),)

    write(kept, pickle.dumps(Planted()))
    assert kernel_cache._read(kept, None) is None and ran.exists()  # a file of this user's is believed
    ran.rmdir()
    done_to(kept.parent / which)
    assert kernel_cache._read(kept, None) is None and not ran.exists()


@pytest.mark.parametrize(
    ("done_to", "said"),
    [
        (_opened, "other users can write to {0}, and their code would be run: chmod"),
        (_given_away, "{0} belongs to user 4711"),
    ],
)
def test_folder_of_kernels_that_others_can_write_to_is_not_used_and_is_named(toy, tmp_path, done_to, said):
    folder = toy.cache / "afm_model"
    folder.mkdir(parents=True)
    done_to(folder)
    told = in_a_new_process("import sys; sys.stderr = sys.stdout\n" + toy.script, NUMBA_CACHE_DIR=str(toy.cache))
    assert said.format(folder) in told and told.endswith("21.0 21.0 0 0\n")
    assert not any(folder.iterdir())


@pytest.mark.long
def test_kernels_are_kept_for_this_user_under_any_umask(toy):
    before = os.umask(0)
    try:
        toy.run()
    finally:
        os.umask(before)
    assert toy.run() == (21.0, 2)


def test_source_edited_while_a_process_runs_is_kept_for_no_other(tmp_path):
    source = tmp_path / "edited.py"
    source.write_text("from afm_model.compiled.jit import kernel\n")
    os.utime(source, (2e9, 2e9))
    assert not Sources(None).fingerprint("edited", str(source))[1]
    os.utime(source, (1e9, 1e9))
    assert Sources(None).fingerprint("edited", str(source))[1]


def test_kernels_of_the_loop_do_not_depend_on_files_and_studies(tmp_path):
    copy = tmp_path / "afm_copy"
    shutil.copytree(Path(jit.__file__).parents[1], copy)
    has_kernels("afm_copy", str(copy / "__init__.py"))
    tick = copy / "instrument" / "tick.py"

    def after(*files: str) -> str:
        for file in files:
            with (copy / file).open("a") as source:
                source.write("\nEDITED = 1\n")
        return Sources(None).fingerprint("afm_copy.instrument.tick", str(tick))[0]

    before = after()
    others = "files/gwyddion.py", "microscope/operator.py", "run/run.py", "studies/sweep.py", "analysis/force_curves.py"
    assert after(*others) == before
    assert len({before, after("compiled/records.py"), after("sample/paper.py"), after("instrument/tick.py")}) == 4


def test_what_is_unused_or_too_much_is_removed_once_a_day(tmp_path, monkeypatch):
    now = time.time()
    for age in (0, 10, 20, 40):
        (tmp_path / f"kernels-{age}").mkdir()
        (tmp_path / f"kernels-{age}" / "one").write_bytes(bytes(100))
        os.utime(tmp_path / f"kernels-{age}", (now - age * 86400.0,) * 2)

    def left() -> list[int]:
        return sorted(int(each.name.partition("-")[2]) for each in tmp_path.glob("kernels-*"))

    kernel_cache.clean(tmp_path)
    assert left() == [0, 10, 20]
    monkeypatch.setattr(kernel_cache, "LARGEST", 250)
    kernel_cache.clean(tmp_path)
    assert left() == [0, 10, 20]  # it has been looked at today
    os.utime(tmp_path / "cleaned", (now - 2 * 86400.0,) * 2)
    kernel_cache.clean(tmp_path)
    assert left() == [0, 10]


def test_other_users_of_numba_keep_their_cache(tmp_path):
    script = "import afm_model\nfrom numba.core import config\nprint(config.CACHE_DIR)"
    assert in_a_new_process(script, NUMBA_CACHE_DIR=str(tmp_path)).strip() == str(tmp_path)
