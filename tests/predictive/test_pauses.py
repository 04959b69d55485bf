"""Claims about the friction-predicting law with positions alone where the reference stops and goes on."""

import math

import numpy as np

from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, parameters_of
from afm_predictive.constants import VALUE

from .law_records import along

STOP = 0.14
"""When the reference stops [s], a tenth into its second period."""


def paused(title, pause):
    """Of a run at 50 us, surface known: error in the stroke behind the pause [%], ratio of friction in the pause."""
    case, period = CASE[title]._replace(periods=4), RATES[0].period
    sim, told = parameters_of(case, RATES[0], contender("predictive surface=known"), 1.0)
    begin, behind = round(STOP / period), round((STOP + pause) / period)

    def at(tick):
        angle = 50.0 * period * (tick if tick < begin else max(begin, tick - behind + begin))
        moves = float(not begin <= tick < behind)
        return 5e-9 * math.sin(angle), moves * 250e-9 * math.cos(angle), -moves * 1.25e-5 * math.sin(angle)

    off, ratio = [], []
    for y, truth, law in along(at, behind + round(0.06 / period), sim, told):
        off.append(abs(truth["position"][:2] - y.reference_position[:2]).max() / 5e-11)
        ratio.append(law.state.ratio[VALUE])
    return max(off[behind:]), np.array(ratio[begin:behind])


def test_what_is_known_of_a_scanner_outlasts_a_pause():
    # Forgotten in the pause, it cost 2 to 7 %.
    error, _ = paused("resonances +2 %", 0.1)
    assert error < 0.8
