"""Claims about the class Microscope: words of automated microscopy, labelled arrays, errors, Ctrl-C."""

import inspect
import os
import signal

import numpy as np
import pytest

from afm_model import ParameterError, ScenarioError, VerbError
from afm_model.microscope import Approach, Microscope, Scan, to_xarray

xarray = pytest.importorskip("xarray")
FAST = {"rate": 20e-6, "range": 2e-6, "settle": 5e-3}


@pytest.fixture(scope="module")
def microscope():
    """One that has approached."""
    with Microscope("two_materials", sample={"width": 20e-9}) as made:
        made.approach(**FAST)
        yield made


def test_words_return_labelled_arrays_with_units(microscope):
    image = microscope.get_scan(size_x=80e-9, size_y=20e-9, pixels=16, lines=2, line_rate=20.0)
    assert image["lateral"].dims == ("direction", "y", "x")
    assert image["lateral"].attrs["units"] == "N"
    assert image["height"].attrs["units"] == "m"
    friction = image["friction"].sel(y=0.0, method="nearest")
    strong, weak = friction.sel(x=12e-9, method="nearest"), friction.sel(x=-8e-9, method="nearest")
    assert float(weak / strong) == pytest.approx(0.5, rel=0.03)
    # The same as of the verb itself.
    assert image.identical(to_xarray(microscope.outcome.result))
    loop = microscope.friction_loop(length=10e-9, line_rate=20.0)
    assert set(loop.data_vars) == {"position", "lateral", "deflection"}
    place = microscope.go_to(x=10e-9, y=5e-9)
    assert (place.x, place.y) == pytest.approx((10e-9, 5e-9))
    curve = microscope.get_spectrum(x=-30e-9, trigger_force=20e-9, approach_rate=20e-6, retract_rate=20e-6)
    assert microscope.state.place == pytest.approx((-30e-9, 5e-9))
    assert float(curve["force"].max()) == pytest.approx(20e-9, rel=0.1)


def test_an_individual_line_and_a_path_are_measured_where_they_are_asked_for(microscope):
    given = {"size_x": 40e-9, "pixels": 8, "line_rate": 20.0, "channels": "x, y, lateral"}
    across = microscope.scan_individual_line("horizontal", coord=7e-9, **given)
    assert np.asarray(across["measured_y"]) == pytest.approx(7e-9, abs=0.1e-9)
    along = microscope.scan_individual_line("vertical", coord=-6e-9, **given)
    assert np.asarray(along["measured_x"]) == pytest.approx(-6e-9, abs=0.1e-9)
    assert np.asarray(along["measured_y"][0, 0]) == pytest.approx(np.linspace(-17.5e-9, 17.5e-9, 8), abs=0.1e-9)
    path = microscope.scan_arbitrary_path([(0.0, 0.0), (20e-9, 0.0), (20e-9, 10e-9)], speed=0.5e-6)
    x, y = np.asarray(path["x"]), np.asarray(path["y"])
    assert (x[0], y[0]) == pytest.approx((0.0, 0.0), abs=0.5e-9)
    assert (x[-1], y[-1]) == pytest.approx((20e-9, 10e-9), abs=0.5e-9)
    # On the lines, but for the rounded corner: within a period of the resonance of 500 Hz, 1 nm.
    assert np.minimum(np.abs(y), np.abs(x - 20e-9)).max() < 0.5e-9


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda m: m.scan(pixels=0), "pixels = 0 is not allowed: it must be a whole number >= 2 and <= 8192"),
        (lambda m: m.scan(pixel=8), r"unknown parameter pixel: did you mean pixels\?"),
        (lambda m: m.scan(size_x=1e-3), "outside the travel of the scanner: it must be within"),
        (lambda m: m.approach(), "Approach is not allowed: the tip is on the sample already"),
        (lambda m: m.scan_individual_line("diagonal"), "it must be horizontal or vertical"),
        (lambda m: m.scan_arbitrary_path([0.0, 1.0]), r"must be of shape \(n, 2\)"),
        (lambda m: m.scan_arbitrary_path([(0.0, 0.0)]), "a path of 1 x and 1 y is not allowed"),
        (lambda m: m.scan_arbitrary_path([(0.0, 0.0)] * 2), "places 0 and 1 of the path are the same"),
    ],
)
def test_what_is_not_allowed_is_said_in_a_sentence_and_nothing_moves(microscope, call, told):
    before = microscope.backend.time
    with pytest.raises(VerbError, match=told):
        call(microscope)
    assert microscope.backend.time == before
    assert microscope.state.approached


