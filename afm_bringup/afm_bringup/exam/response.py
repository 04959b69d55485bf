"""What drives answer to references and measured positions that jump at random, by linear regression. Needs no ROS."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .log import Log, Phase, Sent

_SURE = 5.0
"""Standard errors by which a drive answers a jump."""
_LEAST = 1e-6
"""What is smaller than the largest answer by as much is rounding."""
_LAGS = 8
"""Measurements in which an answer is looked for."""


@dataclass(frozen=True)
class Response:
    """What the drives answer to jumps of one axis."""

    lag: int  # measurements between a jump of its reference and the first answer of its drive; -1: there is none
    steps: NDArray[np.float64]  # of the drives of x, y, z at that lag, when the reference rises; 0: no answer [V]
    feedback: float | None  # step of its drive when its measured position rises [V]; None: no answer


def responses(log: Log, axes: int) -> list[Response] | None:
    """How the drives of the phase STEPS answer to each of the first `axes` axes; None if not every one is there.

    What is measured there does not depend on the drives, so that a loop that rings or diverges is no answer.
    """
    given = {each.sequence: each.drives for each in log.answers if not each.unreadable and each.phase is Phase.STEPS}
    sent = [each for each in log.sent if each.phase is Phase.STEPS]
    found = []
    for axis in range(axes):
        answers = []
        for measured in (False, True):
            moved = [each for each in sent if each.jump.sense and each.jump[::2] == (axis, measured)]
            if len(moved) < 10 * _LAGS or any(each.sequence not in given for each in moved):
                return None
            count = min(len(given[each.sequence]) for each in moved)
            drives = np.array([given[each.sequence][:count] for each in moved])
            if not np.isfinite(drives).all():
                return None
            answers.append(_answers(moved, drives))
        reference, position = answers
        own = np.abs(reference[:, :, axis])
        at = np.flatnonzero(own.any(axis=1))
        lag = int(at[0]) if len(at) else -1
        # The first drives of a packet may have been decided before: the one that counts moves half as much as any.
        drive = int(np.argmax(own[lag] >= 0.5 * own[lag].max())) if len(at) else 0
        fed_back = position[:, drive, axis]
        feedback = float(fed_back[np.argmax(fed_back != 0.0)]) if position[:, :, axis].any() else None
        found.append(Response(lag, reference[max(lag, 0), drive], feedback))
    return found


def _answers(moved: list[Sent], drives: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the steps of the drives (lag, drive of the answer, axis) after a jump up; 0 where no step is sure [V].

    By linear regression of the change of a drive on the last jumps, which are at random.
    """
    jumps, rows = [float(each.jump.sense) for each in moved], range(_LAGS, len(moved))
    table = np.array([[*(jumps[row - lag] for lag in range(_LAGS)), 1.0] for row in rows])
    changes = np.diff(drives.reshape(len(drives), -1), axis=0)[_LAGS - 1 :]
    slopes = np.linalg.lstsq(table, changes, rcond=None)[0]
    spread = np.sqrt(np.sum((changes - table @ slopes) ** 2, axis=0) / (len(rows) - _LAGS - 1))
    errors = np.sqrt(np.diag(np.linalg.inv(table.T @ table)))[:, None] * spread
    steps, errors = slopes[:_LAGS], errors[:_LAGS]
    sizes: NDArray[np.float64] = np.abs(steps)
    sure = (sizes > _SURE * errors) & (sizes > _LEAST * sizes.max())
    return np.where(sure, steps, 0.0).reshape(_LAGS, *drives.shape[1:])
