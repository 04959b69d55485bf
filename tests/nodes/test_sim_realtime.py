"""Realtime over real topics: ticks follow the clock, the last drive holds, a silent controller costs no sample."""

import itertools
import math
import re
import time

import numpy as np
import pytest
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hand_controller import answer
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from realtime_bench import PERIOD, bench, gentle

from afm_bringup.session_scorecard import summary_of
from afm_model.run import RunState
from afm_node_common import topics
from afm_sim_node.declared import block_ticks


def test_last_drive_is_held_while_none_arrives_and_every_such_tick_is_counted() -> None:
    def stops(measurement: Measurement) -> list[PiezoDrive]:
        return [answer(measurement, 0.05, -0.02)] if measurement.sequence < 10 else []

    with bench(stops, ticks=40) as b:
        status = b.run_to_the_end()
        arrived = np.flatnonzero(np.isfinite(b.round_trips))
        held = b.drives[arrived[-1] :]
        assert np.array_equal(held, np.broadcast_to(held[0], held.shape))
        assert tuple(held[0][:2]) == (0.05, -0.02)
        # There were ten answers; one that came late may be older than another.
        assert status.drives_lost == 40 - len(arrived) >= 30
        assert (status.ticks, status.state, status.mode) == (40, InstrumentStatus.FINISHED, "realtime")
        score = b.observer.scores[-1]
        assert not score.valid
        assert score.reason.startswith(f"{status.drives_lost} of 40 scored ticks (")


def test_drive_of_an_answer_is_in_force_from_the_next_tick_on() -> None:
    with bench(gentle, ticks=40, factor=0.02) as b:
        status = b.run_to_the_end()
        # Measurement k goes out when tick k begins to be waited for; its answer is there 50 ms later.
        arrived = np.isfinite(b.round_trips)
        assert np.array_equal(b.drives[arrived, 0], 1e-3 * (np.arange(40)[arrived] % 5))
        assert arrived.sum() == 40 - status.drives_lost > 0
        assert np.all(b.round_trips[arrived] > 0.0)


def test_lateness_and_age_of_the_command_are_scored() -> None:
    with bench(gentle, ticks=40) as b:
        b.run_to_the_end()
        score = b.observer.scores[-1]
        for times in (score.lateness, score.command_age, score.round_trip):
            assert 0.0 < times.p50 <= times.p99 <= times.p99_9 <= times.max < score.wall
        # A drive acts at the next tick at the soonest: a period of 5 ms after its measurement, if that was not late.
        assert score.command_age.p50 >= 0.98 * PERIOD / 0.2 - score.lateness.max
        assert (score.late_ticks, score.periods_missed) == (b.counts.late_ticks, b.counts.periods_missed)


def test_round_trip_is_the_time_that_the_controller_took_whatever_the_period() -> None:
    """The controller's own watch is the judge: it bounds every round trip from below, and nearly from above."""
    seen: dict[int, float] = {}
    sent: dict[int, float] = {}

    def watched(measurement: Measurement) -> list[PiezoDrive]:
        seen[measurement.sequence] = time.monotonic()
        while time.monotonic() < seen[measurement.sequence] + 5e-3:
            pass
        drive = gentle(measurement)
        sent[measurement.sequence] = time.monotonic()
        return drive

    # A period of 50 ms: the drive waits for the tick nine times as long as it took.
    with bench(watched, ticks=40, factor=0.02) as b:
        b.run_to_the_end()
        trips, score = b.round_trips, b.observer.scores[-1]
        in_time = [k for k in range(40) if np.isfinite(trips[k]) and b.drives[k, 0] == 1e-3 * (k % 5)]
        assert len(in_time) > 3  # all but a few, unless the machine is busy
        took = np.array([sent[k] - seen[k] for k in in_time])
        assert np.all(trips[in_time] > took)
        # On the way: most messages take less than the rest of the period.
        assert np.median(trips[in_time] - took) < 0.5 * np.median(score.command_age.p50 - took)
        assert score.round_trip.p50 == pytest.approx(np.nanmedian(trips[1:]), rel=0.2)


