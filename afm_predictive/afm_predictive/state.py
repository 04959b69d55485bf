"""State of the friction-predicting law."""

from functools import cache
from typing import Annotated

import numpy as np

from afm_model.parts import Array, Integers, Numbers, Record, Tree, Vector, exp

from .constants import ANSWERS, FOLLOWED, INTERVALS, LENGTH, NODES, SLOTS, SPACING, UNEXPLAINED


class TrustState(Record):
    """guard.py: how far the model is trusted."""

    started: float  # one: from the first answer on
    fallbacks: float  # how often the model was distrusted
    distrust: float  # how far it is now, from 0 to 1
    calm_ticks: float  # measurements it has explained since
    patience: float  # how many times more of them are needed
    fastest: float  # largest speed of the reference so far
    reach: float  # farthest that the reference has been from there:
    from_x: float  # where the tip was at the start
    from_y: float
    turned: Annotated[Array, (2, 2)]  # place and rate of the reference where it turned last
    fastest_since: float  # largest speed of the reference since then
    fastest_before: float  # and in the stretch before


class FlightState(Record):
    """flight.py: drives on their way, and the reserve."""

    last: int  # number of the last measurement
    answered: Annotated[Integers, (ANSWERS,)]  # numbers of the last measurements answered
    lengths: Annotated[Integers, (ANSWERS,)]  # of the drives of each answer
    sent: int  # address of the drives of each answer
    plan: Annotated[Array, (SLOTS, 3)]  # drives of the slots from now on
    reserve_end: int  # number of the slot after the reserve
    reserved: Annotated[Array, (6,)]  # position and rate of the scanner predicted there
    kept: Annotated[Array, (SLOTS, 3)]  # drives of the reserve


class MotionState(Record):
    """control.py, nominal_plant.py: the scanner and the tip."""

    estimate: Annotated[Array, (6,)]  # position and rate at the last measurement
    at_x: float  # its place there
    at_y: float
    X: float  # position and rate as measured or estimated, then as predicted
    Y: float
    Z: float
    V_X: float
    V_Y: float
    V_Z: float
    impulse: Annotated[Array, (2,)]  # of friction in the slot last predicted
    Q: float  # height of the tip
    load: float  # on it
    rise: float  # acceleration along z by more than following the surface takes


class UnexplainedState(Record):
    """unexplained.py: gamma, b, c of an axis; along z only b and c, for there is no friction."""

    learned: Annotated[Array, (3, UNEXPLAINED)]  # as estimated
    unsure: Annotated[Array, (3, UNEXPLAINED, UNEXPLAINED)]  # their covariance
    gain_of: Annotated[Array, (3,)]  # gamma, b and c as they are believed
    slow: Annotated[Array, (3,)]
    softer: Annotated[Array, (3,)]
    weight: Annotated[Array, (UNEXPLAINED,)]  # between two steps of the filter
    tells: Annotated[Array, (UNEXPLAINED,)]
    expects: int  # measurement whose answer the last prediction took to be in force until this one
    age: int  # of the answer in force, in control periods
    steady: float  # periods for which that has not changed
    expected: Annotated[Array, (3, 4)]  # for this measurement: position, rate; drive; mean friction until then
    seen: Annotated[Array, (2, 2)]  # position and rate of x and y at the last measurement
    signal: float  # lateral force there
    knows_y: float  # one: a slip tells y from x; two: the direction of a slip contradicts what was believed
    contradicted: float  # of positions alone; one: what is learned explains a force that counts
    counts: float  # the mean square of that force
    place_x: float  # of positions alone: where x was before its last correction, and rests since
    moved_by_c: Annotated[Array, (2,)]  # what more stiffness of z does to position and rate of the copy
    zero_of_drive: Vector  # what was left over at the start
    unstretched: Vector  # the places where the springs are not stretched then
    zero_of_height: float  # error of the z sensor, if it is not that of the piezo


class ObserverState(Record):
    """observer.py, kalman.py."""

    P: Annotated[Array, (5, 5)]  # covariance of the states
    carried: Annotated[Array, (5, 5)]  # what the filter needs between two steps
    half: Annotated[Array, (5, 5)]
    gains: Annotated[Array, (5,)]
    weights: Annotated[Array, (5,)]
    change: Annotated[Array, (5,)]  # of the states, by the measurements taken so far
    across: float  # variance of the position across the motion
    grip: float  # measured ratio; no measurement: zero
    off_force: float  # friction of the copy less the measured one
    nis: float  # mean square of the innovations of positions along the motion, over their variance
    nis_of_height: float  # the same of heights


class SampleState(Record):
    """sample_estimate.py: height and bound of friction under the tip; what `look` finds at one place."""

    H: Annotated[Array, (FOLLOWED,)]  # height, with its slopes along the way
    ratio: Annotated[Array, (FOLLOWED,)]  # bound of friction over the nominal one, in the same way
    slips: float  # measurements of it
    unknown: int  # one: the surface is not known, or not the one that was given
    contradicts: float  # mean square of the measured height less the given one
    doubt: float  # variance of an estimated position
    approach: float  # by which the sample is asked for nearer, while there is no friction
    touched: float  # its height where there was
    here: float  # ratio at the place looked at
    mapped: float  # one: that is on the map
    mapped_H: float  # one: its height is
    height: float  # the sample there, as afm_model.parts.signals.Surface
    slope_x: float
    slope_y: float
    curvature: float
    curvature_xx: float
    curvature_yy: float
    curvature_xy: float
    strength: float


class MapState(Record):
    """map.py: the line of the reference."""

    line_x: float  # a place on it
    line_y: float
    line_tx: float  # its direction
    line_ty: float
    pitch: float  # distance of the nodes
    least: float  # part of it visited
    most: float
    way: float  # gone on it
    written: float  # one: by a height
    gripped: float  # one: by a ratio
    misfit_H: float  # mean square of the heights measured less those of the map, over their variance
    misfit: float  # the same of ratios
    map_H: Annotated[Array, (NODES,)]
    map_ratio: Annotated[Array, (NODES,)]
    covariance: Annotated[Array, (NODES, NODES)]  # of a node and those up to it, over the variance of the prior
    prior: Annotated[Array, (2 * NODES,)]
    visited: Annotated[Array, (NODES,)]  # way at the first visit
    gain: Annotated[Array, (NODES,)]


class AskedState(Record):
    """asked.py: the reference, and what the drive is asked for."""

    p: Annotated[Array, (3,)]  # reference now: position, rate, acceleration
    v: Annotated[Array, (3,)]
    acc: Annotated[Array, (3,)]
    lead: Annotated[Array, (2,)]  # of a tip far from it at the start: how much of the way is left
    p_last: Annotated[Array, (2,)]  # as it was
    acc_last: Annotated[Array, (2,)]
    sum_pa: Annotated[Array, (2,)]  # sums of its frequency
    sum_pp: Annotated[Array, (2,)]
    omega: Annotated[Array, (2,)]
    path_begins: float  # time from the measurement to the first of the fine intervals
    path: Annotated[Array, (INTERVALS + 1, 3, 2)]  # reference at the ends of the fine intervals: X, Y, Z and rates
    asked: Annotated[Array, (INTERVALS, 3, 2)]  # what each fine interval asks for
    friction: Annotated[Array, (INTERVALS + 1,)]  # bound of friction in it
    direction: Annotated[Array, (INTERVALS, 2)]  # and its direction


class State(TrustState, FlightState, MotionState, UnexplainedState, ObserverState, SampleState, MapState, AskedState):
    """All of it."""


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
