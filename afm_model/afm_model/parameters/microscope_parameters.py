"""The microscope, said once for all nodes: parameters `microscope.*`, in the section `/**` of a scenario.

Simulator and controller each make of them what they need: the simulator its plant `lever`, piezo, detector and
setpoint; the controller what a law may know of the microscope. The two cannot disagree then.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, create_model, model_validator

from ..core.elementary import square
from ..core.errors import ParameterError
from ..core.schema import Group, Unit, Value, build, chosen_group, refuse_together
from ..detector import Photodiode
from ..law.sampled import SampledLaw
from ..piezo import PiezoParameters
from ..plant.lever.parameters import LeverGroup
from .instrument_parameters import ControllerParameters, InstrumentParameters

PREFIX = "microscope."
_RUN = ("kind", "seed", "dt", "modes", "gap")
"""Parameters of the plant that are not of the microscope but of the run."""
_OF_PLANT = {name: f"plant.{name}" for name in LeverGroup.model_fields if name not in _RUN}
_OF_PIEZO = {f"sensitivity_{axis}": f"piezo.sensitivity_{axis}" for axis in "xyz"} | {"drive_limit": "piezo.limit"}
_OF_DETECTOR = {name: f"detector.{name}" for name in ("deflection_sensitivity", "lateral_sensitivity")}
_OF_SIMULATOR = _OF_PLANT | _OF_PIEZO | _OF_DETECTOR
"""Names without the prefix, and what each is for the simulator."""


class _Setpoint(Group):
    setpoint_force: Annotated[float, Unit("N")] = Field(
        0.0, description="vertical force at the setpoint of the deflection, and at the start; 0: not given"
    )
    setpoint_voltage: Annotated[float, Unit("V")] = Field(0.0, description="the same as voltage of the detector")

    @model_validator(mode="after")
    def _one(self) -> "_Setpoint":
        refuse_together(self, "microscope.", "setpoint_force", "setpoint_voltage")
        return self


def _fields() -> dict[str, Any]:
    groups: dict[str, type[Group]] = {"plant": LeverGroup, "piezo": PiezoParameters, "detector": Photodiode}
    fields: dict[str, Any] = {}
    for name, target in _OF_SIMULATOR.items():
        group, leaf = target.split(".")
        field = groups[group].model_fields[leaf]
        fields[name] = (field.annotation, field)
    return fields


Setup: type[_Setpoint] = create_model("Setup", __base__=_Setpoint, __module__=__name__, **_fields())
"""What can be said: cantilever, scanner, materials and timing of the plant `lever`, sensitivities, setpoint."""


class SetupSection(Group):
    """The section `/**`."""

    microscope: Setup = Setup()


def resolved(model: type[Group], values: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of one node with what `microscope.*` comes to in their place.

    Parameters
    ----------
    model : type[Group]
        Of the node: made from InstrumentParameters, from ControllerParameters, or any other, which has no use for
        them.
    values : mapping
        By dotted names, as given.

    Raises
    ------
    ParameterError
        If a name of `microscope` does not exist or a value is not allowed, or the simulator is given the same twice.
        What a controller is given itself counts: it may be configured otherwise on purpose.
    """
    own = {name: value for name, value in values.items() if not name.startswith(PREFIX)}
    given = {name.removeprefix(PREFIX): value for name, value in values.items() if name.startswith(PREFIX)}
    if not given:
        return own
    setup: _Setpoint = build(SetupSection, {PREFIX + name: value for name, value in given.items()}).microscope
    if issubclass(model, InstrumentParameters):
        return own | _of_simulator(setup, given, own)
    if issubclass(model, ControllerParameters):
        return known_of(_lever(setup), {target: getattr(setup, name) for name, target in _OF_PIEZO.items()}, own) | own
    return own


def _of_simulator(setup: _Setpoint, given: Mapping[str, Value], own: Mapping[str, Value]) -> dict[str, Value]:
    kind = own.get("plant.kind", "lever")
    if not issubclass(chosen_group(InstrumentParameters, "plant", {"plant.kind": kind}), LeverGroup):
        raise ParameterError(
            f"plant.kind = {kind} is not allowed with microscope.*, which is a microscope with plant.kind = lever or "
            f"averaged"
        )
    news: dict[str, Value] = {"plant.kind": kind}
    news |= {_OF_SIMULATOR[name]: value for name, value in given.items() if name in _OF_SIMULATOR}
    force, voltage = setup.setpoint_force, setup.setpoint_voltage
    if force or voltage:
        has_loop = own.get("onboard.kind", "none") != "none"
        if has_loop:
            news |= {"onboard.setpoint_force": force} if force else {"onboard.setpoint_voltage": voltage}
        # With a loop inside the start may be elsewhere.
        if not (has_loop and "reference.z_r" in own):
            # As the cantilever is, whatever is believed of it.
            by_force = _lever(setup).deflection_under(InstrumentParameters(), force)
            news["reference.z_r"] = by_force or voltage * setup.model_dump()["deflection_sensitivity"]
    for name in news.keys() & own.keys() - {"plant.kind"}:
        raise ParameterError(f"{name} is given twice: by itself, and by microscope.*, which says it for all nodes")
    return news


def known_of(lever: LeverGroup, piezo: Mapping[str, Value], own: Mapping[str, Value]) -> dict[str, Value]:
    """What a law may know of the microscope, in the words of the controller's parameters.

    Parameters
    ----------
    lever : LeverGroup
    piezo : mapping
        Sensitivities and range by the names of the controller's parameters.
    own : mapping
        What the controller is given itself.
    """
    c, s, pair = lever.cantilever_numbers, lever.scanner_numbers, lever.pair_numbers
    mass = c.k / square(2.0 * math.pi * c.f0)
    news: dict[str, Value] = {"cantilever.f_c": c.f0, "cantilever.xi_c": 0.5 / c.Q, "cantilever.m_c": mass}
    news["scanner.mass_ratio"] = s.k_x / square(2.0 * math.pi * s.f_x) / mass
    for axis in "xyz":
        news |= {f"scanner.f_{axis}": getattr(s, f"f_{axis}"), f"scanner.xi_{axis}": 0.5 / s.Q}
    news |= piezo
    news |= {
        "contact.K": pair.K,
        "contact.tau": pair.tau,
        "contact.work_of_adhesion": pair.work_of_adhesion,
        "contact.R": c.tip_radius,
    }
    if issubclass(chosen_group(ControllerParameters, "law", own), SampledLaw):
        news |= {"law.period": lever.control_period, "law.delay_ticks": lever.delay_ticks}
    return news


def _lever(setup: _Setpoint) -> LeverGroup:
    return LeverGroup(**{name: getattr(setup, name) for name in _OF_PLANT})
