"""State of the friction-predicting law."""

import numpy as np

from ...parts.part import Numbers, Tree
from ...records import record
from .constants import INTERVALS, SLOTS

STATE = record(
    "started",
    "time",  # of the last measurement [s]
    "X",  # the scanner as measured or estimated, then as predicted
    "Y",
    "Z",
    "V_X",
    "V_Y",
    "V_Z",
    "Q",  # the tip
    "load",  # on it
    "at_x",  # where the scanner was at the last measurement
    "at_y",
    "H",  # height of the sample under the tip there, and its slopes along the way
    "H_x",
    "H_y",
    "ratio",  # friction over the nominal one there, and its slopes
    "ratio_x",
    "ratio_y",
    "slips",  # measurements of it
    "here",  # strength at the place looked at
    "height",  # the sample at one place, as afm_model.signals.SURFACE
    "slope_x",
    "slope_y",
    "curvature",
    "curvature_xx",
    "curvature_yy",
    "curvature_xy",
    "strength",
    "plan",  # drives of the slots from now on
    "p",  # reference now: position, rate, acceleration of x, y; as it was; sums of its frequency
    "v",
    "acc",
    "p_last",
    "acc_last",
    "sum_pa",
    "sum_pp",
    "omega",
    "path",  # reference at the ends of the fine intervals: X, Y, Z and rates
    "asked",  # what each fine interval asks for
    "friction",  # bound of friction in it
    "direction",  # and its direction
    arrays={
        "plan": (SLOTS, 3),
        "p": (3,),
        "v": (3,),
        "acc": (3,),
        "p_last": (2,),
        "acc_last": (2,),
        "sum_pa": (2,),
        "sum_pp": (2,),
        "omega": (2,),
        "path": (INTERVALS + 1, 3, 2),
        "asked": (INTERVALS, 3, 2),
        "friction": (INTERVALS + 1,),
        "direction": (INTERVALS, 2),
    },
)


def start(parameters: Tree) -> Numbers:
    """Nothing is known; a bound of friction that is to be found is approached from below."""
    first = np.zeros(1, STATE)[0]
    first["ratio"] = 0.75 if parameters.law.friction == "identified" else 1.0
    return {name: first[name] for name in STATE.names or ()}