def test_round_trip_of_the_score_leaves_out_what_was_published_before_the_first_drive_arrived() -> None:
    """As when the nodes find each other late: only the recording shows it."""

    def late_at_first(measurement: Measurement) -> list[PiezoDrive]:
        end = time.monotonic() + (0.1 if measurement.sequence == 0 else 0.0)
        while time.monotonic() < end:
            pass
        return gentle(measurement)

    with bench(late_at_first, ticks=30) as b:
        b.run_to_the_end()
        trips = b.round_trips
        first = int(np.flatnonzero(np.isfinite(trips))[0])
        assert trips[first] > 0.1
        # On a busy machine the next ones were published before that, too.
        assert b.observer.scores[-1].round_trip.max in trips[first + 1 :]


def test_drive_for_an_older_measurement_that_comes_later_is_not_put_in_force_and_told() -> None:
    """Every drive is followed by the one for the measurement before: by its arrival that would be the newest."""
    before: list[Measurement] = []

    def backwards(measurement: Measurement) -> list[PiezoDrive]:
        stale = [answer(before[-1], -0.05, 0.0)] if before else []
        before.append(measurement)
        return [answer(measurement, 0.05, 0.0), *stale]

    with bench(backwards, ticks=400) as b:
        reports: list[DiagnosticArray] = []
        b.observer.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
        sentence = "drives answered an older measurement than one before them and were not put in force"
        b.graph.spin_until(lambda: sentence in b.observer.status.warning)
        b.graph.spin_until(lambda: reports and sentence in reports[-1].status[0].message)
        assert reports[-1].status[0].level == DiagnosticStatus.WARN
        status = b.run_to_the_end()
        x = b.drives[:, 0]
        assert set(x[np.argmax(x > 0.0) :]) == {0.05}
        # The last pair or two may come after the end.
        assert 380 < status.drives_outdated < 400
        assert b.observer.scores[-1].drives_outdated == status.drives_outdated


def test_missed_periods_are_a_warning_with_their_share_and_the_factor_reached() -> None:
    # A period of 2 us of wall time: nobody keeps that.
    with bench(gentle, factor=500.0) as b:
        reports: list[DiagnosticArray] = []
        b.observer.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
        pattern = re.compile(
            r"\d+ of the last \d+ periods were missed \([\d.]+ %\): the run reaches [\d.]+ of real time in place of 500"
        )
        b.graph.spin_until(lambda: pattern.search(b.observer.status.warning))
        b.graph.spin_until(lambda: reports and pattern.search(reports[-1].status[0].message))
        assert reports[-1].status[0].level == DiagnosticStatus.WARN


def test_score_of_a_run_that_fell_behind_says_how_far() -> None:
    with bench(gentle, ticks=500, factor=500.0) as b:
        status = b.run_to_the_end()
        score = b.observer.scores[-1]
        missed, periods = score.periods_missed, score.periods_missed + status.ticks
        assert missed > 0
        assert score.warning.startswith(
            f"{100 * missed / periods:.3g} % of the periods were missed ({missed} of {periods}): "
            f"the run reached {score.simulated / score.wall:.3g} of real time in place of 500"
        )
        # Whether drives come in time at such a rate is chance.
        assert score.valid == (score.drives_lost <= status.ticks / 2) == (not score.reason)