def test_calls_of_dtmicroscope_work_as_they_are(microscope):
    image = microscope.get_scan(channels=["height", "lateral"], size_x=40e-9, pixels=8, lines=1, line_rate=20.0)
    assert {"height", "lateral"} <= set(image.data_vars)
    curve = microscope.get_spectrum(location=(5e-9, 0.0), trigger_force=20e-9, approach_rate=20e-6, retract_rate=20e-6)
    assert float(curve.attrs["x"] if "x" in curve.attrs else curve["x"][0]) == pytest.approx(5e-9)
    with pytest.raises(VerbError, match=r"location must be a pair \(x, y\)"):
        microscope.get_spectrum((0.0, 0.0), x=1e-9)


def test_words_complete_the_names_of_fields_and_have_help(microscope):
    for word, verb in ((microscope.scan, Scan), (microscope.get_scan, Scan), (microscope.approach, Approach)):
        assert set(verb.model_fields) <= set(inspect.signature(word).parameters), word
    fields = inspect.signature(microscope.scan).parameters
    assert fields["pixels"].default == 128
    assert "size_x [m]: width of the frame" in microscope.scan.__doc__
    assert list(inspect.signature(microscope.get_spectrum).parameters)[:3] == ["location", "x", "y"]


def test_a_preset_or_a_parameter_that_does_not_exist_is_refused():
    with pytest.raises(ScenarioError, match="unknown scenario two_material"):
        Microscope("two_material")
    with pytest.raises(ParameterError, match=r"unknown parameter sample.widht: did you mean sample.width\?"):
        Microscope("two_materials", sample={"widht": 1e-9})
    with pytest.raises(ParameterError, match="sample = 5 is not allowed: it must be parameters by name"):
        Microscope("two_materials", sample=5)


@pytest.mark.parametrize(
    ("group", "told"),
    [("plant", "plant has kind, "), ("sample", "sample has kind, "), ("qqqq", "known are contact.*, ")],
)
def test_a_name_like_no_other_is_told_the_names_of_its_group_not_all_of_them(group, told):
    with pytest.raises(ParameterError) as refused:
        Microscope("two_materials", **{group: {"qqqq": 1.0}})
    sentence = str(refused.value)
    assert sentence.startswith(f"unknown parameter {group}.qqqq: {told}")
    assert sentence.count(",") < 50
    assert len(sentence) < 500


def test_ctrl_c_withdraws_the_tip_and_keeps_what_was_measured():
    with Microscope("two_materials") as microscope:
        microscope.approach(**FAST)

        def press(line):
            os.kill(os.getpid(), signal.SIGINT)

        microscope.on_line = press
        with pytest.raises(KeyboardInterrupt):
            microscope.scan(size_x=80e-9, pixels=16, lines=500, line_rate=20.0)
        assert not microscope.state.near
        assert not microscope.backend.instrument.in_contact
        assert 1 <= microscope.outcome.result.lines_done < 500


def test_at_the_end_the_tip_is_withdrawn():
    with Microscope("step_grating") as microscope:
        microscope.do(Approach(**FAST))
        assert microscope.objection(Scan(lines=1, pixels=8, line_rate=20.0)) == ""
    assert not microscope.state.near
