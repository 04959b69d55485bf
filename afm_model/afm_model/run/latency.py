"""How long a drive takes to arrive, drawn from a seed."""

import math
from collections.abc import Callable
from typing import Annotated, Literal

from annotated_types import Ge, Lt
from pydantic import Field

from ..core.elementary import exp
from ..core.random_numbers import Stream
from ..core.schema import Group, NonNegative, Positive, Unit

_LATENCIES = 3000
"""Stream of the random numbers of latencies."""


class Latency(Group):
    """Wall time from publishing a measurement to the arrival of its drive, drawn anew for each from a seed."""

    kind: Literal["lognormal", "normal"] = Field("lognormal", description="distribution of the latency")
    median: Annotated[Positive, Unit("s")] = Field(2e-4, description="half of the drives arrive within it")
    spread: NonNegative = Field(
        0.3,
        description="lognormal: standard deviation of the logarithm; normal: standard deviation over the median; "
        "0: every latency is the median",
    )
    floor: Annotated[NonNegative, Unit("s")] = Field(0.0, description="no drive arrives sooner")
    loss: Annotated[float, Ge(0.0), Lt(1.0)] = Field(0.0, description="part of the drives that never arrive")
    seed: Annotated[int, Ge(0)] = Field(0, description="of all that is drawn")

    def draw(self) -> Callable[[], float]:
        """A function that draws one latency after the other [s]; infinite: the drive is lost."""
        random = Stream(self.seed, _LATENCIES)

        def draw() -> float:
            # Always both: whether drives are lost changes no latency.
            deviation, lost = float(random.standard_normal(1)[0]), bool(random.random(1)[0] <= self.loss)
            if self.kind == "lognormal":
                latency = self.median * exp(self.spread * deviation)
            else:
                latency = self.median * (1.0 + self.spread * deviation)
            return math.inf if lost else max(latency, self.floor)

        return draw
