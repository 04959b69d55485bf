"""What verbs measure, over real topics: the numbers of the same verbs in process, progress, and cancels on the way."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from afm_msgs.msg import NamedArray
from quick_lever import INSTRUMENT, LAW, OVER_THE_WEDGE, WEDGE
from support import Graph, ros_arguments
from verbs_bench import APPROACH, Bench

from afm_bringup.remote import Remote
from afm_model import SimParameters, build
from afm_model.microscope import Microscope
from afm_model.microscope.arrays import arrays_of
from afm_model.microscope.local import Local
from afm_model.microscope.results import Calibration, Outcome, Standing
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import (
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    ScanPath,
    ThermalTune,
    Withdraw,
)
from afm_model.microscope.verbs.friction_loop import Loop
from afm_model.microscope.verbs.scan_path import PathRecord
from afm_node_common import topics
from afm_node_common.verb_codec import outcome_of
from afm_recorder_node import checks
from afm_recorder_node.gathering import Gathering
from afm_recorder_node.result_views import markdown

PARAMETERS = {name: value for name, value in INSTRUMENT.items() if not name.startswith("sample.")} | LAW
PARAMETERS |= {f"sample.{name}": value for name, value in WEDGE.items()}
PARAMETERS |= {"plant.gap": 400e-9, "plant.temperature": 295.0}
"""A lever with thermal noise over a wedge."""

LOOP = FrictionLoop(length=10e-9, line_rate=20.0, sample_rate=10e3)
PATH = ScanPath(x=(0.0, 10e-9, 10e-9), y=(0.0, 0.0, 20e-9), speed=1e-6, sample_rate=10e3)
CURVES = ForceCurve(lift=100e-9, ramp=200e-9, approach_rate=20e-6, retract_rate=20e-6, trigger_force=20e-9)
SENSITIVITY = CalibrateSensitivity(count=2, lift=100e-9, ramp=200e-9, rate=2e-6)
SEQUENCE = (ThermalTune(duration=0.2), APPROACH, LOOP, PATH, SENSITIVITY, OVER_THE_WEDGE)
"""The verbs from the start on, in order."""
MEASURING = tuple(verb for verb in SEQUENCE if verb != APPROACH)


def named(verb: Verb) -> str:
    return type(verb).__name__


def in_process() -> Local:
    parameters = build(SimParameters, PARAMETERS)
    assert parameters.controller_inside is not None
    return Local(parameters, parameters.controller_inside)


@pytest.fixture(scope="module")
def expected() -> dict[str, Outcome]:
    local = in_process()
    return {named(verb): local.execute(verb) for verb in SEQUENCE}


@pytest.fixture(scope="module")
def session() -> Iterator[tuple[Bench, dict[str, Outcome]]]:
    """A simulator that has done the sequence over topics, and what came back."""
    with Graph(ros_arguments(PARAMETERS)) as graph:
        bench = Bench(graph)
        outcomes = {named(verb): outcome_of(verb, bench.do(verb), cancelled=False) for verb in SEQUENCE}
        yield bench, outcomes


@pytest.fixture(scope="module")
def bench(session: tuple[Bench, dict[str, Outcome]]) -> Bench:
    return session[0]


def numbers(result: Any) -> dict[str, Any]:
    """Everything that a result has, by name; arrays as their bytes."""
    if isinstance(result, Calibration):
        return {"value": result.estimate, "unit": result.unit, "details": dict(result.details)}
    if isinstance(result, Loop):
        return {name: getattr(result, name).tobytes() for name in ("position", "lateral", "deflection", "time")}
    assert isinstance(result, PathRecord)
    record = result.record
    channels = {name: values.tobytes() for name, values in record.channels.items()}
    return {"time": record.time.tobytes(), "units": dict(record.units), **channels}


@pytest.mark.parametrize("verb", MEASURING, ids=named)
def test_numbers_over_topics_are_those_in_process(
    session: tuple[Bench, dict[str, Outcome]], expected: dict[str, Outcome], verb: Verb
) -> None:
    there, here = session[1][named(verb)], expected[named(verb)]
    assert (there.status, here.status) == ("complete", "complete"), here.message
    assert numbers(there.result) == numbers(here.result)


LASTING: tuple[Verb, ...] = (
    Approach(rate=1e-9, range=400e-9),
    Withdraw(distance=300e-9, rate=1e-9),
    MoveTo(x=20e-9, speed=1e-10),
    CURVES.model_copy(update={"count": 300}),
    LOOP.model_copy(update={"count": 8192}),
    PATH.model_copy(update={"speed": 1e-10}),
    ThermalTune(duration=60.0),
    SENSITIVITY.model_copy(update={"count": 200}),
    OVER_THE_WEDGE.model_copy(update={"lines": 512}),
)
"""What takes so long that only a cancel ends it in a test."""


def ready(bench: Bench, verb: Verb) -> None:
    """Bring the tip to where the verb can begin."""
    if not isinstance(verb, Approach | ThermalTune):
        bench.approach()
    elif bench.near:
        bench.do(Withdraw())


def cancelled(bench: Bench, verb: Verb, handle: Any) -> Outcome:
    bench.graph.result(handle.cancel_goal_async())
    told = bench.end(handle)
    assert (told.status, told.result.success) == (GoalStatus.STATUS_CANCELED, False)
    assert told.result.message == f"{named(verb)} was cancelled; the tip is withdrawn"
    assert not bench.near
    assert not bench.simulator.run.instrument.in_contact
    return outcome_of(verb, told.result, cancelled=True)


def samples(result: Any) -> int:
    """How many samples, curves, or steps on the way were kept."""
    if isinstance(result, Loop):
        assert len(result.time) == len(result.lateral) == len(result.position) == len(result.deflection)
        assert np.isfinite(result.lateral).all()
        return len(result.time)
    if isinstance(result, PathRecord):
        assert dict(result.record.units) == {"x": "m", "y": "m", "height": "m", "error": "V", "lateral": "N"}
        assert {len(values) for values in result.record.channels.values()} == {len(result.record.time)}
        return len(result.record.time)
    if isinstance(result, Calibration):
        assert (result.unit, result.estimate.value) == ("m/V", pytest.approx(10e-9, rel=0.1))
        return int(result.details["curves"])
    return sum(curve.triggered for curve in result)


@pytest.mark.parametrize("verb", LASTING, ids=named)
def test_cancel_on_the_way_leaves_the_tip_withdrawn_and_what_was_measured_is_kept(bench: Bench, verb: Verb) -> None:
    ready(bench, verb)
    heard: list[Any] = []
    instrument = bench.simulator.run.instrument
    begin = instrument.time
    setpoint = bench.simulator.run.operator.state.setpoint
    handle = bench.begin(verb, lambda message: heard.append(message.feedback))
    # Time for two curves, a line, some samples.
    bench.graph.spin_until(lambda: instrument.time > begin + 0.4 and len(heard) > 1)
    assert 0.0 <= heard[0].progress < heard[-1].progress < 1.0
    assert heard[-1].detail
    result = cancelled(bench, verb, handle).result
    if isinstance(verb, ThermalTune | CalibrateLateral):
        # One number of all samples: of a part of them there is none.
        assert result is None
        assert bench.simulator.run.operator.state.setpoint == setpoint
    elif isinstance(result, Standing):
        assert result.time > begin + 0.4
    else:
        assert samples(result) >= 2


@pytest.mark.parametrize("verb", LASTING, ids=named)
def test_cancel_at_once_leaves_the_tip_withdrawn_and_is_answered(bench: Bench, verb: Verb) -> None:
    ready(bench, verb)
    # From elsewhere, so that it first has a way to go.
    bench.do(MoveTo(x=-10e-9))
    result = cancelled(bench, verb, bench.begin(verb)).result
    if isinstance(verb, ForceCurve | FrictionLoop | ScanPath):
        assert samples(result) >= 0


def test_results_are_published_for_a_recorder_as_the_client_gets_them(bench: Bench) -> None:
    heard: list[Any] = []
    subscription = bench.client.create_subscription(NamedArray, topics.RESULTS, heard.append, topics.RESULTS_QOS)
    bench.graph.spin_until(
        lambda: bench.simulator.count_subscribers(topics.RESULTS) and subscription.get_publisher_count()
    )
    for verb in (CURVES, LOOP, SENSITIVITY):
        bench.approach()
        heard.clear()
        expected = arrays_of(outcome_of(verb, bench.do(verb), cancelled=False).result)
        assert expected is not None
        count = len(expected.variables) + len(expected.coordinates)
        bench.graph.spin_until(lambda count=count: len(heard) == count)
        gathering = Gathering()
        (result,) = filter(None, [gathering.put(checks.result_part(message)) for message in heard])
        assert (result.verb, result.status) == (named(verb), "complete")
        assert dict(result.arrays.attributes) == dict(expected.attributes)
        for group in ("variables", "coordinates"):
            there, here = getattr(result.arrays, group), getattr(expected, group)
            assert list(there) == list(here)
            for name, each in here.items():
                assert there[name].values.tobytes() == np.asarray(each.values, np.float64).tobytes(), name
                assert dict(there[name].attributes) == dict(each.attributes)
        assert markdown(result).startswith(f"### {named(verb)}")
    bench.client.destroy_subscription(subscription)


def test_move_to_where_the_scanner_stands_is_done_at_once(bench: Bench) -> None:
    bench.approach()
    there = bench.do(MoveTo(x=5e-9))
    ticks = bench.simulator.run.instrument.ticks
    # To the last bit: any way, however short, takes time.
    result = bench.do(MoveTo(x=there.x, y=there.y))
    assert (result.x, result.y) == (there.x, there.y)
    assert bench.simulator.run.instrument.ticks == ticks


def test_microscope_as_a_client_returns_the_bytes_of_the_one_in_this_process(bench: Bench) -> None:
    simulator = bench.simulator

    def serve() -> None:
        bench.graph.spin()
        while simulator.run.operator.busy:
            bench.graph.spin()

    # Time begins anew with another sample, and with it the noise.
    with Microscope(Remote(check=serve)) as remote, Microscope(in_process()) as local:
        for microscope in (remote, local):
            if microscope.state.near:
                microscope.withdraw()
            microscope.set_sample(step=50e-9)
        for word, fields in (
            ("approach", APPROACH.model_dump()),
            ("scan", {"size_x": 40e-9, "size_y": 10e-9, "pixels": 8, "lines": 2, "line_rate": 20.0}),
            ("force_curve", CURVES.model_dump()),
        ):
            there, here = getattr(remote, word)(**fields), getattr(local, word)(**fields)
            if word == "approach":
                assert there == here
                continue
            assert there.identical(here)
            for name in here.variables:
                assert there[name].values.tobytes() == here[name].values.tobytes(), name
