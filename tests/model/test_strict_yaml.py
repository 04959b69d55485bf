"""A file says one thing to whoever reads it, or it is refused in a sentence, at once."""

import math
from pathlib import Path

import pytest

from afm_model import ScenarioError, load_scenario
from afm_model.parameters.strict_yaml import SIZE_LIMIT, YamlError, read_yaml

BOMB = "a0: &a0 [0, 0]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 31))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "file.yaml"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("-12", -12),
        ("0x1F", 31),
        ("9223372036854775807", 2**63 - 1),
        ("1.5", 1.5),
        ("1e-6", 1e-6),
        ("2.0e-6", 2e-6),
        (".inf", math.inf),
        ("true", True),
        ("off", False),
        ("", None),
        ("[1, 2]", [1, 2]),
        ("{a: {b: text}}", {"a": {"b": "text"}}),
        # Readers differ in what these are: here they are text, which is refused where a number must stand.
        ("1:30", "1:30"),
        ("0b11", "0b11"),
        ("010", "010"),
        ("1_000", "1_000"),
        ("2024-61-01", "2024-61-01"),
        ("2024-01-01", "2024-01-01"),
        ("'1'", "1"),
    ],
)
def test_value_is_what_every_reader_takes_it_for(file: Path, text: str, value: object) -> None:
    file.write_text(text)
    read = read_yaml(file)
    assert (read, type(read)) == (value, type(value))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a: 1\na: 2\n", "the name a is given twice (line 2)"),
        ("a:\n  b: 1\n  b: 1\n", "the name b is given twice (line 3)"),
        ("a: &x 1\nb: 2\n", "anchors and aliases (&, *) are not allowed (line 1)"),
        ("a: {<<: *x}\n", "anchors and aliases (&, *) are not allowed (line 1)"),
        (BOMB, "anchors and aliases (&, *) are not allowed (line 1)"),
        ("a: !!binary aGVsbG8=\n", "the tag tag:yaml.org,2002:binary is not allowed (line 1)"),
        ("a: !!python/name:os.system ''\n", "the tag tag:yaml.org,2002:python/name:os.system is not allowed (line 1)"),
        ("a: 1\n---\nb: 1\n", "a second document begins (line 2)"),
        ("[" * 5000, "more than 32 sections within sections (line 1)"),
        ("".join(" " * i + "a:\n" for i in range(200)), "more than 32 sections within sections (line 33)"),
        (f"a: {'9' * 10_000}\n", f"the whole number {'9' * 37}... (line 1) is not allowed: it must fit in 64 bits"),
        (
            "a: 9223372036854775808",
            "the whole number 9223372036854775808 (line 1) is not allowed: it must fit in 64 bits",
        ),
        ("? [1, 2]\n: 3\n", "a list or a section is no name (line 1)"),
        ("a: " + "x" * SIZE_LIMIT, f"it is too long: it may hold {SIZE_LIMIT} bytes"),
    ],
    ids=range(14),
)
def test_what_is_not_allowed_is_refused_in_a_sentence(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)
    with pytest.raises(YamlError) as refused:
        read_yaml(file)
    assert str(refused.value) == sentence


@pytest.mark.parametrize(
    "content", [b"\xff\xfe\xff", b"a: \x00", b"a: 'b\n", b"- a\nb: c\n", b"%YAML 3.0\n---\na: 1\n"]
)
def test_what_is_no_yaml_is_refused_in_a_sentence(file: Path, content: bytes) -> None:
    file.write_bytes(content)
    with pytest.raises(YamlError) as refused:
        read_yaml(file)
    assert "\n" not in str(refused.value)


# Scenarios.


def scenario(file: Path, *lines: str) -> Path:
    file.write_text("".join(f"{line}\n" for line in lines))
    return file


def test_section_of_a_users_node_is_kept_as_it_stands(file: Path) -> None:
    path = scenario(
        file,
        "/**/afm_sim_node: {ros__parameters: {run: {duration: 1.0}}}",
        "/**/my_node: {ros__parameters: {gain: {x: 2, names: [a, b]}, on_time: yes}}",
    )
    assert load_scenario(path).sections == {
        "/**/afm_sim_node": {"run.duration": 1.0},
        "/**/my_node": {"gain.x": 2, "gain.names": ["a", "b"], "on_time": True},
    }


