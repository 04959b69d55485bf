"""Claims about classes of one's own in a comparison: what they do wrong costs their own row, and what they are told."""

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from afm_model import ParameterError, Scenario, SimParameters, build, compare
from afm_model.studies import contender

from .short import EXAMPLES, SHORT


def test_class_that_raises_costs_no_other_run(cluster, own, tmp_path, monkeypatch):
    (tmp_path / "raising.py").write_text(
        "class Bad:\n    def __init__(self, sim):\n        raise OSError('no licence')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    table = compare(["raising:Bad", "pid"], periods=[5e-5], scheduler=cluster, **SHORT).table
    assert table["error"].iloc[0] == "law raising:Bad: OSError: no licence"
    assert math.isfinite(table["error_max"].iloc[1])


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("None", "drive None is not allowed: every measurement must be answered, with three voltages or a Command"),
        ("drive + 0j", "is not allowed: it must be three real numbers"),
        ("Command(drive + 0j)", "is not allowed: it must be three real numbers"),
        ("Command(drive, [drive + 0j], 1e-5)", "a horizon of complex128 is not allowed: it must be of real numbers"),
        ("['1', '2', '3']", "drive ['1', '2', '3'] is not allowed: it must be three real numbers"),
        ("[0, [1], 2]", "drive [0, [1], 2] is not allowed: it must be three voltages"),
    ],
)
def test_what_is_no_drive_is_the_error_of_the_row(cluster, own, tmp_path, monkeypatch, answer, words):
    name = f"odd_{abs(hash(answer))}"
    (tmp_path / f"{name}.py").write_text(
        "from pd_class import Pd\n"
        "from afm_model import Command\n"
        "class Bad(Pd):\n"
        "    ticks = 0\n"
        "    def answer(self, measurement):\n"
        "        drive = super().answer(measurement)\n"
        "        self.ticks += 1\n"
        f"        return drive if self.ticks <= 5 else {answer}\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    error = compare([f"{name}:Bad"], periods=[5e-5], scheduler=cluster, **SHORT).table["error"].iloc[0]
    assert words in error
    if "Command" not in answer:
        assert error.endswith("(answer to measurement 5 from Bad)")


def test_text_of_a_law_is_one_line_however_it_is_written(tmp_path, monkeypatch):
    (tmp_path / "knowing.py").write_text("class Law:\n    knowledge = 'nothing\\n  pid is given: all'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert contender("knowing:Law").knowledge == "nothing pid is given: all"
    assert contender("  pid   slowness=1 ").label == "pid slowness=1"


def test_class_that_exits_costs_no_other_run(cluster, own, tmp_path, monkeypatch):
    (tmp_path / "exiting.py").write_text("class Bad:\n    def __init__(self, sim):\n        raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    table = compare(["exiting:Bad", "pid"], periods=[5e-5], scheduler=cluster, **SHORT).table
    assert table["error"].iloc[0] == "law exiting:Bad: SystemExit: 3"
    assert math.isfinite(table["error_max"].iloc[1])


def test_module_that_exits_is_told_in_a_sentence(tmp_path, monkeypatch):
    (tmp_path / "leaving.py").write_text("raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ParameterError, match=r"law leaving:Law cannot be loaded: SystemExit: 3"):
        compare(["leaving:Law"])


@pytest.mark.long
def test_class_that_ends_its_worker_is_named(tmp_path):
    (tmp_path / "ending.py").write_text(
        "import os\nfrom pd_class import Pd\nclass Bad(Pd):\n    def answer(self, measurement):\n        os._exit(0)\n"
    )
    script = tmp_path / "script.py"
    script.write_text(
        "from afm_model import SweepError, compare\n"
        "if __name__ == '__main__':\n"
        "    try:\n"
        "        compare(['pid', 'ending:Bad', 'pd_class:Pd'], periods=[5e-5, 2e-4], references=['sine 2500'],\n"
        "                workers=1, progress=False)\n"
        "    except SweepError as error:\n"
        "        print(error)\n"
    )
    path = os.pathsep.join([str(tmp_path), str(EXAMPLES), os.environ.get("PYTHONPATH", "")])
    # One failure is allowed, not three: each takes the start of a worker.
    environment = os.environ | {"PYTHONPATH": path, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    words = (
        "2 worker processes have ended, one after the other, in the same runs, those of law ending:Bad: something in"
    )
    assert done.stdout.startswith(words)


def test_friction_noise_and_seed_are_told_to_no_object(cluster, tmp_path, monkeypatch):
    (tmp_path / "asking.py").write_text(
        "class Ask:\n"
        "    def __init__(self, sim):\n"
        "        told = sim.contact.tau, sim.detector.noise, sim.plant.delay_ticks, sim.plant.seed\n"
        "        raise OSError(f'{told}')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    conditions = {"friction": [1.2], "noise": [1.0], "delay_ticks": [2], "scheduler": cluster}
    scenario = Scenario("seeded", Path("seeded.yaml"), sim=build(SimParameters, {"plant.seed": 7}))
    table = compare(["asking:Ask"], scenario, **conditions, **SHORT).table
    assert table["error"][0] == "law asking:Ask: OSError: (910000000.0, 0.0, 2, 0)"


def test_a_class_that_changes_what_it_is_told_changes_no_run(cluster, own, tmp_path, monkeypatch):
    (tmp_path / "changing.py").write_text(
        "from pd_class import Pd\n"
        "class Bad(Pd):\n"
        "    def __init__(self, sim):\n"
        "        super().__init__(sim)\n"
        "        sim.contact.__dict__['tau'] = 1.0\n"
        "        sim.score.__dict__['start'] = 0.0\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    honest = compare(["pd_class:Pd"], periods=[2e-5], scheduler=cluster, **SHORT).table.drop(columns="law")
    both = compare(["changing:Bad", "pd_class:Pd"], periods=[2e-5], scheduler=cluster, **SHORT).table
    for number in range(2):
        assert both.drop(columns="law").iloc[number].equals(honest.iloc[0])
    told = SimParameters()
    with contender("changing:Bad").begin(told):
        assert told.contact.tau == SimParameters().contact.tau == 0.91e9


def test_a_class_that_writes_into_its_measurement_changes_neither_score_nor_chatter(
    cluster, own, tmp_path, monkeypatch
):
    (tmp_path / "writing.py").write_text(
        "from pd_class import Measurement, Pd, record_at\n"
        "class Bad(Pd):\n"
        "    def answer(self, measurement):\n"
        "        drive = super().answer(measurement)\n"
        "        assert measurement.base is None\n"
        "        y = record_at(measurement, 0, Measurement)\n"
        "        y.reference_acceleration[:2] = 1e3\n"
        "        y.reference_position[:2] = y.position[:2]\n"
        "        return drive\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    table = compare(["writing:Bad", "pd_class:Pd"], periods=[2e-5], scheduler=cluster, **SHORT).table
    bad, honest = table.drop(columns="law").iloc[0], table.drop(columns="law").iloc[1]
    assert bad.equals(honest) and not isinstance(bad["error"], str)


HANGING = """
import sys
from afm_model.studies import contender
from afm_model.studies.wrong_models import CASES, RATES, run_case

module = sys.modules["afm_model.studies.contender"]
module.PATIENCE = {patience}
print(run_case(CASES[0], RATES[1], contender("hanging:Law"))["lost"])
"""


@pytest.mark.parametrize(("answer", "ends"), [("while True: pass", True), ("time.sleep(0.02)", False)])
def test_class_that_gives_no_answer_ends_and_tells_where(tmp_path, answer, ends):
    (tmp_path / "hanging.py").write_text(
        "import time\nfrom pd_class import Pd\nclass Law(Pd):\n    count = 0\n    def answer(self, measured):\n"
        f"        self.count += 1\n        if 100 < self.count < 210:\n            {answer}\n"
        "        return super().answer(measured)\n"
    )
    path = os.pathsep.join([str(tmp_path), str(EXAMPLES), os.environ.get("PYTHONPATH", "")])
    script = HANGING.format(patience=1.2)
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if ends:
        assert done.returncode == 1
        assert "Timeout (0:00:01" in done.stderr and f'{tmp_path / "hanging.py"}", line 8 in answer' in done.stderr
    else:
        # Two seconds, but each answer takes a hundredth of that.
        assert done.returncode == 0, done.stderr
