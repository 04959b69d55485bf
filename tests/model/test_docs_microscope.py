"""Claims about docs/microscope.md: what it shows runs as it says."""

from pathlib import Path

import numpy as np
import pytest
from printed.page_run import run_programs

from afm_model import flatten, load_scenario, simulate
from afm_model.parameters import SimParameters, build
from afm_model.plant import LEVER, presets
from afm_model.plant.lever.parameters import LeverGroup

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "microscope.md").read_text()


def test_calibration_of_the_page_gives_the_numbers_of_the_page(tmp_path):
    done = run_programs("docs/microscope.md", tmp_path, "curve", "calibrate", "wedge")
    assert f"It prints {1e9 * done.scope['S'].value:.2f} nm/V" in PAGE
    assert "+-" in done.printed["calibrate"]
    assert done.scope["curve"].adhesion.value == pytest.approx(4.503e-9, rel=1e-2)  # exact Maugis-Dugdale
    x = np.concatenate([np.linspace(0.0, 1e-7, 101), np.linspace(1e-7, 0.0, 101)])
    signal = np.where(np.arange(202) < 101, 0.3, -0.1)
    row = done.scope["row"](x, signal, 1e-8 + 0.0 * x, (0.0, 3e-8), (6e-8, 9e-8))
    assert row == pytest.approx((1e-8, 0.2, 1e-8, 0.2, 1e-8, -0.2))


def test_scenario_of_the_page_is_a_friction_loop_of_21_N_per_m(tmp_path):
    run_programs("docs/microscope.md", tmp_path, "loop")
    scenario = load_scenario(tmp_path / "loop.yaml")
    short = flatten(scenario.sim) | {"run.duration": 0.03, "score.start": 0.0}
    run = simulate(build(SimParameters, short), scenario.controller)
    assert run.doubts == []
    force = run.channel("lateral_force")
    # After the turn at 25 ms the tip sticks, not all the time: on its way through zero friction along x lets it go
    # along y, where the z loop and the tilt of the cantilever push it.
    every = len(force) // len(run.position)
    stuck = run.channel("truth/stuck")[::every] > 0.0
    here = np.flatnonzero(stuck[1:] & stuck[:-1] & (run.time[1:] > 25.1e-3))
    assert len(here) > 50
    slopes = np.diff(force[::every])[here] / np.diff(run.position[:, 0])[here]
    assert np.median(slopes) == pytest.approx(20.5, rel=1e-2)
    assert np.ptp(run.channel("truth/place_x")) > 1e-9
    assert 3.5e-9 < force.max() < 4.5e-9
    assert run.score.contact_fraction == 1.0


def test_code_of_the_page_draws_the_loop(tmp_path):
    done = run_programs("docs/microscope.md", tmp_path, "loop", "see")
    assert (tmp_path / "loop.png").stat().st_size > 5000
    assert np.ptp(done.scope["done"].lateral_force) == pytest.approx(2.0 * 3.92e-9, rel=0.01)


def test_code_of_the_page_finds_the_spring_constant_from_a_second_of_thermal_noise(tmp_path):
    done = run_programs("docs/microscope.md", tmp_path, "thermal")
    k = done.scope["tune"].k
    assert abs(k.value - 0.2) < 2.0 * k.uncertainty
    assert k.uncertainty == pytest.approx(0.024 * k.value, rel=0.1)
    assert "k = 0.2" in done.printed["thermal"]


@pytest.mark.parametrize("family", ["lever", "scanner", "pair"])
def test_every_preset_can_be_chosen_and_is_in_the_page(family):
    known = {"lever": presets.LEVERS, "scanner": presets.SCANNERS, "pair": presets.PAIRS}[family]
    for name in known:
        assert f"`{name}`" in PAGE
        values = {"plant.kind": "lever", "sample.kind": "flat", "plant.dt": 1e-7, f"plant.{family}": name}
        parameters = build(SimParameters, values)
        assert LEVER.warnings(parameters) == []
    assert set(LeverGroup.model_fields[family].annotation.__args__) == set(known)


def test_stiffness_sideways_is_that_of_the_table():
    for line in PAGE.splitlines():
        name = line.partition("`")[2].partition("`")[0]
        if name in presets.LEVERS and line.startswith("|"):
            c = LeverGroup(lever=name).cantilever_numbers
            arm = c.tip_height + 0.5 * c.thickness
            stiffness = 1.0 / (arm**2 / c.k_torsion + 1.0 / c.k_in_plane)
            assert stiffness == pytest.approx(float(line.split("|")[-2]), rel=0.03)


def test_scenario_of_the_page_with_atoms_slips_from_one_to_the_next(tmp_path):
    run_programs("docs/microscope.md", tmp_path, "lattice")
    scenario = load_scenario(tmp_path / "lattice.yaml")
    cold = flatten(scenario.sim) | {"run.duration": 0.075, "plant.temperature": 0.0, "score.start": 0.0}
    run = simulate(build(SimParameters, cold), scenario.controller)
    a, barrier = run.parameters.sample.constant, run.parameters.sample.barrier
    assert run.score.contact_fraction == 1.0
    force, place = run.channel("lateral_force"), run.channel("truth/apex_x")
    back = run.time_samples > 0.03
    assert -force[back].min() == pytest.approx(np.pi * barrier / a, rel=0.03)
    # On its way back over 3 nm; a slip where the apex changes its row.
    slips = np.flatnonzero(np.diff(np.round(place[back] / a)))
    assert len(slips) == 6
    assert np.abs(np.diff(run.channel("truth/apex_y"))).max() < 0.1 * a
    warm = build(SimParameters, cold | {"plant.temperature": 295.0})
    activated = simulate(warm, scenario.controller).channel("lateral_force")[back]
    assert -activated.mean() < -0.95 * force[back].mean()
