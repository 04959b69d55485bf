"""What is kept with a scan of the microscope that made it: in words, with units."""

from typing import Any

from ..core.prefix import text


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
    plant, loop, detector = parameters.plant, parameters.onboard, parameters.detector
    scanner = f", scanner {plant.scanner}" if hasattr(plant, "scanner") else ""
    words = {"Microscope": f"virtual atomic force microscope, plant {plant.kind}{scanner}"}
    numbers = plant.cantilever_numbers
    if numbers is not None:
        words["Cantilever"] = (
            f"{plant.lever}, k = {numbers.k:.6g} N/m, f0 = {text(numbers.f0, 'Hz')}, tip radius "
            f"{text(numbers.tip_radius, 'm')}"
        )
    words["Cantilever axis"] = "y; the lateral force is that along x of the scanner"
    if getattr(loop, "setpoint_force", 0.0):
        words["Setpoint"] = text(loop.setpoint_force, "N", 6)
    elif getattr(loop, "setpoint_voltage", 0.0):
        words["Setpoint"] = text(loop.setpoint_voltage, "V", 6)
    else:
        words["Setpoint"] = f"deflection of {text(parameters.reference.z_r, 'm', 6)}"
    if hasattr(loop, "integral_gain"):
        words["Gains"] = f"P = {loop.proportional_gain:.6g} m/V, I = {loop.integral_gain:.6g} m/(V s)"
    words["Deflection sensitivity"] = f"{detector.deflection_sensitivity:.6g} m/V"
    words["Lateral sensitivity"] = f"{detector.lateral_sensitivity:.6g} N/V"
    words["Sample"] = parameters.sample.kind
    return words
