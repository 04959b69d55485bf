"""Claims about the loop along z that a law or an object of one's own can use."""

import importlib
from pathlib import Path

import numpy as np

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_model.studies.linear import at_timing

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "controllers"
# Hardly any friction, which the PD could not overcome.
SHORT = {"run.duration": 0.04, "score.start": 0.01, "contact.tau": 1e3}


def test_law_and_object_of_ones_own_drive_z_as_the_laws_of_this_package(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))

    def made(kind: str):
        return at_timing(build(SimParameters, SHORT), build(ControllerParameters, {"law.kind": kind}), 2e-5, 1)

    law, shared, held = (simulate(*made(kind)) for kind in ("pd_height:PD", "observer", "pd_law:PD"))
    sim, _ = made("observer")
    object_ = importlib.import_module("pd_height").Pd(sim)
    once, again = simulate(sim, object_), simulate(sim, object_)
    for run in (law, once):
        assert run.score.rms[2] < 2.0 * shared.score.rms[2] < 0.05 * held.score.rms[2]
    np.testing.assert_allclose(once.drive, law.drive, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(again.drive, once.drive)
