"""The state machine: every transition there is, none besides, a way back from each safe state."""

import pytest

from afm_model.run import TRANSITIONS, Cause, RunError, RunState
from afm_model.run.state import LIMITS, REASONS, SAFE, TICKING, Life

WAY: dict[RunState, list[Cause]] = {
    RunState.WAITING: [],
    RunState.RUNNING: [Cause.START],
    RunState.PAUSED: [Cause.START, Cause.PAUSE],
    RunState.STALLED: [Cause.START, Cause.UNANSWERED],
    RunState.RETRACTED: [Cause.START, Cause.SILENT],
    RunState.FINISHED: [Cause.START, Cause.END],
    RunState.FAULT: [Cause.START, Cause.ERROR],
    RunState.HELD: [Cause.START, Cause.UNRECORDED],
    RunState.WITHDRAWN: [Cause.START, Cause.FORCE],
    RunState.APPROACHING: [Cause.START, Cause.FORCE, Cause.RESUME],
}
"""How each state is reached from the start."""


def life_in(state: RunState) -> tuple[Life, list[tuple[RunState, str]]]:
    told: list[tuple[RunState, str]] = []
    life = Life(lambda: told.append((life.state, life.detail)))
    for cause in WAY[state]:
        life.go(cause)
    told.clear()
    return life, told


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("state", RunState)
def test_state_changes_as_the_table_says_and_in_no_other_way(state: RunState, cause: Cause) -> None:
    life, told = life_in(state)
    assert life.state == state
    if (state, cause) in TRANSITIONS:
        life.go(cause, "because")
        assert told == [(TRANSITIONS[state, cause], "because")]
    else:
        with pytest.raises(RunError, match=f"a run that is {state.title} cannot change by {cause.name}"):
            life.go(cause, "because")
        assert (life.state, told) == (state, [])


def test_every_state_is_reached_and_left_by_a_reset() -> None:
    assert set(WAY) == set(RunState) == set(TRANSITIONS.values())
    assert all(TRANSITIONS[state, Cause.RESET] == RunState.WAITING for state in RunState)


def test_same_detail_twice_is_told_once() -> None:
    life, told = life_in(RunState.WAITING)
    life.tell("still waiting")
    life.tell("still waiting")
    assert told == [(RunState.WAITING, "still waiting")]


@pytest.mark.parametrize("state", SAFE)
def test_safe_state_has_a_way_back_to_the_controller_without_a_reset(state: RunState) -> None:
    reached, rest = {state}, [state]
    while rest:
        here = rest.pop()
        for (origin, cause), target in TRANSITIONS.items():
            if origin == here and cause not in (Cause.RESET, Cause.PLAY) and target not in reached:
                reached.add(target)
                rest.append(target)
    assert RunState.RUNNING in reached


def test_every_safe_state_has_a_reason() -> None:
    assert set(REASONS) == {*(SAFE - {RunState.WITHDRAWN, RunState.APPROACHING}), *LIMITS}
    assert SAFE | {RunState.RUNNING} == TICKING | {RunState.HELD}
