"""Claims about the virtual instrument: repeatable, aligned, and moved only by drives a piezo can follow."""

import numpy as np
import pytest

from afm_model import DivergenceError, DriveError, Instrument, InstrumentParameters, ParameterError

from .. import session
from ..tables import columns, numbers

NOISY = {
    "detector.noise": 2e-3,
    "detector.position_noise": 1e-11,
    "detector.adc_bits": 16,
    "plant.seed": 5,
    "plant.control_period": 4e-6,
}
DRAWN = {"plant.kind": "paper", "plant.z": "uniform"}


def run(values: dict[str, object], ticks: int, block_ticks: int = 200, scope: Instrument | None = None):
    """Instrument after a closed-loop run and what it recorded."""
    scope = scope or session.instrument(values, block_ticks)
    law = session.controller({})
    recorded = session.joined(session.run(scope, law, ticks * scope.parameters.plant.control_period))
    return scope, recorded


@pytest.mark.parametrize("values", [{}, NOISY, DRAWN])
def test_reset_repeats_the_run_to_the_last_bit(values):
    scope, first = run(values, 500)
    digest = scope.trajectory_sha256()
    scope.reset()
    assert (scope.ticks, scope.time) == (0, 0.0)
    _, second = run(values, 500, scope=scope)
    np.testing.assert_array_equal(numbers(first[0]), numbers(second[0]))
    for a, b in zip(first[1:], second[1:], strict=True):
        np.testing.assert_array_equal(a, b)
    assert scope.trajectory_sha256() == digest


def test_reset_starts_the_score_anew():
    scope, _ = run({"score.start": 0.0}, 300)
    once = scope.score()
    scope.reset()
    assert scope.score().ticks == 0
    run({}, 300, scope=scope)
    again = scope.score()
    assert again.ticks == once.ticks
    np.testing.assert_array_equal(again.rms, once.rms)
    assert again.stick_phases == once.stick_phases


def test_hash_covers_the_present_state():
    scope = session.instrument({}, 50)
    twin = session.instrument({}, 50)
    drive = scope.drive
    # Ticks that differ in their last drive alone: the states before it are the same.
    for push in (0.0, 2.0):
        scope.tick(np.add(drive, [push, 0.0, 0.0]))
        twin.tick(drive)
    assert scope.trajectory_sha256() != twin.trajectory_sha256()


def test_reset_repeats_the_run_from_the_middle_of_a_block():
    scope, first = run(NOISY, 130)
    for _ in range(37):
        scope.tick(np.array([0.1, -0.1, 0.0]))
    scope.reset()
    _, second = run(NOISY, 130, scope=scope)
    np.testing.assert_array_equal(numbers(first[0]), numbers(second[0]))


def test_two_instruments_of_the_same_parameters_give_the_same_hash_and_another_seed_another():
    assert run(NOISY, 100)[0].trajectory_sha256() == run(NOISY, 100)[0].trajectory_sha256()
    assert run(NOISY, 100)[0].trajectory_sha256() != run(NOISY | {"plant.seed": 6}, 100)[0].trajectory_sha256()


@pytest.mark.parametrize("values", [{}, NOISY, DRAWN | {"detector.noise": 1e-3}])
def test_trajectory_does_not_depend_on_the_block_size(values):
    hashes = {run(values, 600, block_ticks=n)[0].trajectory_sha256() for n in (1, 7, 256, 1000)}
    assert len(hashes) == 1


@pytest.mark.parametrize("values", [{}, NOISY, DRAWN | {"detector.noise": 1e-3}])
def test_trajectory_does_not_depend_on_when_blocks_are_taken(values, rng):
    scope, law = session.instrument(values, 100), session.controller({})
    for _ in range(600):
        if scope.block_full or rng.uniform() < 0.03:
            scope.take_block()
        scope.tick(law.answer(scope.measurement))
    assert scope.trajectory_sha256() == run(values, 600)[0].trajectory_sha256()


def test_hash_covers_the_ticks_that_were_not_taken_yet():
    one, other = session.instrument({}, 50), session.instrument({}, 50)
    drive = one.drive
    for k in range(40):
        one.tick(drive)
        other.tick(drive)
        if k == 20:
            other.take_block()
    assert one.trajectory_sha256() == other.trajectory_sha256()
    one.tick(drive)
    assert one.trajectory_sha256() != other.trajectory_sha256()


