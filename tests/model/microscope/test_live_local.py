"""Claims about a microscope in this process that goes on by the clock, also between two verbs."""

import threading
import time

import pytest

from afm_model import VerbError
from afm_model.microscope import Live, Microscope
from afm_model.microscope.results import CANCELLED

pytest.importorskip("xarray")
FACTOR = 2.0


def until(microscope, predicate, timeout=60.0):
    """Wait for pieces of the run until `predicate` holds."""
    limit, backend = time.monotonic() + timeout, microscope.backend
    while not predicate():
        assert time.monotonic() < limit, microscope.state
        with backend._moved:
            backend._moved.wait(1.0)


@pytest.fixture(scope="module")
def microscope():
    run = {"mode": "realtime", "real_time_factor": FACTOR}
    with Microscope("two_materials", run=run, engaged=True) as made:
        yield made


def test_time_goes_on_between_two_verbs_by_the_factor_of_real_time(microscope):
    assert isinstance(microscope.backend, Live)
    begin, wall = microscope.backend.time, time.monotonic()
    until(microscope, lambda: microscope.backend.time > begin + 0.2)
    # Not faster than the clock; how much slower is a matter of the machine.
    assert microscope.backend.time - begin <= FACTOR * (time.monotonic() - wall) + 0.05


def test_loop_follows_a_new_setpoint_without_a_verb(microscope):
    before = microscope.state.setpoint
    microscope.set_setpoint(voltage=2.0 * before)
    until(microscope, lambda: microscope.read_signals("deflection_voltage")["deflection_voltage"].value > 1.9 * before)
    microscope.set_setpoint(voltage=before)


def test_signals_are_read_and_a_scan_is_stopped_from_another_thread(microscope):
    done, failed = threading.Event(), []

    def scan():
        try:
            microscope.scan(size_x=100e-9, pixels=16, lines=4000, line_rate=20.0)
        except VerbError as error:
            failed.append(error)
        done.set()

    threading.Thread(target=scan).start()
    until(microscope, lambda: microscope.state.doing == "Scan")
    places = set()
    until(microscope, lambda: len(places.add(microscope.read_signals("x")["x"].value) or places) > 3)
    microscope.stop(stay=True)
    assert done.wait(60.0)
    assert str(failed[0]) == "Scan was stopped; the tip stays on the sample"
    assert microscope.outcome.status == CANCELLED
    assert microscope.state.approached


def test_pause_in_a_verb_lets_time_stand_still_and_goes_on(microscope):
    times = []

    def on_progress(progress):
        if not times:
            microscope.pause()
            times.append(microscope.backend.time)
        elif len(times) < 3:
            times.append(microscope.backend.time)
        elif len(times) == 3:
            microscope.resume()
            times.append(microscope.backend.time)

    microscope.on_progress = on_progress
    try:
        image = microscope.scan(size_x=100e-9, pixels=16, lines=2, line_rate=20.0)
    finally:
        microscope.on_progress = None
    assert image.complete == 1
    assert times[1:] == times[1:2] * 3


def test_sample_is_exchanged_while_time_goes_on(microscope):
    microscope.withdraw()
    microscope.set_sample(width=50e-9)
    assert microscope.backend.instrument.parameters.sample.width == 50e-9
    begin = microscope.backend.time
    until(microscope, lambda: microscope.backend.time > begin)
    microscope.approach(rate=10e-6)


def test_closed_microscope_has_withdrawn_its_tip_and_no_thread():
    made = Microscope("two_materials", run={"mode": "realtime", "real_time_factor": 10.0}, engaged=True)
    made.close()
    made.close()
    assert not made.state.near
    assert not made.backend._thread.is_alive()
