"""Claims about many runs in one compiled loop: each has the bits of its run alone, whatever happens to the others."""

import gc
import weakref
from typing import Any

import bits
import numpy as np
import pytest

from afm_model import (
    Controller,
    ControllerParameters,
    DivergenceError,
    ParameterError,
    SimParameters,
    build,
    changed,
    simulate,
)
from afm_model.compiled.jit import config
from afm_model.compiled.lanes import LANES
from afm_model.instrument import Instrument
from afm_model.lanes.loop import LEAST, Together, composition
from afm_model.lanes.together import run_together
from afm_model.run.simulation import run

SLOW = {"plant.control_period": 50e-6, "detector.sample_period": 10e-6, "run.duration": 4e-3, "score.start": 1e-3}
LEVER = {"plant.kind": "lever", "sample.kind": "flat"}
Set = tuple[SimParameters, ControllerParameters]
needs_compiled = pytest.mark.skipif(config.DISABLE_JIT, reason="lanes are compiled code")


def one(number: int, law: dict[str, Any], **news: Any) -> Set:
    """A set of one composition; each number has other parameters."""
    values = {
        **SLOW,
        "plant.seed": number,
        "contact.R": 20e-9 * (1.0 + 0.003 * (number % 50)),
        "contact.tau": 1e9 * (1.0 + 0.002 * (number % 70)),
        "reference.omega_x": 1000.0 + number,
        "reference.amplitude_x": 5e-9 + 2e-11 * number,
        "sample.beta": 12.5e-9 * (0.8 + 0.001 * number),
        "detector.noise": 1e-3 if number % 2 else 0.0,
        **news,
    }
    kind = values.get("sample.kind", "paper")
    if kind != "paper":
        del values["sample.beta"]
    timing = {"law.period": 50e-6} if law["law.kind"] in ("pid", "observer", "predictive") else {}
    return build(SimParameters, values), build(ControllerParameters, {**law, **timing})


def hashes(sets: list[Set], **options: Any) -> list[str]:
    """Hash of each run of `run_together`, or the sentence of its error."""
    return [
        each.trajectory_sha256() if isinstance(each, Instrument) else str(each)
        for each in run_together(sets, **options)
    ]


def alone(each: Set) -> str:
    """Hash of a run alone, or the sentence of its error."""
    try:
        return run(*each).trajectory_sha256()
    except (ParameterError, DivergenceError) as error:
        return str(error)


@pytest.fixture(scope="module")
def many():
    """Sets of one composition, and the hash of each alone."""
    sets = [one(number, {"law.kind": "tanh"}) for number in range(257)]
    return sets, [alone(each) for each in sets]


@pytest.mark.parametrize("count", [1, 7, 64, 257])
def test_each_run_among_many_has_the_bits_of_its_run_alone(many, count):
    sets, expected = many
    assert len(set(expected)) == len(expected)
    assert hashes(sets[:count]) == expected[:count]


def test_the_order_of_the_sets_does_not_matter(many):
    sets, expected = many
    order = np.random.default_rng(1).permutation(70)
    assert hashes([sets[i] for i in order]) == [expected[i] for i in order]


@pytest.mark.parametrize(
    ("law", "news"),
    [
        ({"law.kind": "pid"}, {}),
        ({"law.kind": "observer"}, {"plant.delay_ticks": 1}),
        ({"law.kind": "open_loop"}, {}),
        ({"law.kind": "predictive"}, {}),
        ({"law.kind": "sgn"}, {"sample.kind": "plane", "sample.angle_x": 0.01}),
        ({"law.kind": "pid"}, {"plant.kind": "paper"}),
        ({"law.kind": "tanh"}, {"plant.kind": "paper", "plant.z": "uniform", "sample.kind": "flat"}),
        ({"law.kind": "pid"}, {"onboard.kind": "pi", "drift.wander": 1e-10, "detector.sample_period": 1e-6}),
        ({"law.kind": "tanh"}, {"plant.gap": 2e-9}),
    ],
)
def test_plants_samples_and_laws_run_in_lanes(law, news):
    sets = [one(number, law, **news) for number in range(LEAST + 1)]
    if not config.DISABLE_JIT:
        assert all(composition(Instrument(sim)) for sim, _ in sets)
    assert hashes(sets) == [alone(each) for each in sets]


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name, line in bits.CASES["runs"].items() if line.startswith("simulate ")])
def test_compositions_of_make_bits_keep_their_bits_among_others(name, tmp_path):
    """In lanes or one by one, beside runs that end sooner."""
    given, _ = bits.scenario(bits.CASES["runs"][name].split()[1:], tmp_path)
    sim, law = given.sim, given.controller
    period = sim.plant.control_period
    shorter = changed(sim, {"run.duration": round(0.9 * sim.total_ticks) * period, "score.start": sim.score_start})
    sets = [(sim, law), *[(shorter, law)] * (LEAST - 1), (sim, law)]
    expected = bits.kept()["hashes"][name]["trajectory"]
    found = hashes(sets)
    assert (found[0], found[-1]) == (expected, expected)
    assert len(set(found)) == 2


def levers(count: int, **news: Any) -> list[Set]:
    """Sets whose tips stick and slide each at its own times; number 3 is off the sample at the start."""
    law = build(ControllerParameters, {"law.kind": "open_loop"})
    values = {**SLOW, **LEVER, **news}
    return [
        (
            build(
                SimParameters,
                {**values, "reference.amplitude_x": (20.0 + 0.1 * i) * 1e-9, "plant.gap": 1e-9 if i == 3 else 0.0},
            ),
            law,
        )
        for i in range(count)
    ]