@pytest.mark.parametrize(
    ("key", "sentence"),
    [
        ("/**/afm_sim_nod", "or in the name of a node of your own: did you mean /**/afm_sim_node?"),
        ("/**/sim_node", "did you mean /**/afm_sim_node?"),
        ("senario", "did you mean scenario?"),
        ("/**/afm_camera_unit", "unknown section /**/afm_camera_unit"),
        ("/**", "unknown section /**"),
        ("my_node", "section my_node is read by no node: it must be /**/my_node"),
    ],
)
def test_mistyped_section_of_ours_is_no_users_node(file: Path, key: str, sentence: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_scenario(scenario(file, f"{key}: {{ros__parameters: {{a: 1}}}}"))
    assert sentence in str(refused.value)


@pytest.mark.parametrize("name", ["my_controller_node", "pid_node", "afm2_node", "controller"])
def test_node_of_a_user_may_be_named_not_unlike_ours(file: Path, name: str) -> None:
    path = scenario(file, f"/**/{name}: {{ros__parameters: {{a: 1}}}}")
    assert load_scenario(path).sections == {f"/**/{name}": {"a": 1}}


@pytest.mark.parametrize("value", ["[1, 2.0]", "[]", "null", "[[1]]"])
def test_value_that_ros_has_no_type_for_is_refused(file: Path, value: str) -> None:
    with pytest.raises(ScenarioError, match=r"section /\*\*/my_node: gain = .* is not allowed: it must be a number"):
        load_scenario(scenario(file, f"/**/my_node: {{ros__parameters: {{gain: {value}}}}}"))


def test_parameter_given_in_two_ways_is_refused(file: Path) -> None:
    path = scenario(file, "/**/afm_sim_node: {ros__parameters: {run: {duration: 1.0}, run.duration: 2.0}}")
    with pytest.raises(ScenarioError, match=r"run\.duration is given twice"):
        load_scenario(path)


@pytest.mark.parametrize("former", ["kind: tanh, ", ""])
def test_override_that_chooses_another_law_drops_what_that_one_does_not_have(
    file: Path, tmp_path: Path, former: str
) -> None:
    path = scenario(file, f"/**/afm_controller_node: {{ros__parameters: {{law: {{{former}alpha: 0.3, z: tracking}}}}}}")
    over = scenario(tmp_path / "over.yaml", "/**/afm_controller_node: {ros__parameters: {law.kind: pid}}")
    law = load_scenario(path, overrides=over).controller.law
    assert (law.kind, law.z) == ("pid", "tracking")
    scenario(over, "/**/afm_controller_node: {ros__parameters: {law.kind: pid, law.alpha: 0.2}}")
    with pytest.raises(ScenarioError, match=r"over\.yaml: unknown parameter law\.alpha"):
        load_scenario(path, overrides=over)
    scenario(over, "/**/afm_controller_node: {ros__parameters: {law.kind: pdi}}")
    with pytest.raises(ScenarioError, match=r"law\.kind = pdi is not allowed"):
        load_scenario(path, overrides=over)


def test_overrides_count_in_place_of_what_the_scenario_gives(file: Path, tmp_path: Path) -> None:
    path = scenario(file, "/**/afm_sim_node: {ros__parameters: {run: {duration: 1.0}, plant.kind: compliant}}")
    over = scenario(tmp_path / "over.yaml", "/**/afm_sim_node: {ros__parameters: {run.duration: 2}}")
    both = load_scenario(path, overrides=over)
    assert (both.name, both.sim.run.duration) == ("file", 2.0)
    assert both.sections == {"/**/afm_sim_node": {"run.duration": 2, "plant.kind": "compliant"}}
    scenario(over, "/**/afm_sim_node: {ros__parameters: {run.duration: -2}}")
    with pytest.raises(ScenarioError, match=r"over\.yaml: run\.duration = -2 s is not allowed"):
        load_scenario(path, overrides=over)
