"""What the instrument knows of itself beside what its sensors tell, and z out of the hands of a loop inside."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.records import place
from ..parameters import InstrumentParameters
from ..parts.signals import TRUTH
from .block import Layout

_X, _NORMAL_FORCE, _CONTACT = (place(TRUTH, name) for name in ("position", "normal_force", "contact"))


class Inside:
    """Looks at the block of an instrument, as its own limits do; its values follow every tick.

    Parameters
    ----------
    layout : Layout
    block : ndarray
    parameters : InstrumentParameters
    """

    def __init__(self, layout: Layout, block: NDArray[np.float64], parameters: InstrumentParameters) -> None:
        self._layout, self._block, self._parameters = layout, block, parameters
        self._truth = layout.array(block, "truth")
        self._regulated = layout.array(block, "regulated")
        self._onboard: Any = layout.parts["onboard"].part

    @property
    def scanner_position(self) -> tuple[float, float]:
        """Where the scanner truly is along x and y [m]."""
        return self._truth.item(_X), self._truth.item(_X + 1)

    @property
    def normal_force(self) -> float:
        """Normal force of the tip on the sample [N]."""
        return self._truth.item(_NORMAL_FORCE)

    @property
    def in_contact(self) -> bool:
        """Whether the tip touches the sample."""
        return self._truth.item(_CONTACT) != 0.0

    @property
    def z_drive(self) -> float:
        """Drive along z that the piezo has now [V]: that of a loop inside the instrument, where there is one."""
        return float(self._regulated[2])

    @property
    def has_z_loop(self) -> bool:
        """Whether a loop inside the instrument drives z, whatever is asked along z."""
        return self._onboard.take is not None

    def take_z(self, volts: float) -> None:
        """Have a loop inside the instrument hold z at this drive [V]; without one the drive of the tick does."""
        if self._onboard.take is not None:
            self._onboard.take(self._record("constants"), self._record("state"), volts)

    def give_z(self) -> None:
        """Give z back to the loop inside the instrument: it goes on from where it is."""
        if self._onboard.release is not None:
            self._onboard.release(self._parameters, self._record("constants"))

    def _record(self, which: str) -> Any:
        return self._layout.record(self._block, f"onboard_{which}")
