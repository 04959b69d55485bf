"""State of the friction-predicting law."""

import numpy as np

from ...core.records import record
from ...parts.part import Numbers, Tree
from .joint import UNKNOWN
from .map import LENGTH, NODES, SPACING
from .predictive_constants import ANSWERS, INTERVALS, SLOTS
from .sample_estimate import MEAN, VALUE

STATE = record(
    "started",
    "answered",  # the last measurements answered
    "lengths",  # of the drives of each answer
    "sent",  # address of the drives of each answer
    "last",  # number of the last measurement
    "estimate",  # position and rate there
    "grip",  # measured friction along its direction; no measurement: zero
    "spread",  # covariance of position and speed along the motion, variance across it, over that of a position
    "joint",  # covariance of the states of afm_model.law.predictive.joint
    "heading",  # direction of the motion there
    "calm",  # forces in succession that were as expected
    "uncertainty",  # covariance of what one filter estimates: afm_model.law.predictive.together
    "carried",  # what a Kalman filter needs between two steps
    "half",
    "held",
    "gains",
    "weights",
    "change",
    "across",  # variance of the position across the motion
    "bound",  # of friction, in place of the one believed in, for the copy; zero: none
    "X",  # the scanner as measured or estimated, then as predicted
    "Y",
    "Z",
    "V_X",
    "V_Y",
    "V_Z",
    "Q",  # the tip
    "load",  # on it
    "doubt",  # variance of an estimated position
    "rise",  # acceleration along z by more than following the surface takes
    "at_x",  # where the scanner was at the last measurement
    "at_y",
    "H",  # height of the sample under the tip there, and its slopes along the way: sample_estimate.py
    "ratio",  # bound of friction over the nominal one there, in the same way
    "slips",  # measurements of it
    "here",  # strength at the place looked at
    "height",  # the sample at one place, as afm_model.parts.signals.SURFACE
    "slope_x",
    "slope_y",
    "curvature",
    "curvature_xx",
    "curvature_yy",
    "curvature_xy",
    "strength",
    "plan",  # drives of the slots from now on
    "reserve_end",  # the reserve: number of the slot behind it, the predicted scanner there, its drives
    "reserved",
    "kept",
    "line_x",  # the line: a place on it, its direction, distance of the nodes, part of it visited [nodes]
    "line_y",
    "line_tx",
    "line_ty",
    "pitch",
    "least",
    "most",
    "way",  # gone on it
    "written",
    "gripped",
    "map_H",  # the map along it, and its covariance over that of the prior
    "map_ratio",
    "covariance",
    "prior",
    "visited",  # way at the first visit
    "gain",
    "fastest",  # speed of the reference so far
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
    integers=("answered", "lengths", "sent", "last", "reserve_end"),
    arrays={
        "H": (10,),
        "ratio": (10,),
        "estimate": (6,),
        "spread": (4,),
        "joint": (4, 4),
        "heading": (2,),
        "uncertainty": (5, 5),
        "carried": (5, 5),
        "half": (5, 5),
        "held": (5, 5),
        "gains": (5,),
        "weights": (5,),
        "change": (5,),
        "answered": (ANSWERS,),
        "lengths": (ANSWERS,),
        "plan": (SLOTS, 3),
        "reserved": (6,),
        "kept": (SLOTS, 3),
        "map_H": (NODES,),
        "map_ratio": (NODES,),
        "covariance": (NODES, NODES),
        "prior": (NODES,),
        "gain": (NODES,),
        "visited": (NODES,),
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
    law = parameters.law
    first["ratio"][[VALUE, MEAN]] = 1.0 - UNKNOWN if law.friction == "identified" else 1.0
    noise = law.position_noise / parameters.scales.x0
    first["joint"] = np.diag([noise**2, 0.0, noise**2, UNKNOWN**2])
    first["heading"][0] = 1.0
    nodes = np.arange(NODES)
    apart = np.minimum(nodes, NODES - nodes) * SPACING / LENGTH
    first["prior"] = np.exp(-0.5 * apart**2)
    first["covariance"] = [np.roll(first["prior"], node) for node in range(NODES)]
    first["answered"] = first["reserve_end"] = -1
    first["visited"] = np.inf
    return {name: first[name] for name in STATE.names or ()}