def test_samples_are_complete_and_those_at_ticks_are_the_voltages_of_the_measurements():
    values = NOISY | {"plant.control_period": 1e-5, "detector.sample_period": 2e-6}
    scope = session.instrument(values, 30)
    blocks = session.run(scope, session.controller({}), 100 * 1e-5)
    assert scope.samples_per_tick == 5
    assert [len(block.measurements) for block in blocks] == [30, 30, 30, 10]
    for block in blocks:
        assert block.first_sample == 5 * block.first_tick
        assert block.samples.shape == (len(scope.channels), 5 * len(block.measurements))
        rows = [session.column(scope, name) for name in ("deflection", "lateral_force")]
        at_ticks = block.samples[rows, ::5].T
        voltages = columns(block.measurements, "deflection_voltage", "lateral_voltage")
        np.testing.assert_array_equal(at_ticks, voltages)


def test_samples_between_ticks_do_not_depend_on_the_control_period():
    def samples(control_period: float) -> np.ndarray:
        scope = session.instrument({"plant.control_period": control_period}, 1000)
        for _ in range(round(2e-3 / control_period)):
            scope.tick(np.array([1.5, 2.0, 0.5]))
            if scope.block_full:
                raise AssertionError("the run is longer than its block")
        return scope.take_block().samples

    np.testing.assert_array_equal(samples(1e-5), samples(5e-6))


def test_measurement_k_is_that_of_the_state_and_of_the_reference_at_k_periods():
    scope, (measurements, _, _) = run({"plant.control_period": 5e-6}, 400)
    t = np.arange(400) * 5e-6
    for axis in range(2):
        # Round-off of the phase.
        assert measurements.reference_position[:, axis] == pytest.approx(5e-9 * np.sin(50.0 * t), abs=1e-22)
        assert measurements.reference_velocity[:, axis] == pytest.approx(250e-9 * np.cos(50.0 * t), rel=1e-12)
    assert (measurements.reference_position[:, 2] == 1e-13).all()
    s, y = scope.state, session.measured(scope)
    assert y.position == pytest.approx(columns(s, "X", "Y", "Z") * [session.X0, session.X0, session.Z0], rel=1e-15)
    assert y.deflection == pytest.approx(s.Q * session.Z0, rel=1e-14)
    assert scope.time == pytest.approx(400 * 5e-6, rel=1e-15)


def test_state_truth_and_drive_are_copies():
    scope, twin = session.instrument({}), session.instrument({})
    scope.state.Q = scope.truth.tip_height = np.nan
    scope.truth.position[:] = scope.drive[:] = np.nan
    for one in (scope, twin):
        one.tick(twin.drive)
    assert scope.state.tobytes() == twin.state.tobytes()
    assert scope.truth.tobytes() == twin.truth.tobytes()
    assert np.isfinite(scope.state.Q)


@pytest.mark.filterwarnings("ignore:.*scalar add")
@pytest.mark.parametrize(
    ("drive", "words"),
    [
        ([np.nan, 0.0, 0.0], "x = nan V is not allowed: every voltage must be a finite number"),
        ([0.0, np.inf, -np.inf], "y = inf V, z = -inf V"),
    ],
)
def test_drive_that_no_piezo_can_follow_is_refused_and_nothing_moves(drive, words):
    scope, twin = session.instrument({}, 20), session.instrument({}, 20)
    good = scope.drive
    for one in (scope, twin):
        one.tick(good)
    before = scope.state.tobytes(), scope.measurement.tobytes(), scope.ticks, scope.trajectory_sha256()
    with pytest.raises(DriveError, match=words):
        scope.tick(np.array(drive))
    assert before == (scope.state.tobytes(), scope.measurement.tobytes(), scope.ticks, scope.trajectory_sha256())
    for one in (scope, twin):
        one.tick(good + 0.01)
    assert scope.trajectory_sha256() == twin.trajectory_sha256()
    np.testing.assert_array_equal(scope.take_block().drives, twin.take_block().drives)


