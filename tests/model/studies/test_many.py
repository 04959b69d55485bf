"""Claims about labelled arrays of many runs: each is that of `simulate`, in lanes or one by one."""

from dataclasses import replace

import numpy as np
import pytest

from afm_model import ParameterError, load_scenario, simulate, simulate_many
from afm_model.parameters import changed

TAU, SEED = "afm_sim_node.contact.tau", "afm_sim_node.plant.seed"


@pytest.fixture(scope="module")
def scenario():
    found = load_scenario("closed_loop_tanh")
    short = {"run.duration": 2e-4, "score.start": 0.0, "detector.noise": 1e-3}
    return replace(found, sim=changed(found.sim, short))


@pytest.mark.parametrize("lanes", [True, False])
def test_every_row_is_the_run_alone(scenario, lanes):
    sets = {TAU: [0.9e9, 1.0e9, 1.1e9], SEED: [1, 2]}
    found = simulate_many(scenario, sets, variables=("position", "deflection", "true_friction"), lanes=lanes)
    assert found.sizes == {"set": 6, "time": 100, "axis": 3}
    for i in range(6):
        row = found.isel(set=i)
        sim = changed(scenario.sim, {"contact.tau": float(row[TAU]), "plant.seed": int(row[SEED])})
        alone = simulate(sim, scenario.controller)
        assert row.trajectory_sha256 == alone.trajectory_sha256
        assert np.array_equal(row.position, alone.position)
        assert np.array_equal(row.deflection, alone.deflection)
        assert np.array_equal(row.true_friction, alone.truth["friction"])
        assert np.array_equal(found.time, alone.time)
    assert found.position.attrs == {"units": "m"}


def test_a_set_that_is_refused_is_empty_and_the_others_are_there(scenario):
    found = simulate_many(scenario, {"afm_sim_node.piezo.limit": [0.0, 1e-3]})
    assert [bool(each) for each in found.error] == [False, True]
    assert np.isfinite(found.position[0]).all()
    assert np.isnan(found.position[1]).all()


def test_sets_without_a_common_time_and_unknown_variables_are_refused(scenario):
    with pytest.raises(ParameterError, match="no common time"):
        simulate_many(scenario, {"afm_sim_node.run.duration": [1e-4, 2e-4]})
    with pytest.raises(ParameterError, match="unknown variable"):
        simulate_many(scenario, {SEED: [1]}, variables=("hight",))
