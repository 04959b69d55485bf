"""Claims about what a client measures: with the vendor's wrapper alone it has the numbers of the verbs."""

import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from afm_model.microscope import Microscope
from afm_model.program.force_curve import APPROACH, RETRACT
from afm_nanonis.signal_index import HORIZONTAL, VERTICAL, Z

from .conftest import Served
from .programs import programs, run

EXAMPLE = Path(__file__).parents[2] / "examples" / "nanonis_two_materials.py"
NOISE = {"detector": {"noise": 2e-3}}
_NUMBER = r"(\w+) ([-+.\de]+) \+- ([-+.\de]+)"
SOME = 5.0
"""Standard errors of eight numbers within which two measurements agree: by Student, all but one in a thousand."""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    made = Served(tmp_path_factory.mktemp("session"), **NOISE)
    yield made
    made.close()


@pytest.fixture(scope="module")
def nanonis_spm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return programs(tmp_path_factory.mktemp("nanonis_spm"), "nanonis_spm==1.0.9")


def by_verbs() -> dict[str, dict[str, tuple[float, float]]]:
    """The numbers of both materials, with their standard errors, as the verbs have them."""
    found = {}
    with Microscope("two_materials", plant={"seed": 2}, sample={"width": 100e-9}, **NOISE) as microscope:
        microscope.approach(rate=10e-6)
        frame = {"size_x": 400e-9, "size_y": 80e-9, "pixels": 128, "lines": 8, "line_rate": 5.0}
        image = microscope.scan(**frame, channels="lateral_voltage")
        lateral = image.lateral_voltage
        half = 0.5 * (lateral.sel(direction="trace") - lateral.sel(direction="retrace"))
        for side, x in (("left", -40e-9), ("right", 40e-9)):
            near = half.sel(x=slice(x - 20e-9, x + 20e-9)).mean("x").values
            microscope.go_to(x=x, y=0.0)
            curves = microscope.force_curve(
                trigger_voltage=6.0, lift=150e-9, ramp=400e-9, approach_rate=4e-6, retract_rate=4e-6, count=8
            )
            slopes, pulls = [], []
            for number in range(curves.sizes["curve"]):
                curve = curves.isel(curve=number)
                towards, away = (curve.where(curve.phase == phase, drop=True) for phase in (APPROACH, RETRACT))
                z, volts = towards.z.values, towards.deflection_voltage.values
                pressed = (volts > 1.8) & (volts < 5.4)
                slopes.append(1.0 / np.polyfit(z[pressed], volts[pressed], 1)[0])
                pulls.append(np.mean(volts[: len(volts) // 10]) - float(away.deflection_voltage.min()))
            named = {"friction": near, "sensitivity": slopes, "pull_off": pulls}
            found[side] = {
                name: (float(np.mean(each)), float(np.std(each, ddof=1)) / math.sqrt(len(each)))
                for name, each in named.items()
            }
    return found


@pytest.mark.long
def test_vendors_wrapper_finds_the_edge_and_has_the_numbers_of_the_verbs(served: Served, nanonis_spm: Path) -> None:
    printed = run(served, nanonis_spm, EXAMPLE)
    edge, left, right = printed.splitlines()
    assert abs(float(re.findall(r"[-.\d]+(?= nm)", edge)[0])) < 400.0 / 128.0
    wanted = by_verbs()
    for side, line in (("left", left), ("right", right)):
        numbers = {name: (float(value), float(error)) for name, value, error in re.findall(_NUMBER, line)}
        assert numbers.keys() == wanted[side].keys()
        for name, (value, error) in numbers.items():
            other, other_error = wanted[side][name]
            assert abs(value - other) < SOME * math.hypot(error, other_error), (side, name)


@pytest.mark.long
def test_sweep_of_the_drive_has_resonance_and_quality_of_the_cantilever(tmp_path: Path) -> None:
    plant = {"kind": "averaged", "lever": "ppp_fmr", "gap": 500e-9, "dt": 2e-6}
    tapping = Served(tmp_path, scenario="tapping", engaged=False, plant=plant)
    with tapping.client() as client:
        client.call("PLLFreqSwp.ParamsSet", "i i f f", 1, 61, 0.01, 0.1)
        returns = "SA M d d f f i i"
        names, rows, resonance, quality, phase, *_ = client.call("PLLFreqSwp.Start", "i I I", 1, 1, 1, returns=returns)
    tapping.close()
    assert names == ["Frequency Shift (Hz)", "Amplitude (m)", "Phase (deg)", "Excitation (V)"]
    assert np.array(rows).shape == (4, 61) and (np.diff(rows[0]) > 0.0).all()
    # The preset: 77 kHz, Q = 165; at its resonance a driven oscillator lags by 90 degrees.
    assert (resonance, quality, phase) == pytest.approx((77e3, 165.0, 90.0), rel=1e-3)


@pytest.mark.long
def test_scan_by_the_protocol_takes_no_more_processor_time_than_the_verb(served: Served) -> None:
    def by_protocol() -> None:
        with served.client() as client:
            client.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 200e-9, 200e-9, 0.0)
            client.call("Scan.BufferSet", "*i i i", [Z, VERTICAL, HORIZONTAL], 64, 64)
            client.call("Scan.SpeedSet", "f f f f H f", 0.0, 0.0, 0.05, 0.05, 2, 1.0)
            client.call("Scan.Action", "H I", 0, 1)
            client.call("Scan.WaitEndOfScan", "i", -1, returns="I S")
            for channel in (Z, VERTICAL, HORIZONTAL):
                for way in (1, 0):
                    client.call("Scan.FrameDataGrab", "I I", channel, way, returns="S M I")

    def by_verb() -> None:
        channels = "height, deflection_voltage, lateral_voltage"
        served.microscope.scan(size_x=200e-9, pixels=64, lines=64, line_rate=10.0, channels=channels)

    def taken(scan: Callable[[], None]) -> float:
        begin = time.process_time()
        scan()
        return time.process_time() - begin

    if not served.microscope.state.approached:
        served.microscope.approach(rate=10e-6, range=10e-6)
    taken(by_verb), taken(by_protocol)
    # In turn, as the load of the machine changes: the least of each is what it needs.
    protocol, verb = np.array([(taken(by_protocol), taken(by_verb)) for _ in range(4)]).min(axis=0)
    assert protocol < 1.1 * verb