def test_motion_beyond_all_numbers_is_told():
    scope = session.instrument({})
    with pytest.raises(DivergenceError, match=r"diverged .* at .* s under a drive of"):
        scope.tick(np.array([1.7e308, 0.0, 0.0]))


def test_tick_into_a_full_block_is_refused():
    scope = session.instrument({}, 2)
    drive = scope.drive
    scope.tick(drive)
    scope.tick(drive)
    assert scope.block_full
    with pytest.raises(RuntimeError, match="take_block"):
        scope.tick(drive)


def test_drive_is_applied_after_range_and_resolution_and_reported_as_applied():
    scope = session.instrument({"piezo.limit": 2.0, "piezo.dac_bits": 8})
    lsb = 4.0 / 256
    scope.tick(np.array([5.0, -5.0, 0.3]))
    block = scope.take_block()
    # The converter's top level is one step short of its limit.
    assert block.drives[0] == pytest.approx([2.0 - lsb, -2.0, round(0.3 / lsb) * lsb], abs=1e-15)
    np.testing.assert_array_equal(session.measured(scope).drive, block.drives[0])
    np.testing.assert_array_equal(scope.drive, block.drives[0])


def test_adc_gives_whole_levels_and_without_it_the_signal_is_continuous():
    values = {"plant.control_period": 1e-5, "detector.adc_bits": 10}
    quantised = run(values, 300)[1][2][:2]
    lsb = 20.0 / 1024
    levels = quantised / lsb
    assert levels == pytest.approx(np.round(levels), abs=1e-9)
    assert len(np.unique(levels[1])) > 10
    continuous = run({"plant.control_period": 1e-5}, 300)[1][2][:2]
    assert np.abs(continuous[1] / lsb - np.round(continuous[1] / lsb)).max() > 0.4


def noise_of(values: dict[str, object]) -> tuple[np.ndarray, np.ndarray]:
    """Samples and measured positions of a scanner at rest, less those without noise."""
    scope, twin = session.instrument(values, 5000), session.instrument({"sample.beta": 0.0}, 5000)
    drive = twin.drive
    for one in (scope, twin):
        for _ in range(5000):
            one.tick(drive)
    block, plain = scope.take_block(), twin.take_block()
    return block.samples - plain.samples, block.measurements.position - plain.measurements.position


def test_noise_is_white_normal_and_of_the_given_size():
    values = {"sample.beta": 0.0, "detector.noise": 3e-3, "detector.position_noise": 2e-11, "plant.seed": 3}
    samples, positions = noise_of(values)
    volts = samples[:2]
    assert not samples[2:].any()  # true forces
    n = volts.shape[1]
    # Five standard errors of 1e4 samples: of the mean 1/sqrt(n), of the size 1/sqrt(2n), of a correlation 1/sqrt(n).
    for noise, size in [*((v, 3e-3) for v in volts), *((p, 2e-11) for p in positions.T)]:
        m = len(noise)
        assert abs(noise.mean()) < 5.0 * size / np.sqrt(m)
        assert noise.std() == pytest.approx(size, rel=5.0 / np.sqrt(2.0 * m))
        assert abs(np.corrcoef(noise[:-1], noise[1:])[0, 1]) < 5.0 / np.sqrt(m)
        # Kurtosis 3 of a normal law; its standard error is sqrt(24 / m).
        assert ((noise / size) ** 4).mean() == pytest.approx(3.0, abs=5.0 * np.sqrt(24.0 / m) + 0.2)
    assert abs(np.corrcoef(volts)[0, 1]) < 5.0 / np.sqrt(n)
    between_axes = np.corrcoef(positions.T)[np.triu_indices(3, 1)]
    assert (np.abs(between_axes) < 5.0 / np.sqrt(len(positions))).all()
    again, other = noise_of(values)[0], noise_of(values | {"plant.seed": 4})[0]
    np.testing.assert_array_equal(samples, again)
    assert not np.array_equal(samples, other)


@pytest.mark.parametrize("plant", [{}, DRAWN])
def test_noise_of_the_detector_does_not_move_an_open_loop_scanner(plant):
    def end(values: dict[str, object]) -> str:
        scope = session.instrument(plant | values)
        session.run(scope, session.controller({"law.kind": "open_loop"}), 2e-3)
        return scope.trajectory_sha256()

    assert end({"detector.noise": 1e-3, "detector.position_noise": 1e-11}) == end({})


