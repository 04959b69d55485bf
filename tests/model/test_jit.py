"""Claims about compilation: one machine code per kernel, the same numbers without it, no stale cache."""

import json
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from afm_model.core import jit

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
        timeout=300,
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
}


def test_editing_a_callee_in_another_file_takes_effect(tmp_path):
    package, cache = tmp_path / "toy", tmp_path / "cache"
    package.mkdir()
    (package / "jit.py").write_text(Path(jit.__file__).read_text())
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from toy import jit\nfrom toy.caller import outer\nprint(outer(10.0), jit._CACHE_DIRECTORY)"
    )
    results, folders = [], []
    for factor in (2.0, 3.0, 2.0):
        for name, text in TOY.items():
            (package / name).write_text(text.format(factor=factor))
        # A caller older than its cache, as after an edit of the callee alone.
        os.utime(package / "caller.py", (1e9, 1e9))
        result, folder = in_a_new_process(script, NUMBA_CACHE_DIR=str(cache), PYTHONDONTWRITEBYTECODE="1").split()
        results.append(float(result))
        folders.append(folder)
    assert results == [21.0, 31.0, 21.0]
    assert folders[0] != folders[1]
    assert folders[0] == folders[2]
    assert all(Path(folder).parent == cache for folder in folders)
    # Both versions stand on disk: the third run found the first one's code.
    assert len(list(cache.iterdir())) == 2


def test_other_users_of_numba_keep_their_cache(tmp_path):
    script = "import afm_model\nfrom numba.core import config\nprint(config.CACHE_DIR)"
    assert in_a_new_process(script, NUMBA_CACHE_DIR=str(tmp_path)).strip() == str(tmp_path)


def test_thread_that_compiles_while_another_ends_to_keeps_the_cache_folder() -> None:
    before = jit.config.CACHE_DIR
    entered, left = threading.Event(), threading.Event()

    def second() -> str:
        with jit._cache_here():
            entered.set()
            left.wait(10.0)
            return str(jit.config.CACHE_DIR)

    with ThreadPoolExecutor(1) as thread:
        with jit._cache_here():
            seen = thread.submit(second)
            # It has to wait for us; if it did not, it would be here at once.
            entered.wait(0.2)
        left.set()
        assert seen.result() == jit._CACHE_DIRECTORY
    assert jit.config.CACHE_DIR == before
