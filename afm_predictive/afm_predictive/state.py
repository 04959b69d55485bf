"""State of the friction-predicting law."""

from functools import cache
from typing import Annotated

import numpy as np

from afm_model.parts import Array, Integers, Numbers, Record, Tree, Vector, exp

from .constants import ANSWERS, FOLLOWED, INTERVALS, LENGTH, NODES, SLOTS, SPACING, UNEXPLAINED


class State(Record):
    started: float
    fallbacks: float  # how often the model was distrusted, how far it is now, measurements it has explained since
    distrust: float
    calm_ticks: float
    patience: float  # how many times more of them are needed
    reach: float  # farthest that the reference has been from where the tip was at the start, which follows
    from_x: float
    from_y: float
    turned: Annotated[Array, (2, 2)]  # place and rate of the reference where it turned last, its largest speeds since
    fastest_since: float  # then and in the stretch before
    fastest_before: float
    answered: Annotated[Integers, (ANSWERS,)]  # the last measurements answered
    lengths: Annotated[Integers, (ANSWERS,)]  # of the drives of each answer
    sent: int  # address of the drives of each answer
    last: int  # number of the last measurement
    estimate: Annotated[Array, (6,)]  # position and rate there
    seen: Annotated[Array, (2, 2)]  # position and rate of x and y at the last measurement
    signal: float  # lateral force there
    place_x: float  # of positions alone: where x was before its last correction, and rests since
    # What the model does not explain, unexplained.py: gamma, b, c as they are estimated, and their
    # covariance; as they are believed. Along z only b and c: there is no friction.
    learned: Annotated[Array, (3, UNEXPLAINED)]
    unsure: Annotated[Array, (3, UNEXPLAINED, UNEXPLAINED)]
    gain_of: Annotated[Array, (3,)]
    slow: Annotated[Array, (3,)]
    softer: Annotated[Array, (3,)]
    weight: Annotated[Array, (UNEXPLAINED,)]
    tells: Annotated[Array, (UNEXPLAINED,)]
    # What was predicted for this measurement: position, rate; drive; of x and y mean friction until then.
    expected: Annotated[Array, (3, 4)]
    impulse: Annotated[Array, (2,)]  # of friction in the slot last predicted
    told: float  # one: the tip has slipped; two: the direction of y told; of positions alone: the model is contradicted
    counts: float  # of positions alone: the mean square force that what is learned explains
    grip: float  # of positions alone: measured ratio; no measurement: zero
    # Of positions alone: mean square of the innovations over their variance, of positions along the motion, of heights.
    nis: float
    nis_of_height: float
    moved_by_c: Annotated[Array, (2,)]  # what more stiffness of z does to position and rate of the copy
    off_force: float  # by which friction of the copy was off the measured one
    P: Annotated[Array, (5, 5)]  # covariance of the states of observer.py
    carried: Annotated[Array, (5, 5)]  # what a Kalman filter needs between two steps
    half: Annotated[Array, (5, 5)]
    gains: Annotated[Array, (5,)]
    weights: Annotated[Array, (5,)]
    change: Annotated[Array, (5,)]
    across: float  # variance of the position across the motion
    X: float  # the scanner as measured or estimated, then as predicted
    Y: float
    Z: float
    V_X: float
    V_Y: float
    V_Z: float
    Q: float  # the tip
    load: float  # on it
    doubt: float  # variance of an estimated position
    approach: float  # by which the sample is asked for nearer, while there is no friction; its height where there was
    touched: float
    rise: float  # acceleration along z by more than following the surface takes
    at_x: float  # where the scanner was at the last measurement
    at_y: float
    # Height of the sample under the tip there, and its slopes along the way: sample_estimate.py.
    unknown: int  # one: the surface is not known, or not the one that was told; mean square by which it is another
    contradicts: float
    H: Annotated[Array, (FOLLOWED,)]
    ratio: Annotated[Array, (FOLLOWED,)]  # bound of friction over the nominal one there, in the same way
    slips: float  # measurements of it
    # unexplained.py, at the start:
    zero_of_drive: Vector  # what was left over at the start; the places where the springs are not stretched then
    unstretched: Vector
    zero_of_height: float  # what the z sensor is off, if not the piezo is
    mapped: float
    mapped_H: float  # one: the place looked at is on the map, with its height; with its ratio
    here: float  # strength at the place looked at
    height: float  # the sample at one place, as afm_model.parts.signals.Surface
    slope_x: float
    slope_y: float
    curvature: float
    curvature_xx: float
    curvature_yy: float
    curvature_xy: float
    strength: float
    plan: Annotated[Array, (SLOTS, 3)]  # drives of the slots from now on
    reserve_end: int  # the reserve: number of the slot behind it, the predicted scanner there, its drives
    reserved: Annotated[Array, (6,)]
    kept: Annotated[Array, (SLOTS, 3)]
    line_x: float  # the line: a place on it, its direction, distance of the nodes, part of it visited
    line_y: float
    line_tx: float
    line_ty: float
    pitch: float
    least: float
    most: float
    way: float  # gone on it
    written: float
    gripped: float
    misfit_H: float  # mean square of what heights and ratios are off the map, over their variance
    misfit: float
    map_H: Annotated[Array, (NODES,)]  # the map along it, and its covariance over that of the prior, of a node
    # and those up to it
    map_ratio: Annotated[Array, (NODES,)]
    covariance: Annotated[Array, (NODES, NODES)]
    prior: Annotated[Array, (2 * NODES,)]
    visited: Annotated[Array, (NODES,)]  # way at the first visit
    gain: Annotated[Array, (NODES,)]
    fastest: float  # speed of the reference so far
    p: Annotated[Array, (3,)]  # reference now: position, rate, acceleration of x, y; as it was; sums of its frequency
    v: Annotated[Array, (3,)]
    acc: Annotated[Array, (3,)]
    lead: Annotated[Array, (2,)]  # of a tip far from it at the start: how much of the way is left
    p_last: Annotated[Array, (2,)]
    acc_last: Annotated[Array, (2,)]
    sum_pa: Annotated[Array, (2,)]
    sum_pp: Annotated[Array, (2,)]
    omega: Annotated[Array, (2,)]
    path_begins: float  # time from the measurement to the first of the fine intervals
    path: Annotated[Array, (INTERVALS + 1, 3, 2)]  # reference at the ends of the fine intervals: X, Y, Z and rates
    asked: Annotated[Array, (INTERVALS, 3, 2)]  # what each fine interval asks for
    friction: Annotated[Array, (INTERVALS + 1,)]  # bound of friction in it
    direction: Annotated[Array, (INTERVALS, 2)]  # and its direction


@cache
def _prior() -> tuple[float, ...]:
    """Covariance of the map before anything is measured, of a node and one that is i - NODES nodes on, on the ring."""
    apart = np.abs(np.arange(2 * NODES) - NODES)
    apart = np.minimum(apart, NODES - apart) * SPACING / LENGTH
    return tuple(exp(-0.5 * each * each) for each in apart)


def start(parameters: Tree) -> Numbers:
    """What does not change; the rest is begun at the first measurement (guard.py)."""
    first = np.zeros(1, State)[0]
    first["prior"] = _prior()
    first["answered"] = -1
    return {name: first[name] for name in State.names}
