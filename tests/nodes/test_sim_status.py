"""The names and numbers of the model are those of the messages."""

from afm_msgs.msg import InstrumentStatus, Score

from afm_model.run import Counts, RunState


def test_states_are_the_constants_of_the_status_message() -> None:
    fields = set(InstrumentStatus.get_fields_and_field_types())
    constants = {name: getattr(InstrumentStatus, name) for name in dir(InstrumentStatus) if name.isupper()}
    constants = {name: value for name, value in constants.items() if isinstance(value, int)}
    assert constants == {state.name: int(state) for state in RunState}
    assert "state" in fields


def test_everything_that_is_counted_is_in_the_score() -> None:
    told = set(Score.get_fields_and_field_types())
    # The scored part of the retracted ticks is told as a fraction.
    assert set(Counts.__slots__) - told == {"scored_ticks_retracted"}
    assert "retracted_fraction" in told
