"""Claims of docs/images.md: its figure, its tables and its example."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from printed.page_run import run_programs

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "images.md"
sys.path.insert(0, str(ROOT / "tools"))

import measure_force_curves as rates  # noqa: E402
from figures import control, page  # noqa: E402


def table(name: str) -> list[list[str]]:
    return page.read(PAGE, name)[1:]


def number(cell: str) -> float:
    return float(cell.split(" ")[0])


def test_slow_z_loop_smears_edges_and_the_law_of_x_and_y_decides_where_they_are():
    # Three lines with the paper's law and in open loop, which need no compilation of their own.
    slow, right = (control.faults(control.scan("the paper's law", gain, 3)) for gain in ("slow", "right"))
    free = control.faults(control.scan("open loop", "right", 3))
    assert slow.width > 3.0 * right.width
    assert slow.height > right.height
    assert free.largest > 4.0 * right.largest
    assert free.width == pytest.approx(right.width, rel=0.2)
    told = {(row[0], row[1]): row for row in table("control")}
    assert number(told["right", "open loop"][4]) == pytest.approx(1e9 * free.largest, rel=0.1)
    assert number(told["right", "the paper's law"][3]) == pytest.approx(1e9 * right.width, rel=0.1)


def test_load_leaves_what_the_z_loop_lags_behind():
    told = {row[1]: row for row in table("control") if row[0] == "right"}
    found = control.faults(control.scan("load", "right", 4))
    assert 1e9 * found.largest == pytest.approx(number(told["load"][4]), rel=0.1)
    assert 1e9 * found.height == pytest.approx(number(told["load"][2]), rel=0.1)


def test_z_loop_that_swings_is_seen_in_the_deflection_and_not_in_the_height():
    right, fast = (control.scan("the paper's law", gain, 3) for gain in ("right", "too fast"))
    assert right.free == 0.0
    assert fast.free > 0.1
    assert control.faults(fast).height < 1.2 * control.faults(right).height
    # The tip leaves the sample only where the deflection is off by that of the setpoint; a sine's rms is .71 of it.
    assert fast.error > 0.7 * control.FORCE / 0.2
    told = {(row[0], row[1]): row for row in table("control")}
    assert number(told["right", "the paper's law"][6]) == pytest.approx(1e9 * right.error, rel=0.1)


def test_edges_and_truth_of_the_figure_are_those_of_the_grating():
    # By hand: half of the valley is 1.4 um, less what the tip's radius (5.5 nm) and half of the slope (19 nm) take.
    inner = control.true_edges()[np.abs(control.true_edges()) < 2e-6]
    assert inner == pytest.approx([-1.3753e-6, 1.3753e-6], abs=1e-10)
    height = control.truth()
    x = control.places()
    assert (height[np.abs(x) < 1.3e-6] == 0.0).all()
    assert height[np.abs(x - 2e-6) < 0.5e-6] == pytest.approx(control.STEP)


def test_rates_of_the_table_are_those_that_the_tool_measures():
    assert [1e6 * rate for rate in rates.RATES] == pytest.approx([float(row[0]) for row in table("rates")])
    found = rates.recovered(rates.curve(10e-6, 1))
    row = next(row for row in table("rates") if row[0] == "10")
    # One of its curves: within four of their scatters.
    for at, name in ((1, "modulus"), (3, "adhesion"), (4, "work")):
        middle, scatter = (float(each) for each in re.split(" ± ", row[at]))
        assert 100.0 * getattr(found, name) == pytest.approx(middle, abs=4.0 * scatter + 0.1)


def test_example_of_the_page_finds_what_it_was_given(tmp_path):
    done = run_programs("docs/images.md", tmp_path)
    found = done.scope["found"]
    assert abs(found.modulus.value - 0.75 * 4.7e9) < 3.0 * found.modulus.uncertainty
    assert len(done.printed["modulus"].splitlines()) == 2


def test_page_shows_the_figure():
    assert "figures/control.png" in PAGE.read_text()
    for kind in ("png", "svg"):
        assert (ROOT / "docs" / "figures" / f"control.{kind}").stat().st_size < 200_000
