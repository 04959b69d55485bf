"""Four-quadrant photodiode: deflection and lateral force as voltages, with white noise and an ADC."""

from typing import Annotated, Any

from annotated_types import Ge, Lt
from pydantic import Field

from ..converter import convert
from ..jit import kernel
from ..parts.groups import DetectorParameters
from ..parts.part import Detector, Numbers, Tree
from ..records import record
from ..schema import NonNegative, Positive, Unit


class Photodiode(DetectorParameters):
    """Photodetector and position sensors. Noise and resolution are off by default."""

    noise: Annotated[NonNegative, Unit("V")] = Field(
        0.0, description="rms white noise of a photodetector sample; the deflection rate has none"
    )
    adc_bits: Annotated[int, Ge(0), Lt(33)] = Field(0, description="resolution over +-adc_limit; 0: continuous")
    adc_limit: Annotated[Positive, Unit("V")] = Field(
        10.0, description="with adc_bits > 0 the ADC saturates at +-adc_limit"
    )


CONSTANTS = record("a", "deflection_sensitivity", "lateral_sensitivity", "noise", "adc_lsb", "adc_limit")


def _values(parameters: Tree) -> Numbers:
    detector = parameters.detector
    adc_on = detector.adc_bits > 0
    return {
        "a": parameters.cantilever.a,
        "deflection_sensitivity": detector.deflection_sensitivity,
        "lateral_sensitivity": detector.lateral_sensitivity,
        "noise": detector.noise,
        "adc_lsb": 2.0 * detector.adc_limit / 2**detector.adc_bits if adc_on else 0.0,
        "adc_limit": detector.adc_limit if adc_on else 0.0,
    }


@kernel
def detect(o: Any, d: Any, p: Any, s: Any, r: Any) -> None:
    """See `afm_model.parts.Detector`."""
    deflection = (o.tip_height - p.a + o.deflection_excess) / p.deflection_sensitivity + p.noise * r[0]
    lateral = (o.friction[0] + o.lateral_excess) / p.lateral_sensitivity + p.noise * r[1]
    d.deflection_voltage = convert(deflection, p.adc_lsb, p.adc_limit)
    d.lateral_voltage = convert(lateral, p.adc_lsb, p.adc_limit)


PHOTODIODE = Detector(name="photodiode", parameters=Photodiode, constants=CONSTANTS, values=_values, detect=detect)
