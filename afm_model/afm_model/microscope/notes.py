"""What is kept with a scan of the microscope that made it: in words, with units."""

from typing import Any

from ..core.prefix import text
from .view import CALIBRATIONS, sensitivities, z_loop


def notes(parameters: Any) -> dict[str, str]:
    """Names and texts of what a later reader of a scan needs to know of the microscope.

    Parameters
    ----------
    parameters : InstrumentParameters
        As they are when the scan begins.

    Returns
    -------
    dict of str to str
        What the microscope does not have is left out.
    """
    plant, loop = parameters.plant, z_loop(parameters)
    scanner = f", scanner {plant.scanner}" if hasattr(plant, "scanner") else ""
    words = {"Microscope": f"virtual atomic force microscope, plant {plant.kind}{scanner}"}
    numbers = plant.cantilever_numbers
    if numbers is not None:
        k = plant.spring_constant(parameters)
        own = ", ".join(name for name in numbers._fields if getattr(plant, name))
        words["Cantilever"] = (
            f"{plant.lever}{' but for ' if own else ''}{own}, k = {k:.6g} N/m, f0 = {text(numbers.f0, 'Hz')}, "
            f"tip radius {text(numbers.tip_radius, 'm')}"
        )
    words["Cantilever axis"] = "y; the lateral force is that along x of the scanner"
    force, voltage = (loop.setting(parameters, f"setpoint_{name}", 0.0) for name in ("force", "voltage"))
    if force or voltage:
        words["Setpoint"] = text(force or voltage, "N" if force else "V", 6)
    else:
        words["Setpoint"] = f"deflection of {text(parameters.reference.z_r, 'm', 6)}"
    gains = {"P": ("proportional_gain", "m/V"), "I": ("integral_gain", "m/(V s)")}
    if told := [
        f"{letter} = {loop.setting(parameters, name):.6g} {unit}"
        for letter, (name, unit) in gains.items()
        if name in loop.settings
    ]:
        words["Gains"] = ", ".join(told)
    deflection, lateral = sensitivities(parameters)
    words["Deflection sensitivity"] = f"{deflection:.6g} m/V"
    words["Lateral sensitivity"] = f"{lateral:.6g} N/V"
    if used := [name.replace("_", " ") for name in CALIBRATIONS if getattr(parameters.calibration, name)]:
        words["Calibrated"] = ", ".join(used)
    words["Sample"] = parameters.sample.kind
    return words
