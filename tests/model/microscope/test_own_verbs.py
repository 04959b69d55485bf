"""Claims about verbs and z loops of one's own: files outside the package, used as ours are."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from quick_lever import LEVER, PRESSED

from afm_model import ParameterError, VerbError
from afm_model.core import registry
from afm_model.microscope import Approach, Microscope, Scan, Withdraw

from .test_local import APPROACH, local

pytest.importorskip("xarray")
LIFT = {"size": 40e-9, "lift": 30e-9, "line_rate": 10.0}


@pytest.fixture(autouse=True)
def examples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3] / "examples" / "parts"))


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Without the parameters of our loop; a module `poor` with loops that offer less."""
    for name in ("onboard.setpoint_force", "onboard.integral_gain"):
        monkeypatch.delitem(LEVER, name)
    (tmp_path / "poor.py").write_text(
        "from dataclasses import replace\n"
        "from integral import INTEGRAL\n"
        "BLIND = replace(INTEGRAL, moves_z=False, channels=())\n"
        "MUTE = replace(INTEGRAL, channels=INTEGRAL.channels[:1], setpoint=None, settings={})\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.fixture
def volts(bare: None) -> Iterator[Microscope]:
    """A microscope with an integrator as z loop."""
    with Microscope(local(onboard__kind="integral:INTEGRAL")) as made:
        yield made


def test_second_pass_of_a_lift_line_is_the_measured_line_at_its_height():
    with Microscope(local()) as microscope:
        microscope.backend.set_sample({"kind": "plane", "angle_x": 0.1})
        microscope.do(APPROACH)
        line = microscope.do("lift:LiftLine", **LIFT)
        z, deflection = np.asarray(line.z), np.asarray(line.deflection)
        x = line.asked_x.values[0]
        inside = np.abs(x) < 15e-9
        assert np.polyfit(x[inside], z[0][inside], 1)[0] == pytest.approx(-0.1, rel=0.05)
        assert z[1] == pytest.approx(z[0] - deflection[0] - LIFT["lift"], abs=0.1e-9)
        # Off the sample, where the feedback had pressed by 50 nm.
        assert deflection[0].mean() == pytest.approx(PRESSED * 10e-9, rel=0.01)
        assert np.abs(deflection[1][2000:]).max() < 3e-9
        assert np.asarray(line.asked_x)[1] == pytest.approx(np.asarray(line.asked_x)[0], abs=1e-18)
        assert line.z.attrs["units"] == "m"
        # The feedback follows again behind it.
        assert microscope.state.approached
        assert microscope.scan(size_x=20e-9, pixels=4, lines=1, line_rate=20.0).attrs["complete"]


def test_verb_of_ones_own_is_refused_and_named_as_ours_are():
    microscope = Microscope(local())
    with pytest.raises(VerbError, match="LiftLine is not allowed while the tip is withdrawn: it must be approached"):
        microscope.do("lift:LiftLine")
    with pytest.raises(VerbError, match=r"lift = -1.0 m is not allowed: it must be a finite number >= 1e-18"):
        microscope.do("lift:LiftLine", lift=-1.0)
    with pytest.raises(VerbError, match="there is no verb lift_line: it must be one of approach, withdraw, "):
        microscope.do("lift_line")
    with pytest.raises(AttributeError, match="a microscope has no lift_line; its verbs are approach, withdraw"):
        microscope.lift_line()


def test_verb_of_an_installed_package_is_a_word_of_the_microscope(tmp_path, monkeypatch):
    metadata = tmp_path / "lift-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: lift\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[afm_model.verb]\nlift_line = lift:LiftLine\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    registry._offered.cache_clear()
    try:
        microscope = Microscope(local())
        assert "lift_line" in dir(microscope)
        with pytest.raises(VerbError, match="LiftLine is not allowed while the tip is withdrawn"):
            microscope.lift_line(lift=20e-9)
    finally:
        registry._offered.cache_clear()


def test_verb_that_raises_fails_in_a_sentence_with_the_tip_withdrawn(tmp_path, monkeypatch):
    (tmp_path / "broken.py").write_text(
        "from afm_model.microscope import Verb, Task\n"
        "from afm_model.program.orders import Order\n"
        "class Broken(Verb):\n"
        "    on_sample = True\n"
        "    def tasks(self, run):\n"
        "        yield Task(Order(run.view.stay(1e-3)), 1e-3, 'resting')\n"
        "        raise KeyError('nowhere')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    microscope = Microscope(local())
    microscope.do(APPROACH)
    with pytest.raises(VerbError, match="KeyError: 'nowhere'"):
        microscope.do("broken:Broken")
    assert not microscope.state.near
    assert not microscope.backend.instrument.in_contact
    sys.modules.pop("broken")


def test_z_loop_of_ones_own_is_used_by_the_verbs(volts):
    volts.do(APPROACH)
    assert volts.state.setpoint == 5.0
    image = volts.scan(size_x=40e-9, pixels=8, lines=2, line_rate=20.0)
    assert float(abs(image["error"]).max()) < 0.02
    assert image.attrs["Setpoint"] == "5 V"
    assert "Gains" not in image.attrs
    volts.set_setpoint(voltage=6.0)
    assert volts.state.setpoint == 6.0
    curve = volts.force_curve(trigger_voltage=8.0, approach_rate=20e-6, retract_rate=20e-6)
    assert float(curve["triggered"][0]) == 1.0
    assert volts.state.approached
    assert len(volts.do("lift:LiftLine", **LIFT)["z"]) == 2
    volts.do(Withdraw(rate=50e-6))
    assert not volts.backend.instrument.in_contact


@pytest.mark.parametrize(
    ("call", "lacking"),
    [
        (lambda m: m.set_gains(integral=1e-6), "integral_gain"),
        (lambda m: m.set_setpoint(force=1e-9), "setpoint_force"),
        (lambda m: m.set_feedback("hold"), "feedback"),
    ],
)
def test_what_a_z_loop_lacks_is_refused_in_words(volts, call, lacking):
    told = f"{lacking} cannot be set: the z loop onboard.kind = integral:INTEGRAL has no such setting; it has setpoint"
    with pytest.raises(ParameterError, match=told):
        call(volts)
    assert np.isnan(volts.state.integral_gain)
    assert volts.objection(Approach()) == ""
    assert "it must be approached first" in volts.objection(Scan())


def test_loop_that_moves_no_z_is_refused_with_verbs(bare):
    with pytest.raises(ParameterError, match="is not allowed with verbs: it has no channel z_loop"):
        local(onboard__kind="poor:BLIND")


def test_z_loop_without_setpoint_and_error_moves_and_is_not_approached(bare):
    with Microscope(local(onboard__kind="poor:MUTE")) as microscope:
        assert microscope.objection(Approach()) == "Approach is not allowed with a setpoint of nan V: it must be > 0 V"
        microscope.move_to(x=5e-9, y=0.0)
        assert microscope.state.place[0] == pytest.approx(5e-9)
