"""The verb CalibrateSensitivity."""

from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from ...analysis import deflection_sensitivity
from ...analysis.estimate import mean
from ...core.elementary import cbrt, square
from ...core.errors import VerbError
from ...core.schema import Positive, Unit
from ..execution import Execution, Task
from ..quantities import Count, Length, Speed
from ..results import Calibration, MicroscopeState
from ..verb import Verb, too_fast
from ..view import InstrumentView
from .force_curve import Curve, ForceCurve, Measured

_SOFTEST = 10e9
"""Least reduced modulus of a sample that calibrates [Pa], somewhat below that of silicon on graphite."""
_PRESSED = 0.6
"""Part of the largest force at which slopes are taken, on average."""
_MOST_COMPRESSION = 0.5


class CalibrateSensitivity(Verb):
    """Force curves on a stiff sample, and from their slopes the sensitivity of the deflection [m/V]."""

    returns: ClassVar = Calibration
    on_sample: ClassVar = True
    presses: ClassVar = True

    count: Count = Field(3, description="force curves")
    ramp: Length = Field(400e-9, description="way of an approach at most")
    lift: Length = Field(200e-9, description="z is first withdrawn by this from where it stands")
    rate: Speed = Field(1e-6, description="velocity of z")
    trigger_voltage: Annotated[Positive, Unit("V")] = Field(2.0, description="rise of the deflection at the turn")

    def _curves(self) -> ForceCurve:
        return ForceCurve(
            lift=self.lift,
            ramp=self.ramp,
            approach_rate=self.rate,
            retract_rate=self.rate,
            trigger_voltage=self.trigger_voltage,
            count=self.count,
        )

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        yield from too_fast("rate", self.rate, self.trigger_voltage, self.ramp, view)
        yield from self._curves().refusals(view, state)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`. Curves that nothing comes out of are a failure: the tip is withdrawn."""
        curves, measured = self._curves(), Measured()

        def result() -> Calibration | None:
            run.remark = run.of_lift
            return _found(curves.curves(run.view, measured), run.view)

        run.result = result
        yield from curves.measuring(run, measured)
        if run.result() is None:
            raise VerbError(
                f"no sensitivity comes out of the curves: in none of them the deflection rose by trigger_voltage = "
                f"{self.trigger_voltage:g} V within ramp = {self.ramp:g} m"
            )


def _compression(volts: float, view: InstrumentView) -> float:
    """Return the largest share of z by which the contact may be compressed while the voltage rises by `volts`.

    The stiffness of a contact of Hertz is (6 R E*^2 F)^(1/3): K. L. Johnson, Contact Mechanics (1985), section 4.2.
    """
    k = view.vertical_stiffness
    force = _PRESSED * k * view.vertical_sensitivity * volts
    contact = cbrt(6.0 * view.tip_radius * square(_SOFTEST) * force)
    return min(k / contact, _MOST_COMPRESSION) if contact > 0.0 else _MOST_COMPRESSION


def _found(curves: Sequence[Curve], view: InstrumentView) -> Calibration | None:
    """The sensitivity for vertical motion of the tip [m/V]; None without a whole curve."""
    records = [curve.record.channels for curve in curves if curve.triggered]
    if not records:
        return None
    try:
        each = [
            deflection_sensitivity(z, volts, compression=_compression(float(np.ptp(volts)), view))
            for z, volts in ((read["z"], read["deflection_voltage"]) for read in records)
        ]
    except ValueError as error:
        raise VerbError(f"no sensitivity comes out of the curves: {error}") from None
    values = [one.value for one in each]
    # What friction and compression do to a curve is the same in all of them, and does not become less by more of them.
    common, scatter = float(np.mean([one.uncertainty for one in each])), mean(values).uncertainty
    uncertainty = common if len(values) == 1 else max(common, scatter)
    return Calibration(float(np.mean(values)), uncertainty, "m/V", {"curves": len(values)})
