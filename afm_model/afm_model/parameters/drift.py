"""Thermal drift of the sample against the tip."""

from typing import Annotated

from pydantic import Field

from ..core.schema import Group, NonNegative, Positive, Unit

_Rate = Annotated[float, Unit("m/s")]


class Drift(Group):
    """Thermal drift of the sample against the holder of the tip, which no position sensor sees. Off by default."""

    rate_x: _Rate = Field(0.0, description="velocity of the sample along x at the start")
    rate_y: _Rate = Field(0.0, description="velocity of the sample along y at the start")
    rate_z: _Rate = Field(0.0, description="velocity of the sample along z at the start, positive towards the tip")
    decay_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="these velocities fall by exp(-t / decay_time), as after warming up; 0: they stay"
    )
    wander: Annotated[NonNegative, Unit("m/s")] = Field(
        0.0, description="rms of a random part of the velocity, along each axis by itself"
    )
    wander_time: Annotated[Positive, Unit("s")] = Field(60.0, description="correlation time of the random part")

    @property
    def on(self) -> bool:
        """Whether anything drifts."""
        return any((self.rate_x, self.rate_y, self.rate_z, self.wander))

    def warnings(self) -> list[str]:
        """What is implausible, a sentence each."""
        given = {name: getattr(self, name) for name in ("rate_x", "rate_y", "rate_z", "wander")}
        return [
            f"drift.{name} = {value:g} m/s is implausible: microscopes drift by 1e-12 to 1e-9 m/s"
            for name, value in given.items()
            if abs(value) > 1e-8
        ]
