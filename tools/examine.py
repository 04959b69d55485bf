"""The examiner: how often the truth lies within one and two of the uncertainties that are given.

Every draw hides a truth, makes a record of it in closed form with white or coloured noise, hands the record to a
function of `afm_model.analysis`, and compares; the case `verbs` hides numbers of a simulated microscope from its
verbs. Within 1 u the truth has to be in 68 % of the draws, within 2 u in 95 %.

    python tools/examine.py                       # every case, some minutes
    python tools/examine.py friction_loop --draws 100
    python tools/examine.py --write               # the table of docs/numerics.md
"""

import argparse
import math
import sys
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from examine_verbs import calibrations
from figures import page
from numpy.typing import NDArray
from scipy.signal import lfilter

from afm_model.analysis import (
    Estimate,
    contact_fit,
    contrast,
    deflection_sensitivity,
    force_curve,
    friction_loop,
    line_loop,
    means,
    spring_constant,
    step_height,
    wedge_by_flat,
    wedge_ogletree,
    wedge_varenberg,
    young,
)
from afm_model.analysis.identification import fit_resonator, response
from afm_model.analysis.thermal import BOLTZMANN, RECTANGULAR
from afm_model.contact.maugis import branch
from afm_model.core.errors import ParameterError

PAGE = Path(__file__).resolve().parent.parent / "docs" / "numerics.md"
_Array = NDArray[np.float64]
_Random = np.random.Generator
_BURN_IN = 3000


def white(rng: _Random, n: int) -> _Array:
    """Independent samples."""
    return rng.standard_normal(n)


