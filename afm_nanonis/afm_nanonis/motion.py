"""FolMe, ZCtrl and AutoApproach: the tip along the sample, along Z, to the sample and away."""

import math
from typing import Any

from .codec import ProtocolError
from .front import Front
from .handlers import handles
from .jobs import APPROACH, MOVE, SCAN, WITHDRAW, Work, Z
from .settings import single

_FASTEST = 1e-5
"""Of an approach by the integrator, and of a motion of Z [m/s]."""
CONTROLLERS = {"deflection": "cAFM", "amplitude": "Amplitude", "frequency": "Frequency (neg)"}
"""By what the loop regulates."""
OFF, ON, SWITCHING_OFF, WITHDRAWING = 1, 2, 4, 6
_LEAST = 1e-12
_NOTHING = 1e-15
"""Less than any scanner moves by [m], or turns by [deg]."""


@handles("FolMe.XYPosGet", "Scan.XYPosGet")
def _place(front: Front, wait: int) -> list[Any]:
    # As it is driven, without the residual motion of the scanner: a client compares it with what it has set.
    read = front.read("asked_x", "asked_y")
    return [read["asked_x"].value, read["asked_y"].value]


def of_sum(value: float) -> float:
    """A place [m] or an angle [deg]; what rounding has left of 0 is 0."""
    return 0.0 if abs(value) < _NOTHING else value


@handles("FolMe.XYPosSet")
def _move(front: Front, x: float, y: float, wait: int) -> list[Any]:
    for axis, value, travel in zip("xy", (x, y), front.ranges, strict=False):
        if not abs(value) <= 0.5 * travel:
            raise ProtocolError(f"{axis} = {value:g} m is not allowed: it must be within +-{0.5 * travel:g} m")
    x, y = of_sum(x), of_sum(y)
    speed = max(front.follow_speed if front.own_speed else front.scan.speeds[0], _LEAST)

    def prepare() -> Work:
        return lambda: front.do("move_to", x=x, y=y, speed=min(speed, 1.0))

    number = front.jobs.start(MOVE, prepare)
    if wait:
        front.jobs.finish(number)
    return []


@handles("FolMe.SpeedSet")
def _set_speed(front: Front, speed: float, own: int) -> list[Any]:
    if speed > 0.0:
        front.follow_speed = speed
    front.own_speed = own != 0
    return []


@handles("FolMe.SpeedGet")
def _speed(front: Front) -> list[Any]:
    return [front.follow_speed, int(front.own_speed)]


@handles("FolMe.Stop")
def _stop_move(front: Front) -> list[Any]:
    front.jobs.stop(MOVE)
    return []


@handles("FolMe.OversamplGet")
def _oversampling(front: Front) -> list[Any]:
    return [10, 1000.0]


@handles("FolMe.PSExpGet")
def _experiment(front: Front) -> list[Any]:
    return [0, ["Z Spectroscopy", "Bias Spectroscopy"]]


@handles("ZCtrl.ZPosGet")
def _z(front: Front) -> list[Any]:
    return [front.z]


def _on(front: Front) -> bool:
    """Whether the loop has Z, or an approach is on the way that will give it to the loop."""
    if front.jobs.doing == APPROACH and front.engaging:
        return True
    return front.jobs.doing not in (APPROACH, WITHDRAW) and front.state.feedback == "on" and front.follows


def _bounded(front: Front, z: float) -> float:
    high, low = front.z_limits
    return min(max(z, low), high)


@handles("ZCtrl.ZPosSet")
def _set_z(front: Front, z: float) -> list[Any]:
    if _on(front) or math.isnan(z):
        return []
    target = -_bounded(front, z)

    def prepare() -> Work:
        return lambda: front.do("move_z", z=target, rate=_FASTEST)

    front.jobs.finish(front.jobs.start(Z, prepare))
    return []


def engage(front: Front, *, by_controller: bool) -> None:
    """Approach in the background, at the rate of the integrator."""
    state = front.state
    rate = min(max(state.integral_gain * state.setpoint, 1e-9), _FASTEST)

    def prepare() -> Work:
        front.engaging = by_controller
        far = max(front.z - front.z_limits[1], _LEAST)
        return lambda: front.do("approach", rate=rate if by_controller else 1e-6, range=far)

    front.jobs.start(APPROACH, prepare)


@handles("ZCtrl.OnOffSet")
def _switch(front: Front, on: int) -> list[Any]:
    if on:
        if _on(front):
            return []
        if front.follows and front.state.feedback != "off":
            with front.setting() as microscope:
                microscope.set_feedback("on")
            return []
        engage(front, by_controller=True)
        return []
    front.jobs.stop(APPROACH, MOVE)
    if not _on(front):
        return []
    (delay,), (lift,) = front.kept("ZCtrl.SwitchOffDelayGet"), front.kept("ZCtrl.TipLiftGet")
    if front.jobs.doing == SCAN or not front.state.approached:
        with front.setting() as microscope:
            microscope.set_feedback("hold")
        return []

    def prepare() -> Work:
        # Not into the sample, and not beyond the limits.
        lifted = min(max(lift, 0.0), max(front.z_limits[0] - front.z, 0.0))
        return lambda: front.do("hold", delay=max(delay, 0.0), lift=lifted)

    front.jobs.start(Z, prepare)
    return []


@handles("ZCtrl.OnOffGet")
def _is_on(front: Front) -> list[Any]:
    return [int(_on(front))]


@handles("ZCtrl.StatusGet")
def _status(front: Front) -> list[Any]:
    if front.jobs.doing == WITHDRAW:
        return [WITHDRAWING]
    if _on(front):
        return [SWITCHING_OFF if front.jobs.doing == Z else ON]
    return [OFF]


