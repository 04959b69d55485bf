"""Parameters of a node are those of the model: declared with unit and range, checked at start and at every change."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, ParameterType, ParameterValue, SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter, get_parameter_value, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from support import Graph

from afm_model import ParameterError, flatten, specifications
from afm_model.core.registry import names
from afm_model.parameters import Group
from afm_node_common.parameters import declare
from afm_node_common.process import ControllerNodeParameters, SimNodeParameters

TUNABLE = ("law.",)
NO_LAW = (
    f"law.kind = lqr is not allowed: there is no law lqr: it must be one of {', '.join(names('law'))}, "
    "or module:NAME of a part of your own"
)


@pytest.fixture
def graph() -> Iterator[Graph]:
    with Graph() as graph:
        yield graph


@pytest.fixture
def make(graph: Graph) -> Callable[..., Node]:
    """Makes a node with values given at start."""

    def make(**given: object) -> Node:
        overrides = [Parameter(name.replace("__", "."), value=value) for name, value in given.items()]
        return graph.add(Node("owner", parameter_overrides=overrides))

    return make


class Remote:
    """What `ros2 param` does: another node's view through the ordinary services."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._client = AsyncParameterClient(graph.add(Node("other")), "owner")
        graph.spin_until(self._client.services_are_ready)

    def names(self) -> set[str]:
        return set(self._graph.result(self._client.list_parameters()).result.names)

    def describe(self, *names: str) -> list[ParameterDescriptor]:
        return list(self._graph.result(self._client.describe_parameters(list(names))).descriptors)

    def get(self, *names: str) -> list[object]:
        return [
            parameter_value_to_python(value)
            for value in self._graph.result(self._client.get_parameters(list(names))).values
        ]

    def set(self, **values: object) -> list[SetParametersResult]:
        return list(self._graph.result(self._client.set_parameters(self._parameters(values))).results)

    def set_at_once(self, **values: object) -> SetParametersResult:
        return self._graph.result(self._client.set_parameters_atomically(self._parameters(values))).result

    def set_messages(self, *messages: ParameterMessage) -> list[SetParametersResult]:
        """As a foreign program may, with whatever type."""
        return list(self._graph.result(self._client.set_parameters(list(messages))).results)

    def set_messages_at_once(self, *messages: ParameterMessage) -> SetParametersResult:
        return self._graph.result(self._client.set_parameters_atomically(list(messages))).result

    @staticmethod
    def _parameters(values: dict[str, object]) -> list[Any]:
        return [Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()]


# At start.


@pytest.mark.parametrize("model", [SimNodeParameters, ControllerNodeParameters])
def test_every_parameter_is_declared_with_its_default_description_and_unit(
    graph: Graph, make: Callable[..., Node], model: type[Group]
) -> None:
    node = make()
    parameters = declare(node, model)
    assert parameters == model()
    remote = Remote(graph)
    specs = list(specifications(model))
    names = [spec.name for spec in specs]
    assert remote.names() >= set(names)
    assert remote.get(*names) == [spec.default for spec in specs]
    for spec, told in zip(specs, remote.describe(*names), strict=True):
        unit = "" if spec.unit == "1" else f"[{spec.unit}]"
        assert spec.description in told.description
        assert unit in told.description
        assert told.additional_constraints == spec.allowed
        assert told.read_only


def test_range_is_that_of_the_model_with_open_ends_left_out(graph: Graph, make: Callable[..., Node]) -> None:
    declare(make(), SimNodeParameters)
    damping, bits, speed = Remote(graph).describe("scanner.xi_x", "detector.adc_bits", "scanner.f_x")
    assert damping.type == ParameterType.PARAMETER_DOUBLE
    (range_,) = damping.floating_point_range
    assert (range_.from_value, range_.to_value) == (0.0, math.nextafter(1.0, 0.0))
    assert bits.type == ParameterType.PARAMETER_INTEGER
    (range_,) = bits.integer_range
    assert (range_.from_value, range_.to_value, range_.step) == (0, 32, 1)
    # What is declared without a bound has that of its unit.
    (range_,) = speed.floating_point_range
    assert (range_.from_value, range_.to_value) == (1e-7, 1e9)
    assert speed.additional_constraints == "a finite number >= 1e-07 and <= 1e+09"