def low_passed(rng: _Random, n: int) -> _Array:
    """White noise through a low pass whose time is 1 to 10 samples: up to 20 samples count as one."""
    memory = math.exp(-1.0 / rng.uniform(1.0, 10.0))
    return np.asarray(lfilter([math.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(n + 200))[200:])


def thermal(rng: _Random, n: int) -> _Array:
    """A resonator driven by white noise, as a cantilever by heat: 5 to 50 samples to a period, Q of 2 to 30."""
    w, Q = 2.0 * math.pi / rng.uniform(5.0, 50.0), rng.uniform(2.0, 30.0)
    radius = math.exp(-0.5 * w / Q)
    made = lfilter([1.0], [1.0, -2.0 * radius * math.cos(w), radius**2], rng.standard_normal(n + _BURN_IN))[_BURN_IN:]
    return np.asarray(made / _rms_of_resonator(radius, w))


def _rms_of_resonator(radius: float, w: float) -> float:
    a, b = 2.0 * radius * math.cos(w), -(radius**2)
    return math.sqrt((1.0 - b) / ((1.0 + b) * ((1.0 - b) ** 2 - a * a)))


def flicker(rng: _Random, n: int) -> _Array:
    """White noise and 1/f noise, equal at 2 to 20 periods in the record; it goes on before and behind it."""
    f = np.fft.rfftfreq(2 * n)
    density = 1.0 + rng.uniform(2.0, 20.0) / n / np.maximum(f, f[1])
    pair = rng.standard_normal((2, f.size))
    return np.fft.irfft((pair[0] + 1j * pair[1]) * np.sqrt(density * n), 2 * n)[:n]


NOISES: dict[str, Callable[[_Random, int], _Array]] = {
    "white": white,
    "low-passed": low_passed,
    "thermal": thermal,
    "1/f": flicker,
}
Answer = tuple[str, float, Estimate]
"""Name of a quantity, its truth, what was found."""


class Draw(NamedTuple):
    """Where a case takes its chances from."""

    rng: _Random
    colour: str  # of NOISES

    def noise(self, n: int) -> _Array:
        """Samples of unit rms, in the order of measurement."""
        return NOISES[self.colour](self.rng, n)

    def known(self, truth: float, relative: float) -> Estimate:
        """What somebody else has measured of a truth."""
        return Estimate(truth * (1.0 + relative * self.rng.standard_normal()), relative * truth)


def _loop(draw: Draw) -> tuple[_Array, _Array, float, float, float]:
    """Position and signal of a tip that sticks and slides; half-width, offset, stick slope."""
    rng = draw.rng
    half, offset, travel = 10.0 ** rng.uniform(-9.0, -8.0), rng.normal() * 1e-9, 10.0 ** rng.uniform(-8.5, -7.0)
    slope = 2.0 * half / (travel * rng.uniform(0.05, 0.25))
    lines = int(rng.integers(2, 7))
    phase = np.linspace(0.0, 2.0 * math.pi * (lines + 0.25), int(rng.integers(400, 1500)) * lines)
    x = travel / math.pi * np.arcsin(np.sin(phase))
    forth = np.where(np.cos(phase) > 0.0, 1.0, -1.0)
    play = forth * np.minimum(slope * (0.5 * travel + forth * x) - half, half)
    play[phase < 0.5 * math.pi] = half  # it slides from the begin on
    return x, play + offset + rng.uniform(0.02, 0.1) * half * draw.noise(x.size), half, offset, slope


def _friction_loop(draw: Draw) -> Iterator[Answer]:
    x, signal, half, offset, slope = _loop(draw)
    found = friction_loop(x, signal)
    yield "half-width", half, found.half_width
    yield "offset", offset, found.offset
    yield "stick slope", slope, found.stick_slope


def _means(draw: Draw) -> Iterator[Answer]:
    x, signal, half, offset, _ = _loop(draw)
    trace, retrace = means(x, signal, -0.2 * x.max(), 0.4 * x.max())
    yield "trace", offset + half, trace
    yield "retrace", offset - half, retrace


def _line_loop(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    x = (np.arange(int(rng.integers(256, 1024))) + 0.5) * 1e-9
    stick = rng.uniform(10.0, 40.0) * 1e-9
    forth = np.clip(2.0 * x / stick - 1.0, -1.0, 1.0)
    noise = rng.uniform(0.02, 0.1) * draw.noise(2 * x.size)
    found = line_loop(x, 0.3 + forth + noise[: x.size], 0.3 - forth[::-1] + noise[: x.size - 1 : -1])
    yield "half-width", 1.0, found.half_width
    yield "offset", 0.3, found.offset
    yield "stick slope", 2.0 / stick, found.stick_slope


class _Contact(NamedTuple):
    z: _Array
    deflection: _Array
    k: float
    radius: float
    modulus: float
    work: float
    pull: float
    baseline: float


def _baseline(draw: Draw, z: _Array) -> _Array:
    """What a free cantilever shows [m]: slope, and light that interferes."""
    rng = draw.rng
    period, amplitude = rng.uniform(100e-9, 700e-9), 10.0 ** rng.uniform(-11.0, -9.0)
    wave = amplitude * np.sin(2.0 * math.pi * (z / period + rng.random()))
    return np.asarray(0.3e-9 + 0.01 * rng.standard_normal() * z + wave)


def _contact(draw: Draw, noise: float) -> _Contact:
    """A force curve of an adhesive sphere: free, snap-in, contact, pull-off, free; noise as part of the pull."""
    rng = draw.rng
    k, radius, modulus, work = rng.uniform(2.0, 8.0), rng.uniform(8e-9, 20e-9), 10.0 ** rng.uniform(9.0, 10.0), 0.08
    K, force = 4.0 / 3.0 * modulus, math.pi * work * radius
    length = (math.pi**2 * work**2 * radius / K**2) ** (1.0 / 3.0)
    stress = 16.0 / (9.0 * math.sqrt(3.0)) * work / 0.165e-9
    exact = branch("maugis", 2.0 * stress * (radius / (math.pi * work * K**2)) ** (1.0 / 3.0))
    top = rng.uniform(10e-9, 30e-9)
    indentation = exact.least_indentation + np.linspace(0.0, (1.5 * top / force + 3.0) ** (1.0 / 3.0), 2001) ** 2
    bent = force / k * exact.solve(indentation)[1]
    way = length * indentation + bent
    off = int(np.argmin(way))
    pull = -float(bent.min())
    way, bent = way[off:], bent[off:]
    z_in = np.linspace(2.0 * way[0] - 40e-9, float(np.interp(top / k, bent, way)), int(rng.integers(1500, 3000)))
    d_in = np.where(z_in > max(way[0], 0.2e-9), np.interp(z_in, way, bent), 0.0)
    d_out = np.where(z_in >= way[0], np.interp(z_in, way, bent), 0.0)[::-1]
    z, d = np.concatenate([z_in, z_in[::-1]]), np.concatenate([d_in, d_out])
    base = _baseline(draw, np.append(z, np.interp(0.0, bent, way)))
    d = d + base[:-1] + noise * pull * draw.noise(z.size)
    return _Contact(z, d, k, radius, modulus, work, k * pull, float(base[-1]))


def _force_curve(draw: Draw) -> Iterator[Answer]:
    made = _contact(draw, draw.rng.uniform(0.005, 0.05))
    found = force_curve(made.z, made.deflection, made.k)
    yield "baseline", made.baseline, found.baseline
    yield "adhesion", made.pull, found.adhesion


def _contact_fit(draw: Draw) -> Iterator[Answer]:
    made = _contact(draw, draw.rng.uniform(0.005, 0.05))
    k, radius, gain = draw.known(made.k, 0.03), draw.known(made.radius, 0.05), 1.0 + 0.005 * draw.rng.standard_normal()
    found = contact_fit(made.z, made.deflection * gain, k, radius, sensitivity_error=0.005)
    yield "modulus", made.modulus, found.modulus
    yield "work of adhesion", made.work, found.work_of_adhesion
    yield "pull-off", made.pull, found.pull_off


def _sensitivity(draw: Draw, friction: float) -> Estimate:
    rng = draw.rng
    z_in = np.linspace(-200e-9, rng.uniform(60e-9, 200e-9), int(rng.integers(1500, 4000)))
    rise = np.maximum(z_in, 0.0) / 40e-9
    v = np.concatenate([rise * (1.0 + friction), rise[::-1] * (1.0 - friction)])
    z = np.concatenate([z_in, z_in[::-1]])
    v += 1.0 + _baseline(draw, z) / 40e-9 + rng.uniform(0.002, 0.02) * draw.noise(v.size)
    return deflection_sensitivity(z, v)


def _deflection_sensitivity(draw: Draw) -> Iterator[Answer]:
    yield "without friction", 40e-9, _sensitivity(draw, 0.0)
    yield "friction", 40e-9, _sensitivity(draw, draw.rng.uniform(-0.05, 0.05))


def _spring_constant(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    k, f0, Q, rate = 10.0 ** rng.uniform(-1.5, 1.5), rng.uniform(12e3, 60e3), rng.uniform(5.0, 50.0), 250e3
    n = int(max(rng.uniform(0.1, 0.3), 160.0 * Q / f0) * rate)
    f = np.fft.rfftfreq(n, 1.0 / rate)
    variance = RECTANGULAR * BOLTZMANN * 295.0 / k
    density = 2.0 * variance / (math.pi * f0 * Q) / ((1.0 - (f / f0) ** 2) ** 2 + (f / (f0 * Q)) ** 2)
    density += 10.0 ** rng.uniform(-3.0, -1.0) * density.max()
    pair = rng.standard_normal((2, f.size))
    volts = np.fft.irfft((pair[0] + 1j * pair[1]) * np.sqrt(density * rate * n) / 2.0, n) / 60e-9
    found = spring_constant(volts, rate, draw.known(60e-9, rng.uniform(0.0, 0.02)), 295.0)
    yield "k", k, found.k
    yield "f0", f0, found.f0
    yield "Q", Q, found.Q


def _contrast(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    ratio, lines, pixels = rng.uniform(0.3, 0.8), int(rng.integers(12, 80)), 128
    second = np.tile(np.arange(pixels) // 32 % 2 == 1, (lines, 1))
    image = np.where(second, ratio, 1.0) + 0.1 * np.stack([draw.noise(pixels) for _ in range(lines)])
    image += 0.02 * draw.noise(lines)[:, None]  # of the lines, slow
    found = contrast(image, ~second, second)
    yield "mean", 1.0, found.first
    yield "ratio", ratio, found.ratio


def _step_height(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    x = (np.arange(256) + 0.5) * 4e-9
    ridge = 20e-9 * (np.abs((x + 100e-9) % 300e-9 - 150e-9) < 75e-9) + rng.normal() * 0.01 * x
    lines = int(rng.integers(8, 60))
    image = ridge + rng.uniform(0.2e-9, 1e-9) * np.stack([draw.noise(x.size) for _ in range(lines)])
    yield "image", 20e-9, step_height(x, image)
    yield "one line", 20e-9, step_height(x, image[0])


def _slope(draw: Draw, loads: _Array) -> tuple[_Array, _Array, float, float, float, float]:
    """Signals up and down a slope [V] with friction m (N + A); sensitivity, angle, m, A."""
    rng = draw.rng
    S, angle, m, A = 10.0 ** rng.uniform(-8.0, -7.0), rng.uniform(0.4, 0.95), rng.uniform(0.1, 0.4), 6e-9
    s, c = math.sin(angle), math.cos(angle)
    T = [(loads * (s + way * m * c) + way * m * A) / (c - way * m * s) for way in (1.0, -1.0)]
    return T[0] / S, T[1] / S, S, angle, m, A


def _wedges(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    loads = np.linspace(5e-9, 40e-9, int(rng.integers(5, 12)))
    up, down, S, angle, m, A = _slope(draw, loads)
    noise = rng.uniform(0.002, 0.01) * float(up.mean())
    of_up, of_down = noise * rng.standard_normal((2, loads.size))
    found = wedge_ogletree(loads, up + of_up, loads, down + of_down, angle)
    yield "ogletree, N/V", S, found.sensitivity
    yield "ogletree, dF/dN", m, found.friction
    i = loads.size // 2
    half, offset = 0.5 * float(up[i] - down[i]), 0.5 * float(up[i] + down[i])
    one = wedge_varenberg(
        draw.known(float(loads[i]), 0.02), draw.known(half, 0.01), draw.known(offset, 0.01), 0.0, angle,
        draw.known(A, 0.03),
    )  # fmt: skip
    yield "varenberg, N/V", S, one.sensitivity
    yield "varenberg, dF/dN", m, one.friction


def _wedge_by_flat(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    loads, flat = np.linspace(5e-9, 40e-9, int(rng.integers(3, 7))), np.linspace(1e-9, 200e-9, 12)
    up, down, S, angle, m, A = _slope(draw, loads)
    noise = rng.uniform(0.002, 0.01) * float(up.mean())
    of_up, of_down = noise * rng.standard_normal((2, loads.size))
    widths = m * (flat + A) / S + noise * rng.standard_normal(flat.size)
    by_flat = wedge_by_flat(flat, np.maximum(widths, 0.0), loads, up + of_up, loads, down + of_down, angle)
    yield "N/V", S, by_flat.sensitivity
    yield "dF/dN", m, by_flat.friction


def _young(draw: Draw) -> Iterator[Answer]:
    E, tip = 10.0 ** draw.rng.uniform(9.0, 10.5), (169e9, 0.27)
    reduced = 1.0 / ((1.0 - 0.33**2) / E + (1.0 - tip[1] ** 2) / tip[0])
    yield "E", E, young(draw.known(reduced, 0.02), 0.33, tip)


def _fit_resonator(draw: Draw) -> Iterator[Answer]:
    rng = draw.rng
    f, xi, S, period = rng.uniform(200.0, 1000.0), rng.uniform(0.01, 0.1), rng.uniform(0.5e-6, 2e-6), 1e-4
    n = int(rng.integers(600, 2000))
    drive = np.repeat(rng.standard_normal(n // 20 + 1), 20)[:n]
    drive[:20] = 0.0
    motion = response(drive, period, f, xi, S)
    found = fit_resonator(drive, motion + 0.02 * float(motion.std()) * draw.noise(n), period)
    yield "f", f, found.f
    yield "damping", xi, found.xi
    yield "sensitivity", S, found.sensitivity


Case = Callable[[Draw], Iterator[Answer]]
CASES: dict[str, Case] = {
    "means": _means,
    "friction_loop": _friction_loop,
    "line_loop": _line_loop,
    "force_curve": _force_curve,
    "deflection_sensitivity": _deflection_sensitivity,
    "contact_fit": _contact_fit,
    "young": _young,
    "spring_constant": _spring_constant,
    "contrast": _contrast,
    "step_height": _step_height,
    "wedge": _wedges,
    "wedge_by_flat": _wedge_by_flat,
    "fit_resonator": _fit_resonator,
    "verbs": lambda draw: calibrations(draw.rng),
}


SLOW = "contact_fit", "wedge_by_flat", "verbs"
"""Cases of which the table takes an eighth of the draws."""


class Row(NamedTuple):
    """A quantity: how far each answer is from the truth, in units of its uncertainty."""

    name: str
    off: _Array  # (draws,)
    colours: list[str]

    def within(self, units: float, colour: str = "") -> float:
        """Part of the draws whose truth is so near, of all or of one colour of noise."""
        chosen = np.array([not colour or each == colour for each in self.colours])
        return float(np.mean(np.abs(self.off[chosen]) <= units)) if chosen.any() else math.nan


def examine(name: str, draws: int, colours_of_noise: Sequence[str] = tuple(NOISES)) -> list[Row]:
    """Rows of a case, as many draws with each colour of noise; the same ones every time."""
    off: dict[str, list[float]] = {}
    colours: dict[str, list[str]] = {}
    for number in range(draws):
        colour = colours_of_noise[number % len(colours_of_noise)]
        draw = Draw(np.random.default_rng([zlib.crc32(name.encode()), number]), colour)
        try:
            answers = list(CASES[name](draw))
        except (ValueError, ParameterError):  # a refusal is no wrong answer
            continue
        for quantity, truth, found in answers:
            if math.isfinite(found.uncertainty):
                off.setdefault(quantity, []).append((found.value - truth) / found.uncertainty)
                colours.setdefault(quantity, []).append(colour)
    return [Row(f"{name}: {quantity}", np.array(each), colours[quantity]) for quantity, each in off.items()]


def table(names: list[str], draws: int) -> list[str]:
    """The table of the page: of each case the least of its quantities, all of which are printed."""
    rows = ["| | within 1 u [%] | within 2 u [%] | with 1/f noise |", "| --- | --- | --- | --- |"]
    for name in names:
        shares = []
        for row in examine(name, draws // 8 if name in SLOW else draws):
            shares.append([row.within(1.0), row.within(2.0), row.within(2.0, "1/f")])
            print(_line(row.name, shares[-1]), flush=True)
        rows.append(_line(f"`{name}`", np.min(shares, axis=0)))
    return rows


def _line(name: str, shares: Sequence[float] | _Array) -> str:
    return f"| {name} | {' | '.join(f'{100.0 * share:.0f}' for share in shares)} |"


def main() -> int:
    """Examine and print, or write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(CASES)}; all if none is given")
    parser.add_argument("--draws", type=int, default=400, help="of each case; of slow ones an eighth")
    parser.add_argument("--write", action="store_true", help=f"the table into {PAGE.name}")
    arguments = parser.parse_args()
    rows = table(arguments.cases or list(CASES), arguments.draws)
    if arguments.write:
        page.insert(PAGE, "coverage", rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
