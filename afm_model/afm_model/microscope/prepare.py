"""Parameters of an instrument that verbs can be ordered of."""

from typing import TypeVar

from ..core import registry
from ..core.errors import ParameterError
from ..core.schema import Value
from ..parameters import InstrumentParameters, changed
from .view import ERROR_CHANNEL, Z_CHANNEL

P = TypeVar("P", bound=InstrumentParameters)
_LOCK_IN = ("in_phase", "quadrature", "amplitude", "phase")
_LOOPS = ("frequency_shift", "drive_amplitude")
CHANNELS = (Z_CHANNEL, ERROR_CHANNEL, "verb_number", "verb_step", *_LOCK_IN, *_LOOPS)
"""Sampled for the verbs, besides those of every run."""
GAP = 500e-9
"""How far the tip is off the sample at the start where the parameters do not say it [m]."""
RANGE = 500e-9
"""Deflection up to which the photodiode reads where the parameters do not say it [m]: +-10 V at 50 nm/V."""


def with_verbs(parameters: P) -> P:
    """The same with what verbs need: program `verbs`, a z loop, the tip off the sample at the start, channels, a
    range of the photodiode.

    What is given already stays. Called for every run whose `reference.kind` is verbs, over topics too.

    Raises
    ------
    ParameterError
        If the plant cannot leave the sample.
    """
    plant = parameters.plant
    if plant.kind == "paper" or not hasattr(plant, "gap"):
        raise ParameterError(
            f"plant.kind = {plant.kind} is not allowed with verbs: its tip cannot leave the sample; take plant.kind = "
            f"lever or compliant"
        )
    news: dict[str, Value] = {"reference.kind": "verbs"}
    if plant.gap == 0.0:
        news["plant.gap"] = GAP
    if parameters.onboard.kind == "none":
        news["onboard.kind"] = "pi"
    kind = str(news.get("onboard.kind", parameters.onboard.kind))
    known = {channel.name for channel in registry.find("onboard", kind).channels}
    if Z_CHANNEL not in known:
        raise ParameterError(
            f"onboard.kind = {kind} is not allowed with verbs: it has no channel {Z_CHANNEL}, by which a loop shows "
            f"where it has moved z"
        )
    if getattr(parameters.detector, "range", None) == 0.0:
        news["detector.range"] = RANGE / parameters.detector.deflection_sensitivity
    given = [name.strip() for name in parameters.detector.channels.split(",") if name.strip()]
    wanted = [name for name in CHANNELS if name in known or name.startswith("verb")]
    news["detector.channels"] = ", ".join(dict.fromkeys([*given, *wanted]))
    return changed(parameters, news)
