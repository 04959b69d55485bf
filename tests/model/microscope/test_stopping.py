"""Claims about verbs that are stopped, paused or broken off: nothing that was measured is lost, the tip is safe."""

import threading

import pytest

from afm_model import VerbError
from afm_model.microscope import Microscope, Scan
from afm_model.microscope.results import CANCELLED, COMPLETE
from afm_model.run.state import RunState

pytest.importorskip("xarray")
FAST = {"rate": 20e-6, "range": 2e-6, "settle": 5e-3}
LONG = {"size_x": 80e-9, "pixels": 16, "lines": 500, "line_rate": 20.0}


class Told(BaseException):
    """What no `except Exception` catches."""


@pytest.fixture(scope="module")
def microscope():
    """One at its start; each test approaches."""
    with Microscope("two_materials", sample={"width": 20e-9}) as made:
        yield made


@pytest.fixture(autouse=True)
def approached(microscope):
    """Lines are counted anew."""
    microscope.on_line = microscope.on_progress = None
    if not microscope.state.approached:
        microscope.approach(**FAST)


def is_kept_and_safe(microscope, status=CANCELLED):
    """What a verb leaves that was broken off."""
    outcome = microscope.outcome
    assert outcome.status == status
    assert 1 <= outcome.result.lines_done < 500
    assert not microscope.state.near
    assert not microscope.backend.instrument.in_contact
    return outcome


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, Told])
def test_whatever_a_callback_raises_the_lines_are_kept_and_the_tip_is_withdrawn(microscope, error):
    seen = []

    def on_line(line):
        seen.append(line)
        if len(seen) == 3:
            raise error

    microscope.on_line = on_line
    with pytest.raises(error):
        microscope.scan(**LONG)
    image = is_kept_and_safe(microscope).result
    # Also the line that the error came with, and those that were measured meanwhile.
    assert image.lines_done >= 2
    assert image.data["height", seen[2].direction][seen[2].index].tolist() == seen[2].channels["height"].tolist()


def test_stop_ends_a_scan_with_what_was_measured(microscope):
    microscope.on_line = lambda line: microscope.stop()
    with pytest.raises(VerbError, match="Scan was stopped; the tip is withdrawn") as raised:
        microscope.scan(**LONG)
    assert raised.value.outcome is is_kept_and_safe(microscope)


def test_stop_with_the_last_line_withdraws_the_tip_too(microscope):
    microscope.on_line = lambda line: microscope.stop()
    with pytest.raises(VerbError, match="stopped at its end; the tip is withdrawn"):
        microscope.scan(**LONG | {"lines": 1})
    assert microscope.outcome.result.complete
    assert not microscope.state.near


def test_time_stands_still_in_a_pause_until_another_thread_resumes(microscope):
    stood = []

    def on_progress(progress):
        stood.append(microscope.backend.time)
        if len(stood) == 1:
            microscope.pause()
        elif len(stood) == 4:
            threading.Thread(target=microscope.resume).start()

    microscope.on_progress = on_progress
    microscope.scan(**LONG | {"lines": 2})
    assert microscope.outcome.status == COMPLETE
    assert stood[0] == stood[1] == stood[2] == stood[3] < stood[-1]


def test_stop_ends_a_pause(microscope):
    looks = []

    def on_progress(progress):
        looks.append(progress)
        if microscope.outcome is None and len(looks) == 1:
            microscope.pause()
        elif len(looks) == 3:
            microscope.stop()

    microscope.on_progress = on_progress
    with pytest.raises(VerbError, match="Scan was stopped"):
        microscope.scan(**LONG)
    assert not microscope.state.near


def test_a_part_of_a_record_of_thermal_noise_gives_no_spring_constant():
    with Microscope("two_materials", sample={"width": 20e-9}, plant={"temperature": 295.0}) as warm:
        warm.on_progress = lambda progress: warm.stop()
        with pytest.raises(VerbError, match="ThermalTune was stopped"):
            warm.thermal_tune(duration=0.5)
        assert warm.outcome.result is None


def test_there_is_nothing_to_pause_between_two_verbs(microscope):
    with pytest.raises(VerbError, match="there is nothing to pause"):
        microscope.pause()
    with pytest.raises(VerbError, match="there is nothing to resume"):
        microscope.resume()


def test_close_withdraws_the_tip_from_a_verb_that_is_being_done(microscope):
    backend = microscope.backend
    backend.engine.begin(Scan(**LONG))
    backend.step()
    backend.close()
    assert not backend.operator.busy
    assert not microscope.state.near


def test_feedback_is_off_after_a_scan_that_was_cancelled_or_failed_and_on_again_after_an_approach(microscope):
    microscope.on_line = lambda line: microscope.stop()
    with pytest.raises(VerbError, match="Scan was stopped"):
        microscope.scan(**LONG)
    assert (microscope.state.approached, microscope.state.feedback) == (False, "off")
    with pytest.raises(VerbError, match="no sample within range"):
        microscope.approach(rate=20e-6, range=1e-8, settle=5e-3)
    assert (microscope.state.approached, microscope.state.feedback) == (False, "off")
    microscope.on_line = None
    microscope.approach(**FAST)
    assert (microscope.state.approached, microscope.state.feedback) == (True, "on")


def test_a_limit_that_withdraws_the_tip_between_two_verbs_leaves_it_withdrawn_with_feedback_off():
    # The sample drifts into a tip that is held.
    with Microscope("two_materials", drift={"rate_z": 1e-7}, safety={"force_limit": 20e-9}) as held:
        held.approach(**FAST)
        held.set_feedback("hold")
        engine = held.backend.engine
        while engine.state != RunState.WITHDRAWN:
            held.backend.step()
        assert (held.state.approached, held.state.near, held.state.feedback) == (False, False, "off")
        while held.backend.instrument.in_contact:
            held.backend.step()
        held.resume()
        while engine.state != RunState.RUNNING:
            held.backend.step()
        held.set_feedback("on")
        held.approach(**FAST | {"range": 4e-6})
        assert held.state.approached
