"""One control tick in one compiled call: drive in, all substeps, detector samples, score, next measurement.

`close_loop` is many of them in one call, with a law of `afm_model.control` in place of the controller.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import signals
from ..control.laws import control
from ..jit import kernel
from ..plant import PLANT_RECORD, state, step_compliant, step_paper
from ..reference import waveform
from . import tally
from .constants import COMPLIANT, RECORD

_Array = NDArray[np.float64]
MOVED, REFUSED, DIVERGED = 0, 1, 2
"""What became of a tick."""
RANGE = 1e-3
"""Position beyond which the motion has diverged: hundreds of times the range of any scanner [m]."""

STATE = 0
MEASUREMENT = STATE + state.SIZE
COMMANDED = MEASUREMENT + signals.MEASUREMENT_SIZE
APPLIED = COMMANDED + 3
TALLY = APPLIED + 3
PENDING = TALLY + tally.SIZE
ROW = COMMANDED + 3
RANDOM = 4
PLANT_SIZE = len(PLANT_RECORD.names or ())


@kernel
def convert(volts: float, lsb: float, limit: float) -> float:
    """A converter of resolution `lsb` and range +-`limit` [V]; 0 switches either off."""
    # Range first: what is far beyond it has no whole number of steps.
    if limit > 0.0:
        volts = min(max(volts, -limit), limit - lsb)
    if lsb > 0.0:
        volts = lsb * math.floor(volts / lsb + 0.5)
    return volts


@kernel
def detect(s: _Array, q: Any, noise: _Array) -> tuple[float, float]:
    """Photodetector voltages of deflection and lateral force, after noise and ADC."""
    deflection = (s[state.Q] * q.z0 - q.a) / q.deflection_sensitivity + q.noise * noise[0]
    lateral = s[state.F_X] * q.lateral_force / q.lateral_sensitivity + q.noise * noise[1]
    return convert(deflection, q.adc_lsb, q.adc_limit), convert(lateral, q.adc_lsb, q.adc_limit)


@kernel
def measure(
    s: _Array, instrument: _Array, k: int, drive: _Array, noise: _Array, position_noise: _Array, y: _Array
) -> None:
    """Write the measurement of control tick k into `y`, in the order of `afm_model.signals`."""
    q = instrument.view(RECORD)[0]
    y[signals.DEFLECTION_VOLTAGE], y[signals.LATERAL_VOLTAGE] = detect(s, q, noise)
    y[signals.DEFLECTION] = y[signals.DEFLECTION_VOLTAGE] * q.deflection_sensitivity
    y[signals.DEFLECTION_RATE] = s[state.V_Q] * q.vertical_speed
    y[signals.LATERAL_FORCE] = y[signals.LATERAL_VOLTAGE] * q.lateral_sensitivity
    y[signals.POSITION] = s[state.X] * q.x0 + q.position_noise * position_noise[0]
    y[signals.POSITION + 1] = s[state.Y] * q.x0 + q.position_noise * position_noise[1]
    y[signals.POSITION + 2] = s[state.Z] * q.z0 + q.position_noise * position_noise[2]
    y[signals.VELOCITY] = s[state.V_X] * q.lateral_speed
    y[signals.VELOCITY + 1] = s[state.V_Y] * q.lateral_speed
    y[signals.VELOCITY + 2] = s[state.V_Z] * q.vertical_speed
    t = k * q.control_period
    for axis in range(2):
        if axis == 0:
            r, v, a = waveform(q.shape_x, q.amplitude_x, q.omega_x, t)
        else:
            r, v, a = waveform(q.shape_y, q.amplitude_y, q.omega_y, t)
        y[signals.REFERENCE_POSITION + axis] = r
        y[signals.REFERENCE_VELOCITY + axis] = v
        y[signals.REFERENCE_ACCELERATION + axis] = a
    y[signals.REFERENCE_POSITION + 2] = q.z_r
    y[signals.REFERENCE_VELOCITY + 2] = 0.0
    y[signals.REFERENCE_ACCELERATION + 2] = 0.0
    for axis in range(3):
        y[signals.DRIVE + axis] = drive[axis]


@kernel
def tick(
    k: int, row: int, draw: int, constants: _Array, registers: _Array, random: _Array, rows: _Array, samples: _Array
) -> int:
    """Apply a drive from control tick k to k + 1 and measure there.

    Returns MOVED; REFUSED if the drive is not finite, with nothing changed; DIVERGED if the motion is not, any more.
    Few arrays with much in each: handing one over costs more than a step of the plant.

    Parameters
    ----------
    k, row, draw : int
        Control tick since the start; its row in the block; its row in the random numbers.
    constants : ndarray
        `plant_constants`, then `instrument_constants`.
    registers : ndarray (PENDING + 3 delay,)
        From STATE on: the state, advanced in place. From MEASUREMENT on: in, measurement k; out, measurement k + 1.
        From COMMANDED on: in, the drive asked for; out, the one that is due at this tick [V]. From APPLIED on: in,
        drive of the last tick; out, drive of this tick, after range and resolution [V]. From TALLY on: the score,
        updated from the first scored tick on. From PENDING on: a ring of the drives on their way to the piezo.
    random : ndarray (draws, RANDOM + 2 samples per tick)
        Of each tick: f_z [w0^2 z0], noise of x, y, z, then of the two detector channels at each sample (unit variance).
    rows : ndarray (rows, ROW)
        The block: state and measurement at tick k, drive applied from it on.
    samples : ndarray (CHANNELS, rows * samples per tick)
        The block's detector samples.
    """
    commanded = registers[COMMANDED : COMMANDED + 3]
    if not (math.isfinite(commanded[0]) and math.isfinite(commanded[1]) and math.isfinite(commanded[2])):
        return REFUSED
    s = registers[STATE:MEASUREMENT]
    y = registers[MEASUREMENT:COMMANDED]
    applied = registers[APPLIED : APPLIED + 3]
    t = registers[TALLY:PENDING]
    f_z = random[draw, 0]
    noise = random[draw, RANDOM:].reshape(-1, 2)
    instrument = constants[PLANT_SIZE:]
    p = constants[:PLANT_SIZE].view(PLANT_RECORD)[0]
    q = instrument.view(RECORD)[0]
    substeps = int(q.substeps)
    stride = int(q.stride)
    per_tick = substeps // stride
    j = row * per_tick
    n = 0
    scored = k >= q.score_tick
    # The drive of `delay` ticks ago is due now; this one takes its place on the way.
    delay = (registers.size - PENDING) // 3
    if delay > 0:
        slot = PENDING + 3 * (k % delay)
        for axis in range(3):
            commanded[axis], registers[slot + axis] = registers[slot + axis], commanded[axis]
    u0, u1, u2 = applied[0], applied[1], applied[2]
    applied[0] = convert(commanded[0], q.drive_lsb, q.drive_limit)
    applied[1] = convert(commanded[1], q.drive_lsb, q.drive_limit)
    applied[2] = convert(commanded[2], q.drive_lsb, q.drive_limit)
    if scored:
        tally.tally_tick(t, s, y, q, applied[0] - u0, applied[1] - u1, applied[2] - u2)

    # Tick k in the block; its first detector sample is the one in measurement k.
    rows[row, STATE:COMMANDED] = registers[STATE:COMMANDED]
    rows[row, COMMANDED:ROW] = applied
    samples[signals.CHANNEL_DEFLECTION, j] = y[signals.DEFLECTION_VOLTAGE]
    samples[signals.CHANNEL_LATERAL, j] = y[signals.LATERAL_VOLTAGE]
    samples[signals.CHANNEL_LATERAL_Y, j] = s[state.F_Y] * q.lateral_force
    samples[signals.CHANNEL_NORMAL, j] = s[state.N] * q.normal_force

    u_x = q.gain_x * applied[0]
    u_y = q.gain_y * applied[1]
    u_z = q.gain_z * applied[2]
    for i in range(substeps):
        if i > 0 and i % stride == 0:
            volts = detect(s, q, noise[n])
            j += 1
            n += 1
            samples[signals.CHANNEL_DEFLECTION, j] = volts[0]
            samples[signals.CHANNEL_LATERAL, j] = volts[1]
            samples[signals.CHANNEL_LATERAL_Y, j] = s[state.F_Y] * q.lateral_force
            samples[signals.CHANNEL_NORMAL, j] = s[state.N] * q.normal_force
        if q.plant == COMPLIANT:
            step_compliant(s, p, u_x, u_y, u_z)
        else:
            step_paper(s, p, u_x, u_y, u_z, q.treatment, f_z)
        if scored:
            tally.tally_step(t, s)
    measure(s, instrument, k + 1, applied, noise[n], random[draw, 1:RANDOM], y)
    # NaN is within no range either.
    for axis in range(3):
        if not abs(y[signals.POSITION + axis]) < RANGE:
            return DIVERGED
    return MOVED


@kernel
def close_loop(
    law: _Array,
    ticks: int,
    k: int,
    row: int,
    draw: int,
    constants: _Array,
    registers: _Array,
    random: _Array,
    rows: _Array,
    samples: _Array,
) -> tuple[int, int]:
    """Close the loop for `ticks` control ticks: at each, the law's answer to the measurement is the drive.

    Parameters
    ----------
    law : ndarray
        From `afm_model.control.laws.law_constants`.
    ticks : int
        No more than there are rows left in the block. Random numbers are taken round and round.
    k, row, draw, constants, registers, random, rows, samples
        Of the first tick, as in `tick`.

    Returns
    -------
    outcome, ticks done : int
        Of the last tick tried; how many moved, one that diverged included.
    """
    y = registers[MEASUREMENT:COMMANDED]
    u = registers[COMMANDED:APPLIED]
    for i in range(ticks):
        control(law, y, u)
        outcome = tick(k + i, row + i, (draw + i) % len(random), constants, registers, random, rows, samples)
        if outcome == REFUSED:
            return outcome, i
        if outcome == DIVERGED:
            return outcome, i + 1
    return MOVED, ticks
