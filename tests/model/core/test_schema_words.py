"""Words that a reader of YAML 1.1 takes for booleans or numbers, where a parameter has them as its choices."""

from typing import Literal

import pytest
import yaml
from pydantic import Field

from afm_model.core.errors import ParameterError
from afm_model.core.schema import Group, build


class Words(Group):
    switch: Literal["on", "hold", "off"] = Field("hold", description="a switch")
    order: Literal["1", "2", "1e3"] = Field("2", description="an order")
    both: Literal["on", "yes"] = Field("on", description="two that are the same to YAML")


@pytest.mark.parametrize("word", ["on", "off", "On", "OFF", "yes", "no", "true", "False"])
def test_choice_that_yaml_takes_for_a_boolean_is_understood_as_it_was_written_and_as_it_arrives(word: str) -> None:
    read = yaml.safe_load(word)
    assert isinstance(read, bool)
    for given in (word, read, str(read)):
        assert build(Words, {"switch": given}).switch == ("on" if read else "off")


@pytest.mark.parametrize("word", ["1", "2", "1e3"])
def test_choice_that_yaml_takes_for_a_number_is_understood(word: str) -> None:
    for given in (word, float(word), str(float(word))):
        assert build(Words, {"order": given}).order == word


@pytest.mark.parametrize(
    ("name", "value"), [("both", True), ("order", True), ("switch", 1), ("switch", "loud"), ("order", 3)]
)
def test_value_that_means_no_choice_or_two_of_them_is_refused(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"{name} = {value} is not allowed"):
        build(Words, {name: value})
