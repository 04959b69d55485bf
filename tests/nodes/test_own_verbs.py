"""Claims about verbs and z loops of one's own over topics: the same bytes as in process, and refused in words."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quick_lever import INSTRUMENT, LAW
from rcl_interfaces.msg import Parameter, ParameterValue
from support import TIMEOUT, Graph, ros_arguments
from verbs_bench import APPROACH, SCAN, assert_same

from afm_bringup.remote import Remote
from afm_model import SimParameters, build
from afm_model.core.errors import ParameterError
from afm_model.microscope import Local, MoveTo, Standing
from afm_model.microscope.verb import find
from afm_model.microscope.verbs import Lift, Scan, ScanPath
from afm_node_common.verb_codec import ANY, action_of, goal_of, parameters, verb_of
from afm_sim_node.node import SimNode

DRIVEN = INSTRUMENT | {
    "onboard.kind": "dynamic",
    "onboard.drive_amplitude": 1e-11,
    "plant.gap": 200e-9,
    "plant.Q": 10.0,
    "plant.dt": 2e-7,
    "detector.sample_period": 2e-6,
}
INTEGRAL = {name: value for name, value in INSTRUMENT.items() if not name.startswith("onboard.")} | {
    "onboard.kind": "integral:INTEGRAL"
}


@pytest.fixture(autouse=True)
def examples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples" / "parts"))


@contextmanager
def simulated(values: dict[str, Any]) -> Iterator[tuple[Remote, SimNode]]:
    """A client of a simulator in this thread, and the simulator."""
    with Graph(ros_arguments(values | LAW)) as graph:
        graph.add(simulator := SimNode())
        limit = time.monotonic() + TIMEOUT

        def turn() -> None:
            if time.monotonic() > limit:
                pytest.fail("the client waits for ever")
            graph.spin()

        client = Remote(check=turn)
        try:
            yield client, simulator
        finally:
            client.close()


@contextmanager
def remote(values: dict[str, Any]) -> Iterator[Remote]:
    """The client alone."""
    with simulated(values) as (client, _):
        yield client


def in_process(values: dict[str, Any]) -> Local:
    parameters = build(SimParameters, values | LAW)
    assert parameters.controller_inside is not None
    return Local(parameters, parameters.controller_inside)


def test_verb_of_ones_own_brings_the_same_bytes_over_topics_as_in_process() -> None:
    verb = find("lift:LiftLine").of({"size": 40e-9, "lift": 30e-9, "line_rate": 20.0})
    local = in_process(INSTRUMENT)
    local.execute(APPROACH)
    expected = local.execute(verb).result
    with remote(INSTRUMENT) as client:
        told = client.execute(verb)
        assert told.message == "LiftLine is not allowed while the tip is withdrawn: it must be approached first"
        client.execute(APPROACH)
        found = client.execute(verb).result
    assert list(found.variables) == list(expected.variables)
    for name, (dims, values, attributes) in expected.variables.items():
        assert (found.variables[name].dims, dict(found.variables[name].attributes)) == (dims, attributes)
        assert found.variables[name].values.tobytes() == values.tobytes()


def test_tune_brings_the_same_bytes_over_the_action_of_any_verb_and_the_drive_it_sets_is_told() -> None:
    verb = find("tune").of({"points": 16, "average": 1e-4, "free_amplitude": 5e-9})
    local = in_process(DRIVEN)
    expected = local.execute(verb).result
    settled = local.execute(find("read").of({})).result
    with simulated(DRIVEN) as (client, simulator):
        assert action_of(verb) == ANY
        assert goal_of(verb).verb == "tune"
        found = client.execute(verb).result
        read = client.execute(find("read").of({})).result
        set_ = {name: simulator.get_parameter(f"onboard.{name}").value for name in ("drive_amplitude", "phase_offset")}
    assert {name: each.values.tobytes() for name, each in found.variables.items()} == {
        name: each.values.tobytes() for name, each in expected.variables.items()
    }
    told, part = found.attributes, local.instrument.parameters.onboard
    assert dict(told) == dict(expected.attributes)
    assert set_["drive_amplitude"] == part.drive_amplitude == told["drive_amplitude_m"]
    assert set_["phase_offset"] == part.phase_offset == told["phase_offset_rad"]
    # What a host reads then is what it has asked for.
    assert {name: (each.dims, float(each.values)) for name, each in read.variables.items()} == {
        name: (each.dims, float(each.values)) for name, each in settled.variables.items()
    }
    assert dict(read.attributes) == dict(settled.attributes)
    assert float(read.variables["amplitude"].values) == pytest.approx(5e-9, rel=1e-3)
    assert float(read.variables["phase"].values) == pytest.approx(0.5 * math.pi, abs=1e-3)


PRESSED = DRIVEN | {
    "plant.lever": "ppp_fmr",
    "plant.Q": 20.0,
    "plant.dt": 5e-8,
    "plant.contact": "dmt",
    "plant.K": 4.5e9,
}


def test_contact_resonance_brings_the_same_bytes_over_the_action_of_any_verb() -> None:
    verb = find("contact_resonance").of({"frequency": 205e3, "points": 16, "average": 1e-4})
    values = PRESSED | {"detector.sample_period": 1e-6, "onboard.drive_amplitude": 1e-12}
    local = in_process(values)
    assert local.execute(APPROACH).message == ""
    expected = local.execute(verb).result
    with remote(values) as client:
        assert action_of(verb) == ANY
        told = client.execute(verb)
        assert told.message == "ContactResonance is not allowed while the tip is withdrawn: it must be approached first"
        client.execute(APPROACH)
        found = client.execute(verb).result
    assert {name: each.values.tobytes() for name, each in found.variables.items()} == {
        name: each.values.tobytes() for name, each in expected.variables.items()
    }
    assert dict(found.attributes) == dict(expected.attributes)
    assert found.attributes["contact_stiffness_N_m"] > 10.0


TAPPING = DRIVEN | {
    "onboard.regulate": "amplitude",
    "onboard.setpoint_force": 0.0,
    "onboard.drive_amplitude": 2e-9,
    "plant.k": 2.0,
    "plant.gap": 80e-9,
}


FRAME = {"size_x": 40e-9, "size_y": 10e-9, "pixels": 4, "lines": 2, "line_rate": 40.0, "overscan": 0.6}


def test_images_by_tapping_are_the_same_over_actions_as_in_process_and_their_setpoint_is_set_over_topics() -> None:
    scan = Scan(**FRAME)
    local = in_process(TAPPING)
    local.set_setpoint(share=0.7)
    assert local.execute(APPROACH).message == ""
    expected = local.execute(scan)
    lift = Lift(**FRAME, lift=20e-9, lift_rate=4e-6)
    expected_above = local.execute(lift)
    with simulated(TAPPING) as (client, simulator):
        client.set_setpoint(share=0.7)
        with pytest.raises(ParameterError, match=r"onboard\.setpoint_force = 1e-09 is not allowed with"):
            client.set_setpoint(force=1e-9)
        client.execute(APPROACH)
        found = client.execute(scan)
        above = client.execute(lift)
        free = simulator.get_parameter("onboard.free_amplitude").value
        setpoint = client.state.setpoint
    assert (found.status, found.message) == (expected.status, expected.message) == ("complete", "")
    assert list(expected.result.units.items()) == [("height", "m"), ("amplitude_error", "m"), ("phase", "rad")]
    assert (found.result.scan, found.result.units) == (expected.result.scan, expected.result.units)
    assert found.result.metadata == expected.result.metadata
    assert_same(found.result, expected.result)
    assert action_of(lift) == ANY
    assert (above.status, above.message) == (expected_above.status, expected_above.message) == ("complete", "")
    assert above.result.scan == expected_above.result.scan
    assert (above.result.units, above.result.metadata) == (expected_above.result.units, expected_above.result.metadata)
    assert_same(above.result, expected_above.result)
    assert free == local.instrument.parameters.onboard.free_amplitude > 0.0
    assert setpoint == local.state.setpoint == pytest.approx(0.7 * free / 10e-9)


def test_z_loop_of_ones_own_serves_verbs_over_topics_and_what_it_lacks_is_refused() -> None:
    with remote(INTEGRAL) as client:
        client.execute(APPROACH)
        image = client.execute(SCAN).result
        assert image.complete
        assert np.abs(image.data["error", "trace"]).max() < 0.05
        client.set_setpoint(voltage=6.0)
        assert client.state.setpoint == 6.0
        assert np.isnan(client.state.integral_gain)
        with pytest.raises(ParameterError, match=r"integral_gain cannot be set: the z loop onboard.kind = integral"):
            client.set_gains(integral=1e-6)
        with pytest.raises(ParameterError, match="feedback cannot be set"):
            client.set_feedback("hold")
        # It goes on.
        assert client.execute(MoveTo(x=5e-9)).result.x == pytest.approx(5e-9, rel=1e-9)


def test_goals_of_any_verb_keep_fields_to_the_last_bit_and_refuse_what_is_none() -> None:
    verb = find("lift:LiftLine").of({"size": 0.1 + 0.2, "lift": 1e-9 / 3.0})
    assert action_of(verb) == ANY
    goal = goal_of(verb)
    assert goal.verb == "lift:LiftLine"
    assert verb_of(ANY, goal) == verb
    path = ScanPath(x=(0.0, 1e-9), y=())
    assert verb_of(ANY, type(goal)(verb="scan_path", fields=parameters(path.model_dump()))) == path
    for name, values, told in (
        ("lift:LiftLine", {"lift": "high"}, "lift = high m is not allowed: it must be"),
        ("lift:LiftLine", {"left": 1.0}, "unknown parameter left: did you mean lift"),
        ("lift_line", {}, "there is no verb lift_line"),
        ("scan_path", {"x": (0, math.nan)}, r"x\[1\] = nan m is not allowed"),
    ):
        with pytest.raises(ParameterError, match=told):
            verb_of(ANY, type(goal)(verb=name, fields=parameters(values)))
    twice = 2 * parameters({"lift": 1e-9})
    without, unknown = Parameter(name="lift"), Parameter(name="lift", value=ParameterValue(type=77))
    for fields, told in (
        (twice, "the name lift is given twice: each name needs one value"),
        ([without], "lift has no value: it must have one, with the type that the value has"),
        ([unknown], "lift has no value"),
    ):
        with pytest.raises(ParameterError, match=told):
            verb_of(ANY, type(goal)(verb="lift:LiftLine", fields=fields))


def test_verbs_of_ours_may_be_asked_for_by_their_name_too() -> None:
    with remote(INSTRUMENT) as client:
        kind = type("MoveTo", (MoveTo,), {"__module__": MoveTo.__module__})
        assert action_of(kind()) == ANY
        found = client.execute(kind(x=5e-9)).result
        assert isinstance(found, Standing)
        assert found.x == pytest.approx(5e-9, rel=1e-9)
