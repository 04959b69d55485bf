"""Spring constant of the cantilever, of whatever plant."""

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