def test_values_given_at_start_are_taken_and_a_whole_number_will_do(make: Callable[..., Node]) -> None:
    node = make(law__alpha=7, law__kind="sgn", cantilever__a=1e-9)
    parameters = declare(node, ControllerNodeParameters)
    assert (parameters.law.alpha, parameters.law.kind, parameters.cantilever.a) == (7.0, "sgn", 1e-9)
    value = node.get_parameter("law.alpha").value
    assert (value, type(value)) == (7.0, float)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"law__alfa": 3.0}, "unknown parameter law.alfa: did you mean law.alpha?"),
        ({"law__alpha": -3.0}, "law.alpha = -3.0 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"),
        ({"law__alpha": math.nan}, "law.alpha = nan is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"),
        ({"law__alpha": "steep"}, "law.alpha = steep is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"),
        ({"law__kind": "lqr"}, NO_LAW),
        ({"cantilever__a": math.inf}, "cantilever.a = inf m is not allowed: it must be a finite number >= -1 and <= 1"),
        ({"law__alpha": True}, "law.alpha = True is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"),
    ],
)
def test_what_is_not_allowed_at_start_is_refused_in_a_sentence_and_nothing_is_declared(
    make: Callable[..., Node], given: dict[str, object], sentence: str
) -> None:
    node = make(**given)
    before = set(node.get_parameters_by_prefix(""))
    with pytest.raises(ParameterError) as refused:
        declare(node, ControllerNodeParameters)
    assert str(refused.value) == sentence
    assert set(node.get_parameters_by_prefix("")) == before
    with pytest.raises(ParameterNotDeclaredException):
        node.get_parameter("law.kind")


# While the node runs.


def test_change_of_a_tunable_parameter_arrives_checked(graph: Graph, make: Callable[..., Node]) -> None:
    arrived: list[ControllerNodeParameters] = []
    declare(make(law__c_x=2.0), ControllerNodeParameters, tunable=TUNABLE, on_change=arrived.append)
    remote = Remote(graph)
    assert [result.successful for result in remote.set(law__alpha=5.0)] == [True]
    assert [result.successful for result in remote.set(law__kind="sgn")] == [True]
    expected = {**flatten(ControllerNodeParameters()), "law.c_x": 2.0, "law.alpha": 5.0}
    assert [flatten(parameters) for parameters in arrived] == [expected, {**expected, "law.kind": "sgn"}]
    assert remote.get("law.alpha", "law.kind") == [5.0, "sgn"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"law__alpha": 0.0}, "law.alpha = 0.0 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"),
        ({"law__alpha": math.nan}, "law.alpha = nan is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"),
        ({"law__kind": "lqr"}, NO_LAW),
    ],
)
def test_change_that_is_not_allowed_is_refused_with_a_reason_and_the_old_value_stays(
    graph: Graph, make: Callable[..., Node], change: dict[str, object], reason: str
) -> None:
    arrived: list[ControllerNodeParameters] = []
    declare(make(), ControllerNodeParameters, tunable=TUNABLE, on_change=arrived.append)
    remote = Remote(graph)
    (result,) = remote.set(**change)
    assert (result.successful, result.reason) == (False, reason)
    assert remote.get("law.alpha", "law.kind") == [10.0, "tanh"]
    assert arrived == []