@handles("ZCtrl.SetpntSet")
def _set_setpoint(front: Front, value: float) -> list[Any]:
    volts = front.signals.volts(value)
    with front.setting() as microscope:
        microscope.set_setpoint(voltage=volts)
    front.setpoint = (value, (front.state.setpoint, front.signals.config(1)))
    return []


@handles("ZCtrl.SetpntGet")
def _setpoint(front: Front) -> list[Any]:
    value, then = front.setpoint
    now, config = front.state.setpoint, front.signals.config(1)
    # What a client has set it gets back to the last bit.
    if then == (now, config):
        return [value]
    _, _, calibration, offset = config
    return [calibration * now + offset]


@handles("ZCtrl.GainSet")
def _set_gains(front: Front, proportional: float, constant: float, integral: float) -> list[Any]:
    # If they disagree, gain and time constant win.
    given = proportional / constant if constant > 0.0 else integral
    _, _, calibration, _ = front.signals.config(1)
    with front.setting() as microscope:
        microscope.set_gains(max(proportional, 0.0) * abs(calibration), max(given, 0.0) * abs(calibration))
    front.gains = (proportional, constant, given)
    return []


@handles("ZCtrl.GainGet")
def _gains(front: Front) -> list[Any]:
    state = front.state
    _, _, calibration, _ = front.signals.config(1)
    found = [state.proportional_gain / abs(calibration), state.integral_gain / abs(calibration)]
    proportional, integral = (0.0 if math.isnan(each) else each for each in found)
    known = front.gains
    if known is not None and single(known[0]) == single(proportional) and single(known[2]) == single(integral):
        return list(known)
    return [proportional, proportional / integral if integral else 0.0, integral]


@handles("ZCtrl.CtrlListGet")
def _controllers(front: Front) -> list[Any]:
    regulated = getattr(front.parameters.onboard, "regulate", "deflection")
    return [list(CONTROLLERS.values()), list(CONTROLLERS).index(regulated)]


@handles("ZCtrl.ActiveCtrlSet")
def _choose_controller(front: Front, index: int) -> list[Any]:
    names, active = _controllers(front)
    if not 0 <= index < len(names):
        raise ProtocolError(f"controller {index} is not allowed: it must be 0 to {len(names) - 1}")
    if index != active:
        raise ProtocolError(f"Module not available: this microscope has the controller {names[active]} alone")
    return []


@handles("ZCtrl.Withdraw")
def _withdraw(front: Front, wait: int, timeout: int) -> list[Any]:
    front.jobs.stop()
    rate = max(front.kept("ZCtrl.WithdrawRateGet")[0], _LEAST)

    def prepare() -> Work:
        way = front.z_limits[0] - front.z
        return lambda: front.do("withdraw", distance=max(way, _LEAST), rate=min(rate, 1.0))

    number = front.jobs.start(WITHDRAW, prepare)
    if wait and not front.jobs.wait(number, None if timeout < 0 else 1e-3 * timeout):
        raise ProtocolError(f"the tip is not withdrawn after {timeout} ms; it goes on")
    return []


@handles("ZCtrl.Home")
def _home(front: Front) -> list[Any]:
    _switch(front, 0)
    relative, place = front.kept("ZCtrl.HomePropsGet")

    def prepare() -> Work:
        target = -_bounded(front, front.z + place if relative else place)
        return lambda: front.do("move_z", z=target, rate=_FASTEST)

    front.jobs.finish(front.jobs.start(Z, prepare))
    return []


def limit(front: Front, high: float, low: float) -> None:
    """Set the limits of Z [m], as far as the instrument reaches; a Z that is held beyond them is moved first."""
    if not low < high:
        raise ProtocolError(f"limits of {high:g} m and {low:g} m are not allowed: the first must be the higher one")
    high, low = min(high, front.widest[0]), max(low, front.widest[1])
    if not low < high:
        raise ProtocolError(f"limits must leave some of the range of {front.widest[1]:g} m to {front.widest[0]:g} m")
    if not low <= (z := front.z) <= high and not _on(front):
        target = -min(max(z, low), high)
        front.jobs.finish(front.jobs.start(Z, lambda: lambda: front.do("move_z", z=target, rate=_FASTEST)))
    with front.setting() as microscope:
        microscope.set_z_limits(low=-high, high=-low)
    front.z_limits = (high, low)


@handles("ZCtrl.LimitsEnabledSet")
def _enable_limits(front: Front, on: int) -> list[Any]:
    front.limited = on != 0
    if not on:
        limit(front, *front.widest)
    return []


@handles("ZCtrl.LimitsEnabledGet")
def _limits_enabled(front: Front) -> list[Any]:
    return [int(front.limited)]


@handles("ZCtrl.LimitsSet")
def _set_limits(front: Front, high: float, low: float) -> list[Any]:
    if not front.limited:
        raise ProtocolError("the limits of Z are not enabled")
    limit(front, high, low)
    front.asked_limits = (high, low)
    return []


@handles("ZCtrl.LimitsGet")
def _limits(front: Front) -> list[Any]:
    return list(front.asked_limits if front.limited and front.asked_limits else front.z_limits)


@handles("AutoApproach.OnOffSet")
def _auto_approach(front: Front, on: int) -> list[Any]:
    if not on:
        front.jobs.stop(APPROACH)
    elif not front.state.approached and front.jobs.doing != APPROACH:
        engage(front, by_controller=False)
    return []


@handles("AutoApproach.OnOffGet")
def _approaching(front: Front) -> list[Any]:
    return [int(front.jobs.doing == APPROACH)]
