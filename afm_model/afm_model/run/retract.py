"""The way of the sample away from the tip, while the controller is silent."""

from ..parameters import SimParameters


class Retract:
    """Moves the z drive by the same step at each tick, from where it stands to `run.retract_distance` below rest."""

    def __init__(self) -> None:
        self._from = 0.0

    def begin(self, drive_z: float) -> None:
        """Retract from this drive [V] on."""
        self._from = drive_z

    def next(self, drive_z: float, parameters: SimParameters) -> float:
        """The z drive [V] after `drive_z`."""
        run = parameters.run
        down = -run.retract_distance / parameters.piezo.sensitivity_z
        rate = (down - self._from) / run.retract_time
        moved = drive_z + rate * parameters.plant.control_period
        return max(moved, down) if rate < 0.0 else min(moved, down)