def test_change_that_the_node_cannot_work_with_is_refused_with_its_reason(
    graph: Graph, make: Callable[..., Node]
) -> None:
    def accepts(parameters: ControllerNodeParameters) -> None:
        if parameters.law.c_x < 1e-3:  # type: ignore[attr-defined]  # of the law in force
            raise ParameterError("this node needs more than that")

    arrived: list[ControllerNodeParameters] = []
    declare(make(), ControllerNodeParameters, tunable=TUNABLE, accepts=accepts, on_change=arrived.append)
    (result,) = Remote(graph).set(law__c_x=1e-6)
    assert (result.successful, result.reason) == (False, "this node needs more than that")
    assert arrived == []
    with pytest.raises(ParameterError, match="needs more"):
        declare(make(law__c_x=1e-6), ControllerNodeParameters, accepts=accepts)


def test_what_cannot_change_is_refused_with_a_reason(graph: Graph, make: Callable[..., Node]) -> None:
    arrived: list[ControllerNodeParameters] = []
    declare(make(), ControllerNodeParameters, tunable=TUNABLE, on_change=arrived.append)
    remote = Remote(graph)
    (result,) = remote.set(scanner__mass_ratio=50.0)
    assert not result.successful
    assert "read-only" in result.reason
    assert "scanner.mass_ratio" in result.reason
    assert remote.get("scanner.mass_ratio") == [100.0]
    assert arrived == []


def test_whole_number_will_do_for_a_number_that_may_have_decimals(graph: Graph, make: Callable[..., Node]) -> None:
    arrived: list[ControllerNodeParameters] = []
    declare(make(), ControllerNodeParameters, tunable=TUNABLE, on_change=arrived.append)
    remote = Remote(graph)
    assert [result.successful for result in remote.set(law__alpha=5)] == [True]
    assert remote.set_at_once(law__alpha=6, law__c_x=2).successful
    assert [parameters.law.alpha for parameters in arrived] == [5.0, 6.0]
    (value,) = remote.get("law.alpha")
    assert (value, type(value)) == (6.0, float)


def test_text_that_is_a_number_will_do_for_a_number(graph: Graph, make: Callable[..., Node]) -> None:
    """What ros2cli sends of 4e-08: its YAML takes that for text."""
    declare(make(), ControllerNodeParameters, tunable=TUNABLE)
    remote = Remote(graph)
    told = remote.set(law__alpha="4e-08", law__kind="sgn", law__c_x="1e300", law__c_y="4e-08 m")
    assert [result.successful for result in told] == [True, True, False, False]
    assert told[2].reason == "law.c_x = 1e+300 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"
    assert remote.get("law.alpha", "law.kind", "law.c_x") == [4e-08, "sgn", 1.0]


@pytest.mark.parametrize("model", [SimNodeParameters, ControllerNodeParameters])
def test_node_takes_back_all_its_own_values_without_a_change(
    graph: Graph, make: Callable[..., Node], model: type[Group]
) -> None:
    """What `ros2 param load` does with what `ros2 param dump` has written."""
    arrived: list[Group] = []
    declare(make(), model, on_change=arrived.append)
    remote = Remote(graph)
    names = sorted(remote.names())
    values = dict(zip(names, remote.get(*names), strict=True))
    results = remote.set(**values)
    assert [(name, told.reason) for name, told in zip(names, results, strict=True) if not told.successful] == []
    assert remote.set_at_once(**values).successful
    assert arrived == []


def test_simulator_takes_back_all_that_a_dump_of_its_parameters_has_as_ros2_param_load_reads_it(
    graph: Graph, make: Callable[..., Node]
) -> None:
    """ros2cli reads each value of the file once more: on becomes true."""
    arrived: list[Group] = []
    declare(make(onboard__kind="pi", plant__kind="lever"), SimNodeParameters, on_change=arrived.append)
    remote = Remote(graph)
    names = sorted(remote.names())
    values = dict(zip(names, remote.get(*names), strict=True))
    assert values["onboard.feedback"] == "on"
    read = [ParameterMessage(name=name, value=get_parameter_value(str(value))) for name, value in values.items()]
    assert {each.name for each in read if each.value.type == ParameterType.PARAMETER_BOOL} > {"onboard.feedback"}
    told = remote.set_messages(*read)
    assert [(name, each.reason) for name, each in zip(names, told, strict=True) if not each.successful] == []
    assert remote.set_messages_at_once(*read).successful
    assert arrived == []


