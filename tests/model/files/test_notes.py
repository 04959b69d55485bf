"""Claims about what is kept with a scan of the microscope that made it."""

import gwyfile

from afm_model import SimParameters, build
from afm_model.files import write_gwy
from afm_model.microscope.verbs.scan import notes

from . import scans


def test_notes_say_cantilever_setpoint_gains_and_sample_as_they_are():
    lever = {"plant.kind": "lever", "onboard.kind": "pi", "onboard.setpoint_force": 1e-8, "sample.kind": "flat"}
    said = notes(build(SimParameters, lever))
    assert said["Microscope"] == "virtual atomic force microscope, plant lever, scanner flexure_90um"
    assert said["Cantilever"] == "ppp_lfmr, k = 0.2 N/m, f0 = 26 kHz, tip radius 10 nm"
    other = notes(build(SimParameters, lever | {"plant.k": 2.8, "plant.f0": 75e3, "plant.dt": 0.5e-6}))
    assert other["Cantilever"] == "ppp_lfmr but for k, f0, k = 2.8 N/m, f0 = 75 kHz, tip radius 10 nm"
    assert said["Cantilever axis"].startswith("y;")
    assert (said["Setpoint"], said["Gains"]) == ("10 nN", "P = 0 m/V, I = 5e-06 m/(V s)")
    assert said["Sample"] == "flat"
    voltage = notes(build(SimParameters, lever | {"onboard.setpoint_force": 0.0, "onboard.setpoint_voltage": 0.5}))
    assert voltage["Setpoint"] == "500 mV"


def test_notes_of_the_microscope_of_the_paper_leave_out_what_it_has_not(tmp_path):
    said = notes(SimParameters())
    assert "Cantilever" not in said and "Gains" not in said
    image = scans.scanned(pixels=8, lines=8)
    image.metadata = said
    read = gwyfile.load(str(write_gwy(tmp_path / "scan.gwy", image)))["/0/meta"]
    assert {name: read[name] for name in said} == said
