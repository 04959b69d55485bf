"""Claims about angles: the same bits on every processor, radians alone."""

import math
import os
import subprocess
import sys

import pytest

from afm_model import ParameterError, build
from afm_model.microscope.verbs import FrictionLoop, Scan
from afm_model.parameters import InstrumentParameters

CODE = """
from types import SimpleNamespace
from afm_model.microscope.plan import distance, lines
from afm_model.microscope.verbs import Scan
from afm_model.microscope.image import Image
view = SimpleNamespace(sample_period=1e-5, samples_per_tick=10, resonance=500.0)
for angle in [0.259, 1.31, 1.622, 1.995, *(0.0157 * i for i in range(400))]:
    scan = Scan(size_x=40e-9, size_y=10e-9, pixels=16, lines=2, line_rate=20.0, angle=angle)
    plan = lines(scan, view)
    print(*(x.hex() for corner in plan.corners for x in corner), distance(*plan.corners[:2]).hex())
    print(*(x.hex() for x in Image.empty(scan, {}).arrays().coordinates["place_x"].values.ravel()))
"""


@pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="these switches are of x86-64")
def test_places_of_a_scan_at_any_angle_are_the_same_bits_without_fma_and_avx():
    plain = {
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX,-AVX2,-AVX512F",
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    }
    found = [
        subprocess.run([sys.executable, "-c", CODE], env={**os.environ, **more}, check=True, capture_output=True)
        for more in ({}, plain)
    ]
    assert len(found[0].stdout) > 10_000
    assert found[0].stdout == found[1].stdout


@pytest.mark.parametrize("verb", [Scan, FrictionLoop])
def test_an_angle_in_degrees_is_refused_with_its_value_in_radians(verb):
    told = (
        "angle = 45.0 rad is not allowed: it must be a finite number >= -6.28319 and <= 6.28319; "
        "45 degrees are 0.785398 rad"
    )
    with pytest.raises(ParameterError) as error:
        verb.of({"angle": 45.0})
    assert str(error.value) == told
    assert verb.of({"angle": -2.0 * math.pi}).angle == -2.0 * math.pi


@pytest.mark.parametrize(
    ("name", "degrees", "kinds"),
    [
        ("plant.tilt", 12.0, {"plant.kind": "lever"}),
        ("sample.angle_x", -3.0, {"sample.kind": "plane"}),
        ("sample.angle", 25.0, {"sample.kind": "grating"}),
        ("sample.angle", 30.0, {"sample.kind": "lattice"}),
        ("onboard.drive_phase", 90.0, {"onboard.kind": "dynamic"}),
    ],
)
def test_every_angle_of_the_instrument_offers_the_value_in_radians(name, degrees, kinds):
    with pytest.raises(ParameterError, match=f"{degrees:g} degrees are {math.radians(degrees):.6g} rad"):
        build(InstrumentParameters, kinds | {name: degrees})


def test_an_angle_that_no_degrees_explain_is_refused_without_an_offer():
    with pytest.raises(ParameterError, match=r"<= 6\.28319$"):
        Scan.of({"angle": 4000.0})
