"""Whether drives answer references that jump at random, by linear regression. Needs no ROS."""

import numpy as np

from .log import Log, Phase

_SURE = 5.0
"""Standard errors by which a drive answers a reference."""
_LAGS = 3
"""Measurements in which an answer is looked for."""


def lags(log: Log, axes: int) -> list[tuple[int, list[int]]] | None:
    """How the drives of the phase STEPS answer: of each axis that is moved the measurements between its jump and the
    first answer to it, -1 if there is none, and the sense of that answer in x, y and z.

    By linear regression of the change of a drive on the last jumps, which are at random.
    """
    given = {each.sequence: each.drives[0] for each in log.answers if not each.unreadable and each.phase is Phase.STEPS}
    sent = [each for each in log.sent if each.phase is Phase.STEPS]
    if not sent or any(each.sequence not in given for each in sent):
        return None
    found = []
    for axis in range(axes):
        moved = [each for each in sent if each.jump[0] == axis]
        drives = np.array([given[each.sequence] for each in moved])
        if len(moved) < 10 * _LAGS or not np.isfinite(drives).all():
            return None
        jumps, rows = [float(each.jump[1]) for each in moved], range(_LAGS, len(moved))
        table = np.array([[*(jumps[row - lag] for lag in range(_LAGS)), 1.0] for row in rows])
        changes = np.diff(drives, axis=0)[_LAGS - 1 :]
        slopes = np.linalg.lstsq(table, changes, rcond=None)[0]
        spread = np.sqrt(np.sum((changes - table @ slopes) ** 2, axis=0) / (len(rows) - _LAGS - 1))
        errors = np.sqrt(np.diag(np.linalg.inv(table.T @ table)))[:, None] * spread
        senses = np.where(np.abs(slopes) > _SURE * errors, np.sign(slopes), 0.0)[:_LAGS]
        answered = np.flatnonzero(senses[:, axis])
        lag = int(answered[0]) if len(answered) else -1
        found.append((lag, senses[max(lag, 0)].astype(int).tolist()))
    return found
