"""The state machine: every transition there is, none besides, and the picture of it in the docs."""

import re
from pathlib import Path

import pytest

from afm_model.run import TRANSITIONS, Cause, RunError, State
from afm_model.run.state import Life

DOCS = Path(__file__).parents[3] / "docs" / "topics.md"
WAY: dict[State, list[Cause]] = {
    State.WAITING: [],
    State.RUNNING: [Cause.START],
    State.PAUSED: [Cause.START, Cause.PAUSE],
    State.STALLED: [Cause.START, Cause.UNANSWERED],
    State.RETRACTED: [Cause.START, Cause.SILENT],
    State.FINISHED: [Cause.START, Cause.END],
    State.FAULT: [Cause.START, Cause.ERROR],
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


def test_picture_in_the_docs_shows_every_transition_and_its_cause() -> None:
    drawn = set(re.findall(r"^    ([A-Z]+) --> ([A-Z]+): (.+)$", DOCS.read_text(), re.MULTILINE))
    told = {
        (state.name, target.name, cause.value)
        for (state, cause), target in TRANSITIONS.items()
        if cause != Cause.RESET  # from everywhere: said in words
    }
    assert drawn == told