@needs_compiled
def test_the_plant_lever_in_lanes_keeps_its_bits():
    sets = levers(LEAST + 1)
    assert len({composition(Instrument(sim)) for sim, _ in sets} - {None}) == 1
    expected = [alone(each) for each in sets]
    assert len(set(expected)) == len(expected)
    assert hashes(sets) == expected


@needs_compiled
def test_a_tip_that_was_off_the_sample_does_in_lanes_what_it_does_alone():
    """It neither stuck nor slid in the last step, although it is in contact now: the sample has come to it."""
    sets = levers(LEAST)
    alone, many = ([Instrument(sim) for sim, _ in sets] for _ in range(2))
    laws = [Controller(law) for _, law in sets]
    for each in (*alone, *many):
        each.close_loop(laws[0], 30)
        state = each.record("plant_state")
        assert state.stuck == 0.0
        state.a = 0.0
    assert sum(each.record("plant_state").delta > each.record("plant_state").end for each in many) >= LEAST - 1
    for each in alone:
        each.close_loop(laws[0], 1)
    outcomes = Together(many, laws).close_loop(range(LEAST), [1] * LEAST)
    for each, law, outcome in zip(many, laws, outcomes, strict=True):
        each.ended(law, outcome)
    for one, other in zip(alone, many, strict=True):
        assert one.numbers("plant_state").tobytes() == other.numbers("plant_state").tobytes()


@pytest.mark.long
@pytest.mark.parametrize("news", [{}, {"sample.kind": "plane", "sample.angle_x": 0.02, "sample.angle_y": 0.01}])
@pytest.mark.parametrize("count", [1, 7, 64])
def test_the_plant_lever_keeps_its_bits_among_any_number(count, news):
    sets = levers(count, **news, **{"run.duration": 20e-3})
    assert hashes(sets) == [alone(each) for each in sets]


def test_scores_and_records_are_those_of_the_run_alone():
    sets = [one(number, {"law.kind": "tanh"}) for number in range(LEAST)]
    blocks: dict[int, list[Any]] = {number: [] for number in range(LEAST)}
    instruments: list[Any] = run_together(sets, lambda number, block: blocks[number].append(block), sampled=True)
    for number, each in enumerate(sets):
        expected = simulate(*each)
        assert str(instruments[number].score()) == str(expected.score)
        measured = np.concatenate([block.measurements for block in blocks[number]])
        assert measured.tobytes() == expected.measurements.tobytes()
        samples = np.concatenate([block.samples for block in blocks[number]], axis=1)
        assert samples.tobytes() == expected.samples.tobytes()


def test_a_run_that_diverges_is_refused_or_limited_disturbs_no_other(many):
    sets, expected = many
    bad = [
        one(300, {"law.kind": "pid", "law.slowness": 1e-3}, **{"plant.delay_ticks": 30, "run.duration": 40e-3}),
        one(301, {"law.kind": "tanh"}, **{"piezo.limit": 1e-3}),
        one(302, {"law.kind": "tanh"}, **{"safety.travel_limit": 1e-9}),
        one(303, {"law.kind": "tanh"}, **{"run.duration": 1.7e-3}),
    ]
    mixed = [*sets[:5], *bad, *sets[5:10]]
    found = hashes(mixed)
    assert found == [*expected[:5], *(alone(each) for each in bad), *expected[5:10]]
    assert any(len(each) != 64 for each in found)


def test_what_cannot_run_in_lanes_runs_one_by_one():
    warm = (
        build(SimParameters, {**LEVER, "plant.temperature": 295.0, "run.duration": 2e-4}),
        build(ControllerParameters, {}),
    )
    assert composition(Instrument(warm[0])) is None
    sets = [warm, one(1, {"law.kind": "pid"}), warm]
    assert hashes(sets) == [alone(each) for each in sets]


@needs_compiled
def test_one_composition_is_one_group_whatever_its_numbers_are(many):
    sets, _ = many
    assert len({composition(Instrument(sim)) for sim, _ in sets[:LANES]}) == 1


@pytest.mark.parametrize(
    ("news", "quiet"),
    [
        ({}, True),
        ({"plant.delay_ticks": 2, "safety.travel_limit": 1e-9}, True),
        ({"detector.position_noise": 1e-11}, False),
        ({"detector.bandwidth": 1e5}, False),
        ({"detector.position_bandwidth": 1e5}, False),
        ({"drift.rate_x": 1e-6}, False),
        ({"piezo.kind": "ceramic", "piezo.creep": 0.02}, False),
        ({"piezo.dac_period": 1e-5}, False),
        ({"fault.a.kind": "offset", "fault.a.signal": "position_x", "fault.a.size": 1e-9}, False),
    ],
)
def test_samples_that_nobody_looks_at_are_made_only_where_something_remembers_them(news, quiet):
    sets = [one(2 * number, {"law.kind": "pid"}, **news) for number in range(LEAST)]
    assert bool(Instrument(sets[0][0], sampled=False).record("loop").quiet) is quiet
    assert not Instrument(sets[0][0]).record("loop").quiet
    assert hashes(sets) == hashes(sets, lanes=False) == [alone(each) for each in sets]


def test_instruments_are_let_go_without_the_collector_of_cycles():
    gc.disable()
    try:
        found = run_together([one(number, {"law.kind": "tanh"}) for number in range(LEAST)])
        alive = [weakref.ref(each) for each in found]
        del found
        assert [each() for each in alive] == [None] * LEAST
    finally:
        gc.enable()
