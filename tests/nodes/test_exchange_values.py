"""What stands as text in a request for another sample or probe, and what becomes of text that is no value."""

import pytest

from afm_model.core.errors import ParameterError
from afm_sim_node.settings import _values


def test_text_is_read_as_a_number_true_false_or_a_word() -> None:
    texts = {"4.0e-7": 4e-7, "1e-9": 1e-9, "-3": -3, "010": 10, "true": True, "False": False, "patches": "patches"}
    texts |= {"/tmp/a: b #1.npy": "/tmp/a: b #1.npy", "1:30": "1:30"}
    read = _values(list(map(str, range(len(texts)))), list(texts))
    assert list(read.values()) == list(texts.values())
    assert [type(value) for value in read.values()] == [type(value) for value in texts.values()]


@pytest.mark.parametrize("text", ["2020-13-45", "1" * 5000, "[" * 3000, "!!int foo", "!!timestamp x", "!!bool maybe"])
def test_text_that_breaks_a_reader_of_yaml_is_a_value_like_any_other(text: str) -> None:
    assert _values(["width"], [text]) == {"width": float("inf") if text.isdigit() else text}


@pytest.mark.parametrize(
    ("names", "values", "sentence"),
    [
        (["kind"], [], "1 names with 0 values are not allowed"),
        (["kind"], [" "], "kind =  is not allowed: it must be a number, true, false or a word"),
        (["width", "width"], ["1", "2"], "the name width is given twice"),
    ],
)
def test_names_need_one_value_each(names: list[str], values: list[str], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        _values(names, values)
