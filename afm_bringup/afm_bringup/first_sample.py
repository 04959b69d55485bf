"""The sample of a first image: a letter one step high, and a corner of another material across it.

Letter and corner look different in every direction, so that an image shows whether rows, columns and signs are right.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

_Array = NDArray[np.float64]

WIDTH = 1.2e-6
"""Edge of the sample, whose middle is at x = y = 0 [m]."""
STEP = 10e-9
"""Height of the letter [m]."""
STRENGTH = 0.5
"""Friction of the second material over that of the first."""
_CELLS = 480
_EDGE, _BORDER = 10e-9, 5e-9
"""Standard deviations of the filters that round the edges of the letter and the border of the materials [m]."""
_BARS = ((-300e-9, -180e-9, -350e-9, 350e-9), (-180e-9, 300e-9, 230e-9, 350e-9), (-180e-9, 120e-9, -60e-9, 60e-9))
"""The letter F: left, right, bottom, top of its bars [m]."""


def letter(x: _Array, y: _Array) -> NDArray[np.bool_]:
    """Whether places [m] are inside the letter."""
    bars = [(left <= x) & (x <= right) & (low <= y) & (y <= high) for left, right, low, high in _BARS]
    return np.logical_or.reduce(bars)


def second_material(x: _Array, y: _Array) -> NDArray[np.bool_]:
    """Whether places [m] are of the second material: below a line that rises to the right."""
    return np.asarray(x - y > 50e-9)


def write_sample(folder: Path) -> dict[str, object]:
    """Write the maps of the sample.

    Parameters
    ----------
    folder : Path
        Made if it is not there.

    Returns
    -------
    dict
        Parameters `sample.*` of the simulator.
    """
    along = (np.arange(_CELLS) + 0.5) / _CELLS * WIDTH - 0.5 * WIDTH
    # The last row of a map is at the largest y.
    x, y = np.meshgrid(along, along)
    cell = WIDTH / _CELLS
    height = STEP * gaussian_filter(letter(x, y).astype(float), _EDGE / cell)
    strength = np.where(second_material(x, y), STRENGTH, 1.0)
    folder.mkdir(parents=True, exist_ok=True)
    files = {"file": "height.npy", "strength_file": "strength.npy"}
    np.save(folder / files["file"], height)
    np.save(folder / files["strength_file"], gaussian_filter(strength, _BORDER / cell))
    paths = {name: str((folder / file).absolute()) for name, file in files.items()}
    return {"kind": "map", "width": WIDTH, **paths}
