"""The state machine: every transition there is, none besides, a way back from each safe state."""

import pytest

from afm_model.run import TRANSITIONS, Cause, RunError, State
from afm_model.run.state import LIMITS, REASONS, SAFE, TICKING, Life

WAY: dict[State, list[Cause]] = {
    State.WAITING: [],
    State.RUNNING: [Cause.START],
    State.PAUSED: [Cause.START, Cause.PAUSE],
    State.STALLED: [Cause.START, Cause.UNANSWERED],
    State.RETRACTED: [Cause.START, Cause.SILENT],
    State.FINISHED: [Cause.START, Cause.END],
    State.FAULT: [Cause.START, Cause.ERROR],
    State.HELD: [Cause.START, Cause.UNRECORDED],
    State.WITHDRAWN: [Cause.START, Cause.FORCE],
    State.APPROACHING: [Cause.START, Cause.FORCE, Cause.RESUME],
}
"""How each state is reached from the start."""


def life_in(state: State) -> tuple[Life, list[tuple[State, str]]]:
    told: list[tuple[State, str]] = []
    life = Life(lambda: told.append((life.state, life.detail)))
    for cause in WAY[state]:
        life.go(cause)
    told.clear()
    return life, told


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("state", State)
def test_state_changes_as_the_table_says_and_in_no_other_way(state: State, cause: Cause) -> None:
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
    assert set(WAY) == set(State) == set(TRANSITIONS.values())
    assert all(TRANSITIONS[state, Cause.RESET] == State.WAITING for state in State)


def test_same_detail_twice_is_told_once() -> None:
    life, told = life_in(State.WAITING)
    life.tell("still waiting")
    life.tell("still waiting")
    assert told == [(State.WAITING, "still waiting")]


@pytest.mark.parametrize("state", SAFE)
def test_safe_state_has_a_way_back_to_the_controller_without_a_reset(state: State) -> None:
    reached, rest = {state}, [state]
    while rest:
        here = rest.pop()
        for (origin, cause), target in TRANSITIONS.items():
            if origin == here and cause not in (Cause.RESET, Cause.PLAY) and target not in reached:
                reached.add(target)
                rest.append(target)
    assert State.RUNNING in reached


def test_every_safe_state_has_a_reason() -> None:
    assert set(REASONS) == {*(SAFE - {State.WITHDRAWN, State.APPROACHING}), *LIMITS}
    assert SAFE | {State.RUNNING} == TICKING | {State.HELD}