@pytest.mark.parametrize(
    ("given", "meant"), [(True, "on"), (False, "off"), ("True", "on"), ("false", "off"), ("no", "off")]
)
def test_text_that_yaml_takes_for_a_boolean_is_understood_at_start(
    make: Callable[..., Node], given: object, meant: str
) -> None:
    model = declare(make(onboard__kind="pi", plant__kind="lever", onboard__feedback=given), SimNodeParameters)
    assert flatten(model)["onboard.feedback"] == meant


BAD_VALUES = {
    "no value": (ParameterValue(), "law.alpha cannot be removed: it must be a finite number >= 1e-12 and <= 1e+12"),
    "type that does not exist": (
        ParameterValue(type=77),
        "law.alpha = a value of the unknown type 77 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",
    ),
    "array": (
        ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=[1.0, 2.0]),
        "law.alpha = [1.0, 2.0] is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",
    ),
    "text": (
        ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="steep"),
        "law.alpha = steep is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",
    ),
    "yes": (
        ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True),
        "law.alpha = True is not allowed: it must be a finite number >= 1e-12 and <= 1e+12",
    ),
}


@pytest.mark.parametrize("name", BAD_VALUES)
def test_value_of_a_wrong_type_is_refused_in_a_sentence_and_the_node_goes_on(
    graph: Graph, make: Callable[..., Node], name: str
) -> None:
    declare(make(), ControllerNodeParameters, tunable=TUNABLE)
    value, sentence = BAD_VALUES[name]
    remote = Remote(graph)
    bad = ParameterMessage(name="law.alpha", value=value)
    good = Parameter("law.c_x", value=3.0).to_parameter_msg()
    refused, taken = remote.set_messages(bad, good)
    assert (refused.successful, refused.reason, taken.successful) == (False, sentence, True)
    result = remote.set_messages_at_once(Parameter("law.c_x", value=4.0).to_parameter_msg(), bad)
    assert (result.successful, result.reason) == (False, sentence)
    assert remote.get("law.alpha", "law.c_x") == [10.0, 3.0]


def test_name_that_does_not_exist_is_refused_with_the_nearest_that_does(
    graph: Graph, make: Callable[..., Node]
) -> None:
    declare(make(), ControllerNodeParameters, tunable=TUNABLE)
    (result,) = Remote(graph).set(law__alfa=3.0)
    assert (result.successful, result.reason) == (False, "unknown parameter law.alfa: did you mean law.alpha?")


def test_of_changes_made_at_once_all_are_taken_or_none(graph: Graph, make: Callable[..., Node]) -> None:
    arrived: list[ControllerNodeParameters] = []
    declare(make(), ControllerNodeParameters, tunable=TUNABLE, on_change=arrived.append)
    remote = Remote(graph)
    result = remote.set_at_once(law__c_x=3.0, law__alpha=-1.0)
    assert (result.successful, "law.alpha = -1.0" in result.reason) == (False, True)
    assert remote.get("law.c_x", "law.alpha") == [1.0, 10.0]
    assert remote.set_at_once(law__c_x=3.0, law__alpha=1.0).successful
    assert [(parameters.law.c_x, parameters.law.alpha) for parameters in arrived] == [(3.0, 1.0)]


def test_only_what_is_tunable_can_be_set_on_the_instrument(graph: Graph, make: Callable[..., Node]) -> None:
    tunable = ("run.real_time_factor",)
    declare(make(), SimNodeParameters, tunable=tunable)
    names = [spec.name for spec in specifications(SimNodeParameters)]
    writable = {told.name for told in Remote(graph).describe(*names) if not told.read_only}
    assert writable == set(tunable)