@pytest.mark.parametrize(
    "plant", [{}, *({"plant.kind": "paper", "plant.z": z} for z in ("computed", "held", "uniform"))]
)
def test_drive_of_the_start_holds_the_tip_where_it_is(plant):
    scope = session.instrument({"sample.beta": 0.0, "plant.M_z": 0.0, "reference.z_r": 1e-9} | plant)
    drive = scope.drive
    for _ in range(500):
        scope.tick(drive)
        scope.skip_block()
    assert session.measured(scope).deflection == pytest.approx(1e-9, rel=1e-6)


def test_piezo_whose_range_does_not_reach_the_start_is_refused():
    with pytest.raises(ParameterError, match=r"piezo\.limit = 0\.01 V is not allowed: to hold .* takes 0\.03"):
        session.instrument({"piezo.limit": 0.01})


@pytest.mark.parametrize("drive", [1.0, np.zeros(1), np.zeros(2), np.zeros((1, 3))])
def test_drive_that_is_not_three_voltages_is_refused_and_nothing_moves(drive):
    scope = session.instrument({})
    before = scope.state
    with pytest.raises(DriveError, match="it must be three voltages"):
        scope.tick(drive)
    assert scope.ticks == 0
    assert np.array_equal(scope.state, before)


def test_default_parameters_start():
    scope = Instrument(InstrumentParameters())
    assert scope.samples_per_tick == 2
    assert not scope.block_full


def quasi_static_cycle() -> tuple[Instrument, list[np.ndarray]]:
    """The instrument and the normal force [N] while the z drive goes down and up again by 130 nm in 1 s each."""
    values = {"sample.beta": 0.0, "plant.control_period": 1e-4, "cantilever.W": 0.0, "contact.zeta_n": 0.0}
    scope = session.instrument(values, 2000)
    start = float(scope.drive[2])
    normal = session.column(scope, "truth/normal_force")
    down = start - 6.5 * np.linspace(0.0, 1.0, 10_000)
    forces = []
    for ramp in (down, down[::-1]):
        force = []
        for v in ramp:
            if scope.block_full:
                force.append(scope.take_block().samples[normal])
            scope.tick(np.array([0.0, 0.0, v]))
        force.append(scope.take_block().samples[normal])
        forces.append(np.concatenate(force))
    return scope, forces


def test_retract_reads_the_pull_off_force_and_approach_snaps_in_at_8_9_of_it():
    scope, (retract, approach) = quasi_static_cycle()
    p = scope.parameters
    pull_off = p.contact.pull_off_force
    # A ramp of 1 s is slow for a contact at 37 kHz on a cantilever at 2.4 kHz.
    assert -retract.min() / pull_off == pytest.approx(1.0, abs=1e-3)
    assert retract[-1] == approach[0] == 0.0
    made, lost = np.flatnonzero(approach)[0], np.flatnonzero(retract)[-1]
    # One step of the approach overshoots the meeting of the surfaces by 1e-4 of the indentation scale.
    assert -approach[made] / pull_off == pytest.approx(8.0 / 9.0, abs=1e-3)
    # Let go: both springs stretched by the pull-off force, indentation from 1/3 at zero load to -0.132 at u^3 = 1/2.
    k_c = p.cantilever.m_c * (2.0 * np.pi * p.cantilever.f_c) ** 2
    k_z = p.scanner.mass_ratio * p.cantilever.m_c * (2.0 * np.pi * p.scanner.f_z) ** 2
    scale = (12.0 * np.pi * p.contact.R**2 * p.contact.gamma / p.contact.K) ** (2.0 / 3.0) / p.contact.R
    expected = pull_off / k_c + pull_off / k_z + scale * (1.0 / 3.0 + 0.132)
    # The cantilever overshoots its instability by about a period, 0.4 ms of a ramp of 130 nm/s.
    assert 130e-9 * lost / len(retract) == pytest.approx(expected, abs=0.2e-9)
    # Made again where the undeformed surfaces meet.
    assert 130e-9 * (1.0 - made / len(approach)) == pytest.approx(scale / 3.0, abs=0.02e-9)
    assert scope.in_contact
