"""Spring constant of the cantilever, of whatever plant, and what a force comes to at the detector."""

import math

from .part import Tree


def spring_constant(parameters: Tree) -> float:
    """Of the cantilever [N/m]; 0 if the plant tells none.

    Parameters
    ----------
    parameters : InstrumentParameters
    """
    plant = parameters.plant
    if hasattr(plant, "cantilever_numbers"):
        return float(plant.cantilever_numbers.k)
    if plant.kind in ("compliant", "paper"):
        return float(parameters.cantilever.m_c * (2.0 * math.pi * parameters.cantilever.f_c) ** 2)
    return 0.0


def deflection_voltage(parameters: Tree, force: float) -> float:
    """Deflection at a force of the cantilever [V].

    Raises
    ------
    ValueError
        If the plant tells no spring constant.
    """
    k = spring_constant(parameters)
    if k == 0.0:
        raise ValueError(f"plant.kind = {parameters.plant.kind} tells no spring constant: give a voltage, not a force")
    return float(force / k / parameters.detector.deflection_sensitivity)
