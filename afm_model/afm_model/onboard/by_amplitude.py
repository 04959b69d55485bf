"""A z loop that regulates an amplitude: its setpoint, refusals, warnings; docs/dynamic.md."""

import math

from ..parts.part import Tree
from .pi import PI

SHARE = 0.8
"""Setpoint over the free amplitude, where nothing else is given."""


def taps(parameters: Tree) -> bool:
    """Whether the z loop inside the instrument regulates an amplitude."""
    return bool(getattr(parameters.onboard, "regulate", "") == "amplitude")


def setpoint(parameters: Tree) -> float:
    """Of what the z loop of `dynamic` regulates [V]; 0: of an amplitude, and no free one is known."""
    part = parameters.onboard
    if not taps(parameters):
        assert PI.setpoint is not None
        return PI.setpoint(parameters)
    metres = part.setpoint_amplitude or (part.setpoint_share or SHARE) * part.free_amplitude
    return float(metres / parameters.detector.deflection_sensitivity)


def own_lag(parameters: Tree) -> float:
    """Time in which the amplitude of the free cantilever decays [s]."""
    cantilever = parameters.plant.cantilever_numbers
    return 0.0 if cantilever is None else float(cantilever.Q / (math.pi * cantilever.f0))


def lag(parameters: Tree) -> float:
    """Time by which the amplitude follows the distance late, of cantilever and lock-in [s]."""
    return own_lag(parameters) + parameters.onboard.filter_order * parameters.onboard.time_constant


def check(parameters: Tree) -> None:
    """Raise ValueError with what cannot be."""
    part, metres = parameters.onboard, parameters.detector.deflection_sensitivity
    if part.harmonic != 1:
        raise ValueError(f"onboard.harmonic = {part.harmonic} is not allowed with onboard.regulate = amplitude: take 1")
    if part.lock_in != "deflection":
        raise ValueError(
            f"onboard.lock_in = {part.lock_in} is not allowed with onboard.regulate = amplitude: take deflection"
        )
    if part.free_amplitude and part.setpoint_amplitude >= part.free_amplitude:
        raise ValueError(
            f"onboard.setpoint_amplitude = {part.setpoint_amplitude:g} m is not allowed: it must be < the free "
            f"amplitude, {part.free_amplitude:.4g} m (onboard.free_amplitude)"
        )
    largest = max(part.setpoint_amplitude, part.free_amplitude)
    if largest >= (most := getattr(parameters.detector, "most_voltage", math.inf) * metres):
        raise ValueError(
            f"an amplitude of {largest:.4g} m is not allowed: the photodiode reads +-{most:.4g} m (detector.range)"
        )
    if timeout := getattr(getattr(parameters, "safety", None), "contact_timeout", 0.0):
        raise ValueError(
            f"safety.contact_timeout = {timeout:g} s is not allowed with onboard.regulate = amplitude: a tip that taps "
            f"is out of contact most of the time; take 0"
        )


def warnings(parameters: Tree) -> list[str]:
    """A gain with which the loop oscillates: an amplitude that follows z one to one, a quarter of a turn late."""
    part, own = parameters.onboard, own_lag(parameters)
    if own == 0.0:
        return []

    def late(w: float) -> complex:
        return complex((1.0 + 1j * w * own) * math.prod([1.0 + 1j * w * part.time_constant] * part.filter_order))

    w = 0.5 * math.pi / lag(parameters)
    while late(w).real > 0.0:
        w *= 1.01
    most = parameters.detector.deflection_sensitivity * w * late(w).imag
    if part.integral_gain < most:
        return []
    return [
        f"onboard.integral_gain = {part.integral_gain:g} m/(V s) makes the z loop oscillate: the amplitude follows z "
        f"late by {own:.2g} s (cantilever) and {part.filter_order} times {part.time_constant:.2g} s (lock-in); take "
        f"less than {most:.2g} m/(V s)"
    ]
