"""Claims about memory: what an instrument and a law take is what their parameters need."""

import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from afm_model import Controller, Instrument, build
from afm_model.parameters import ControllerParameters, InstrumentParameters

LATE = {"fault.late.kind": "latency", "fault.late.signal": "drive", "fault.late.size": 1e-5}


def arrays_of(make: Callable[[], Any]) -> int:
    """Bytes in the arrays of what is made."""
    make()  # what is made once in a process
    tracemalloc.start()
    try:
        made = make()
        snapshot = tracemalloc.take_snapshot()
        del made
    finally:
        tracemalloc.stop()
    of_numpy = tracemalloc.DomainFilter(inclusive=True, domain=np.lib.tracemalloc_domain)
    return sum(trace.size for trace in snapshot.filter_traces([of_numpy]).traces)


def instrument(**values: Any) -> int:
    parameters = build(InstrumentParameters, values)
    return arrays_of(lambda: Instrument(parameters, block_ticks=1))


def test_plain_instrument_takes_50_kilobytes_and_one_with_faults_what_they_need():
    assert instrument() < 50_000
    assert instrument(**LATE) > 3_000_000  # 256 commands with a horizon may be on their way


@pytest.mark.parametrize(("reserve", "most"), [(0, 300_000), (500, 2_000_000)])
def test_predictive_law_takes_what_its_answers_need(reserve, most):
    values = {"law.kind": "predictive", "law.period": 5e-5, "law.reserve": reserve}
    parameters = build(ControllerParameters, values)
    assert most / 2 < arrays_of(lambda: Controller(parameters)) < most


def test_law_whose_memory_changes_its_size_begins_anew_and_goes_on_otherwise():
    def of(**values: Any) -> ControllerParameters:
        return build(ControllerParameters, {"law.kind": "predictive", "law.period": 5e-5} | values)

    law = Controller(of())
    law.answer(Instrument(build(InstrumentParameters, {}), 1).measurement)
    law.parameters = of(**{"law.response": 2e-4})
    assert law.state.started == 1.0
    law.parameters = of(**{"law.reserve": 20})
    assert law.state.started == 0.0


def test_faults_that_were_taken_away_are_gone_after_a_reset():
    plain, late = build(InstrumentParameters, {}), build(InstrumentParameters, LATE)
    scope = Instrument(plain, 100)
    scope.set_faults(late)
    drive = scope.drive + 1e-3
    for _ in range(20):
        scope.tick(2.0 * drive)
    scope.set_faults(plain)
    scope.reset()
    scope.tick(drive)
    assert np.array_equal(scope.drive, drive)