def test_blocks_are_short_where_ticks_leave_no_time_for_long_ones() -> None:
    # Without that one would have 400 ticks, which are 4000 samples. On a busy machine none needs to be full.
    with bench(gentle, ticks=2000, factor=500.0) as b:
        b.run_to_the_end()
        assert 1 < max(len(trace.position) // 3 for trace in b.traces) <= 64
        assert block_ticks(b.simulator.run.instrument.parameters) == 64


def test_late_ticks_are_counted_and_periods_left_out_are_never_made_up() -> None:
    with bench(gentle, factor=0.05) as b:
        instrument, simulator = b.simulator.run.instrument, b.simulator
        b.graph.spin_until(lambda: instrument.ticks > 5)
        late, missed = b.counts.late_ticks, b.counts.periods_missed
        # The simulator gets no time for twenty of its periods of 20 ms.
        end = time.monotonic() + 0.4
        while time.monotonic() < end:
            b.graph.executor.spin_once(timeout_sec=0.01)
        before = instrument.ticks
        assert simulator.step()
        assert instrument.ticks == before + 1
        assert b.counts.late_ticks == late + 1
        assert b.counts.periods_missed >= missed + 18
        # Nothing is due now but the next tick on the old grid.
        assert sum(simulator.step() for _ in range(20)) < 10
        b.graph.spin_until(lambda: b.observer.status.periods_missed >= missed + 18)
        assert b.observer.status.late_ticks >= late + 1


def test_silent_controller_has_the_sample_retracted_and_its_next_drive_brings_it_back() -> None:
    silent = False
    contact: list[PiezoDrive] = []

    def moody(measurement: Measurement) -> list[PiezoDrive]:
        if not contact:
            contact.append(answer(measurement, 0.0, 0.0))
        return [] if silent else [answer(measurement, 0.0, 0.0, contact[0].voltage.z)]

    # Fifty times the samples: a block of the control trace is there every 100 ticks, not every 5000.
    with bench(moody, factor=1.0, watchdog=1.0, sample_period=2e-6) as b:
        b.graph.spin_until(lambda: b.observer.status.ticks > 5)
        b.run_until(InstrumentStatus.RUNNING)
        assert b.observer.status.in_contact
        silent = True
        status = b.run_until(InstrumentStatus.RETRACTED)
        assert status.detail == (
            "no valid drive from /afm/hand_made for 1 s (run.watchdog_timeout; 0 refused as NaN or infinite): "
            "the sample is retracted"
        )
        b.graph.spin_until(lambda: not b.observer.status.in_contact and b.last_z == pytest.approx(-12.0))
        # run.retract_distance is 240 nm, 12 V here, gone in run.retract_time = 10 ms: 10 ticks of a tenth of the way.
        z = b.drives[:, 2]
        way = np.diff(z[np.flatnonzero(z == z[0])[-1] :])
        way = way[way < 0.0]
        assert np.allclose(way, (-12.0 - z[0]) / 10.0, rtol=1e-6)
        assert len(way) in (10, 11)  # round-off may leave a rest
        # A change of a parameter is no drive.
        client = AsyncParameterClient(b.observer, b.simulator.get_fully_qualified_name())
        b.graph.spin_until(client.services_are_ready)
        change = Parameter("run.lockstep_timeout", value=7.0).to_parameter_msg()
        (result,) = b.graph.result(client.set_parameters([change])).results
        assert result.successful, result.reason
        ticks = b.simulator.run.instrument.ticks
        b.graph.spin_until(lambda: b.simulator.run.instrument.ticks > ticks + 2)
        assert b.simulator.run.state == RunState.RETRACTED
        silent = False
        b.run_until(InstrumentStatus.RUNNING)
        b.graph.spin_until(lambda: b.last_z == contact[0].voltage.z)


def test_run_with_the_sample_retracted_is_not_valid_and_has_no_error_of_the_tip() -> None:
    def leaving(measurement: Measurement) -> list[PiezoDrive]:
        return [answer(measurement, 0.0, 0.0)] if measurement.sequence < 5 else []

    with bench(leaving, ticks=100, watchdog=0.1, score_start=0.05) as b:
        b.run_to_the_end()
        score = b.observer.scores[-1]
        z = b.drives[:, 2]
        assert score.ticks_retracted == np.count_nonzero(z < z[0]) > 0
        retracted = np.count_nonzero(z[50:] < z[0])
        assert (score.ticks, score.retracted_fraction) == (50, retracted / 50)
        assert (score.valid, score.reason) == (
            False,
            f"the sample was retracted in {retracted} of 50 scored ticks ({100 * retracted / 50:.3g} %), "
            "because no drive came",
        )
        for errors in (score.rms, score.max, score.max_percent):
            assert [math.isnan(each) for each in (errors.x, errors.y, errors.z)] == [False, False, True]


def test_run_that_is_in_time_is_valid_and_has_an_error_of_the_tip() -> None:
    with bench(gentle, ticks=40) as b:
        b.run_to_the_end()
        score = b.observer.scores[-1]
        assert (score.valid, score.reason, score.retracted_fraction) == (True, "", 0.0)
        assert np.isfinite(summary_of(score).rms).all()


@pytest.mark.parametrize("bad", [(math.nan, 0.0, 0.0), (0.0, 0.0, math.inf)], ids=["nan", "inf"])
def test_drive_that_no_piezo_can_follow_is_refused_and_counted_and_the_last_one_held(
    bad: tuple[float, float, float],
) -> None:
    sent = []

    def broken(measurement: Measurement) -> list[PiezoDrive]:
        if measurement.sequence < 5 or measurement.sequence > 20:
            return [answer(measurement, 0.05, 0.0)]
        sent.append(measurement.sequence)
        return [answer(measurement, *bad)]

    with bench(broken, ticks=40) as b:
        status = b.run_to_the_end()
        assert status.drives_refused == len(sent) > 0
        assert np.isfinite(b.drives).all()
        x = b.drives[:, 0]
        assert set(x[np.argmax(x == 0.05) :]) == {0.05}
        assert status.in_contact


def test_controller_that_is_too_slow_is_a_warning_of_the_diagnostics() -> None:
    def slow(measurement: Measurement) -> list[PiezoDrive]:
        return gentle(measurement) if measurement.sequence % 10 == 0 else []

    with bench(slow) as b:
        reports: list[DiagnosticArray] = []
        b.observer.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
        b.graph.spin_until(lambda: reports and "held an older one" in reports[-1].status[0].message)
        assert reports[-1].status[0].level == DiagnosticStatus.WARN
        # On a busy machine periods may be missed as well.
        held = r"\d+ of the last \d+ ticks had no new drive and held an older one"
        assert re.fullmatch(rf"running; (\d+ of the last \d+ periods .*; )?{held}", reports[-1].status[0].message)


def test_motion_beyond_all_numbers_is_told_in_realtime_too() -> None:
    with bench(lambda measurement: [answer(measurement, 1.7e308, 1.7e308)]) as b:
        assert "diverged" in b.run_until(InstrumentStatus.FAULT).detail


def test_real_time_factor_changes_while_running() -> None:
    # At the first factor a tick takes ten minutes.
    with bench(gentle, factor=PERIOD / 600.0) as b:
        b.run_until(InstrumentStatus.RUNNING)
        client = AsyncParameterClient(b.observer, b.simulator.get_fully_qualified_name())
        b.graph.spin_until(client.services_are_ready)
        change = Parameter("run.real_time_factor", value=0.5).to_parameter_msg()
        (result,) = b.graph.result(client.set_parameters([change])).results
        assert result.successful, result.reason
        b.graph.spin_until(lambda: b.observer.status.ticks > 50)
        refused = Parameter("run.mode", value="lockstep").to_parameter_msg()
        (result,) = b.graph.result(client.set_parameters([refused])).results
        assert not result.successful
        assert "run.mode" in result.reason


def test_pause_stops_the_clock_and_is_no_lateness() -> None:
    with bench(gentle, factor=0.5) as b:
        b.graph.spin_until(lambda: b.observer.status.ticks > 5)
        assert b.observer.call(b.graph, topics.PAUSE).success
        paused = b.run_until(InstrumentStatus.PAUSED)
        missed = b.counts.periods_missed
        count = len(b.observer.statuses)
        b.graph.spin_until(lambda: len(b.observer.statuses) > count + 10)
        assert b.observer.status.ticks == paused.ticks
        assert b.observer.call(b.graph, topics.PLAY).success
        # Ten reports are 2 s: a thousand periods that a wrong deadline would count as missed.
        b.graph.spin_until(lambda: b.simulator.run.instrument.ticks > paused.ticks)
        assert b.counts.periods_missed < missed + 500


def test_reset_goes_back_to_the_start_in_realtime_too() -> None:
    with bench(gentle, factor=0.5) as b:
        b.graph.spin_until(lambda: b.observer.status.ticks > 20 and len(b.controller.seen) > 5)
        assert b.observer.call(b.graph, topics.RESET).success
        # The trace tells each tick; of measurements a busy machine may lose the first.
        b.graph.spin_until(lambda: [trace.first_sequence for trace in b.traces][1:-2].count(0) == 1)
        b.run_until(InstrumentStatus.RUNNING)
        ticks = [trace.first_sequence + i for trace in b.traces for i in range(len(trace.deflection))]
        start = ticks.index(0, 1)
        assert ticks[start:] == list(range(len(ticks) - start))
        b.graph.spin_until(lambda: any(y.sequence < x.sequence for x, y in itertools.pairwise(b.controller.seen)))
