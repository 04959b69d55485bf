"""Measure the friction-predicting law; prints the tables of docs/predictive.md, Measured.

python tools/measure_predictive.py            # print
python tools/measure_predictive.py --write    # and put them into docs/predictive.md
"""

import argparse
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from afm_model import Controller, ControllerParameters, SimParameters, Simulation, build, simulate
from afm_model.run import Latency, simulate_realtime

sys.path.insert(0, str(Path(__file__).parent))
from law_pages import show, table

PERIOD = 2.0 * math.pi / 50.0
"""Of the reference [s]."""
TAU = 0.91e9
"""Shear strength of the contact [Pa]."""
PACKET = {"law.packet": 20, "law.spare": 1}
RATES: tuple[tuple[str, float, int, dict[str, Any]], ...] = (
    ("50 us", 5e-5, 0, {}),
    ("50 us + 1", 5e-5, 1, {}),
    ("50 us + 6", 5e-5, 6, {}),
    ("200 us + 1", 2e-4, 1, {}),
    ("1 ms + 1", 1e-3, 1, {}),
    ("1 ms + 1, packets", 1e-3, 1, PACKET),
)
KNOWN = {"law.surface": "known"}
KNOWLEDGE: tuple[tuple[str, dict[str, Any], float], ...] = (
    ("surface and friction known", {**KNOWN, "law.friction": "nominal"}, 0.5),
    ("surface known, friction 20 % low", {**KNOWN, "contact.tau": 0.8 * TAU}, 0.5),
    ("surface known, friction 20 % high", {**KNOWN, "contact.tau": 1.2 * TAU}, 0.5),
    ("no knowledge", {"contact.tau": 0.8 * TAU}, 0.5),
    ("learned, third period", {"law.surface": "learned", "contact.tau": 0.8 * TAU}, 2.0),
    ("learned, sixth period", {"law.surface": "learned", "contact.tau": 0.8 * TAU}, 5.0),
)
"""What the law is told, and the period of the reference from which the run is scored, for half a period at least."""
NOISE = {
    "detector.noise": 1e-3,
    "detector.position_noise": 5e-11,
    "detector.adc_bits": 16,
    "piezo.limit": 10.0,
    "piezo.dac_bits": 16,
}


def parameters(
    period: float, delay: int, law: dict[str, Any], plant: dict[str, Any], first: float
) -> tuple[SimParameters, ControllerParameters]:
    """Of a run that is scored from period `first` of the reference to the end of a period."""
    sim = {
        "run.duration": (math.floor(first) + 1.0) * PERIOD,
        "score.start": first * PERIOD,
        "plant.control_period": period,
        "plant.delay_ticks": delay,
        "piezo.dac_period": period / law.get("law.packet", 1),
    }
    timing = {"law.kind": "predictive", "law.period": period, "law.delay_ticks": delay}
    return build(SimParameters, sim | plant), build(ControllerParameters, timing | law)


def smoothness(result: Simulation) -> float:
    """Variation of the drive over that of the drive that follows the reference without error, worse of x and y."""
    sim = result.parameters
    w0, x0 = sim.scales.w0, sim.scales.x0
    scored = result.time >= sim.score_start
    unit = {"reference_position": x0, "reference_velocity": x0 * w0, "reference_acceleration": x0 * w0**2}
    x, v, a = (result.measurements[name][:, :2] / size for name, size in unit.items())
    bound = result.truth["friction_bound"][:, None] / sim.units.lateral_force
    eta = 2.0 * math.pi * np.array([sim.scanner.f_x, sim.scanner.f_y]) / w0
    xi = np.array([sim.scanner.xi_x, sim.scanner.xi_y])
    ideal = a + 2.0 * xi * eta * v + eta**2 * x + bound * v / np.linalg.norm(v, axis=1, keepdims=True)
    volts = ideal * x0 / (eta**2 * np.array([sim.piezo.sensitivity_x, sim.piezo.sensitivity_y]))
    least = np.abs(np.diff(volts[scored], axis=0)).sum(axis=0)
    return float(max(np.abs(np.diff(result.drive[scored, :2], axis=0)).sum(axis=0) / least))


def figures(score: Any) -> str:
    """Largest and rms error of x and y, the worse one [%], rms error of z [nm]."""
    percent = 100.0 * max(score.rms[:2]) / 5e-9
    lost = "" if score.contact_fraction == 1.0 else " (contact lost)"
    return f"{max(score.max_percent[:2]):.2g}/{percent:.2g}/{1e9 * score.rms[2]:.2g}{lost}"


def cell(result: Simulation) -> str:
    """Those, and the variation of the drive where it is not that of the drive without error."""
    variation = smoothness(result)
    return figures(result.score) + (f", TV {variation:.1f}" if variation > 1.05 else "")


def knowledge(told: Iterable[str] = (), rates: Iterable[str] = ()) -> list[str]:
    """Every rate with every knowledge, or some of both, everything measured without noise."""
    kept = [rate for rate in RATES if not rates or rate[0] in rates]
    rows = []
    for title, known, first in KNOWLEDGE:
        if told and title not in told:
            continue
        cells = [
            ""
            if delay == 0 and "learned" in title
            else cell(simulate(*parameters(period, delay, law | known, {}, first)))
            for _, period, delay, law in kept
        ]
        rows.append([title, *cells])
    return table(["", *(rate[0] for rate in kept)], rows).splitlines()


def noise() -> list[str]:
    """Positions, deflection and lateral force alone, with noise and converters."""
    rates, rows = (RATES[1], RATES[3], RATES[5]), []

    def measured(rate: tuple[str, float, int, dict[str, Any]], known: dict[str, Any], first: float) -> str:
        _, period, delay, law = rate
        return cell(simulate(*parameters(period, delay, {"law.feedback": "measured"} | law | known, NOISE, first)))

    for told, known, _ in KNOWLEDGE[:4]:
        # Of packets the law must know the surface.
        asked = [rate for rate in rates if not (rate[3] and told == "no knowledge")]
        cells = [" → ".join(measured(rate, known, first) for first in (0.5, 2.0)) for rate in asked]
        rows.append([told, *cells, *[""] * (len(rates) - len(cells))])
    learned = " → ".join(measured(RATES[3], KNOWLEDGE[4][1], first) for first in (2.0, 3.0, 5.0))
    rows.append(["learned, from period 2 → 3 → 5", "", learned, ""])
    return table(["", *(rate[0] for rate in rates)], rows).splitlines()


def late() -> list[str]:
    """A fifth of the drives comes a period late."""
    rows = []
    for rate, period, _, law in RATES[1], RATES[3], RATES[5]:
        cells = []
        for spare in (0, 1):
            told = {**KNOWN, "contact.tau": 0.8 * TAU, **law, "law.spare": spare}
            sim, _ = parameters(period, 0, told, {}, 0.5)
            _, controller = parameters(period, 1, told, {}, 0.5)
            latency = Latency(kind="normal", median=0.8 * period, spread=0.297, seed=2)
            cells.append(figures(simulate_realtime(sim, Controller(controller), latency).score))
        rows.append([rate, *cells])
    return table(["", "no spare period", "one spare period"], rows).splitlines()


TABLES = {"knowledge": knowledge, "noise": noise, "late": late}


def main() -> int:
    """Print or write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="put the tables into docs/predictive.md")
    made = ((f"predictive {mark}", "\n".join(measured())) for mark, measured in TABLES.items())
    show(made, parser.parse_args().write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
