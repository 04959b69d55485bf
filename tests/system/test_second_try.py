"""`make test` tries again what has failed, says so, and keeps how it failed first."""

import os
import subprocess
from pathlib import Path

from support import ROOT

FAILS_ONCE = """
from pathlib import Path

def test_that_fails_once():
    mark = Path(__file__).with_name("mark")
    before = mark.exists()
    mark.touch()
    print("said before it failed")
    assert before, "the first time it does"

def test_that_passes():
    pass
"""
FAILS_ALWAYS = "def test_that_fails_always():\n    assert False, 'as ever'\n"


def make_test(folder: Path, text: str) -> tuple[subprocess.CompletedProcess[str], Path]:
    """Run what `make test` runs, on a file of its own."""
    file, kept = folder / "test_some.py", folder / "kept" / "first_failures.txt"
    file.write_text(text)
    # A cache of its own: the one of the run that this test belongs to knows what has failed there.
    command = [ROOT / "tools" / "test.sh", "-c", ROOT / "pyproject.toml", "-o", f"cache_dir={folder / 'cache'}", file]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    # One worker has enough to do.
    environment |= {"FIRST_FAILURES": str(kept), "PYTEST_XDIST_AUTO_NUM_WORKERS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    return done, kept


def test_what_passes_the_second_time_is_told_and_how_it_failed_is_kept(tmp_path: Path) -> None:
    done, kept = make_test(tmp_path, FAILS_ONCE)
    assert done.returncode == 0, done.stdout + done.stderr
    *_, sentence, name = done.stdout.splitlines()
    assert sentence == f"Passed only when tried again, alone (how they failed first: {kept}):"
    assert "::test_that_fails_once (call)" in name
    told = kept.read_text()
    assert "the first time it does" in told
    assert "said before it failed" in told
    assert "test_that_passes" not in told


def test_what_fails_twice_fails_the_run_and_is_kept(tmp_path: Path) -> None:
    done, kept = make_test(tmp_path, FAILS_ALWAYS)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Passed only" not in done.stdout
    assert "as ever" in kept.read_text()


def test_a_run_without_failures_keeps_nothing(tmp_path: Path) -> None:
    done, kept = make_test(tmp_path, "def test_that_passes():\n    pass\n")
    assert done.returncode == 0, done.stdout + done.stderr
    assert not kept.exists()
