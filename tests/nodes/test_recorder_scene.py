"""The scene of a run in space: it moves with the signals, the tip is at the sample, and it does not grow."""

import re
from pathlib import Path

import numpy as np
import pytest
from recorded import SCAN, Run, line_message, lines_of, parameters
from viewed import chunks, column, view

from afm_recorder_node import layout, scene
from afm_recorder_node.scene import CANTILEVER, POSES, SAMPLE

PERIOD, HALF, SLOPE = 1e-3, 5e-9, 0.3


def record(path: Path, ticks: int, *, away: int = 0, height: float = 0.0) -> Path:
    """A tip that follows an inclined sample, z being as high as x; for some ticks at the end it is 1 um away."""
    run, phase = Run(ticks, control_period=PERIOD), np.linspace(0.0, 2.0 * np.pi, ticks)
    run.position, run.reference = np.zeros((2, ticks, 3))
    run.position[:, 0] = HALF * np.sin(phase)
    run.position[:, 2] = 1e-9 * np.cos(phase)
    run.deflection = run.position[:, 2] + SLOPE * run.position[:, 0]
    if away > 0:
        run.position[-away:, 2] -= 1e-6
    _, *blocks = run.messages(777)
    known = [parameters("afm_sim_node", {"cantilever.a": height})] if np.isfinite(height) else []
    return view(path, [*known, *blocks, *map(line_message, lines_of() if away < 0 else ())])


def rows(path: Path, entity: str, component: str) -> np.ndarray:
    return np.array([row[0] for row in column(path, entity, component)])


def times(path: Path, entity: str) -> np.ndarray:
    found = [chunk.to_record_batch() for chunk in chunks(path, entity)]
    return np.concatenate([batch.column(layout.TIMELINE).cast("int64").to_numpy() for batch in found])


def words(path: Path) -> str:
    (told,) = rows(path, f"{layout.SCENE}/words", "Points3D:labels")
    return str(told)


@pytest.mark.parametrize("ticks", [500, 20_000])
def test_tip_and_sample_stand_where_the_signals_put_them(tmp_path: Path, ticks: int) -> None:
    path = record(tmp_path / "run.rrd", ticks)
    at = times(path, SAMPLE)
    # However long the run is, and evenly over it.
    assert 0.4 * POSES < len(at) <= POSES and np.ptp(np.diff(at)) == 0
    assert at[-1] > 0.99 * (ticks - 1) * PERIOD * 1e9
    larger = float(re.search(r"deflection x ([\d.]+)", words(path))[1])
    # A tenth to a third of a half width.
    assert larger == 1.0 and "10 nm wide" in words(path)
    phase = 2.0 * np.pi * at / 1e9 / PERIOD / (ticks - 1)
    moved = rows(path, SAMPLE, "Transform3D:translation")
    bent = rows(path, CANTILEVER, "Transform3D:mat3x3").reshape(-1, 3, 3)  # columns
    x, z = HALF * np.sin(phase), 1e-9 * np.cos(phase)
    middle = 0.5 * (x.max() + x.min())
    assert moved[:, 0] == pytest.approx((middle - x) / HALF, abs=2e-3)
    tip = z + SLOPE * x
    up = bent[:, 0, 2] * scene._LENGTH
    assert np.diff(up) == pytest.approx(np.diff(tip) / HALF, abs=2e-4)
    # The tip is as high over the sample as the sample is there.
    over = SLOPE * x / HALF
    assert np.diff(up - moved[:, 2]) == pytest.approx(np.diff(over), abs=2e-4)
    # Nothing else changes in the cantilever.
    bent[:, 0, 2] = 0.0
    assert (bent == np.eye(3)).all()
    vertices = surface(path)
    assert np.polyfit(vertices[:, 0], vertices[:, 2], 1)[0] == pytest.approx(SLOPE, rel=0.02)


def surface(path: Path) -> np.ndarray:
    return np.array(column(path, f"{SAMPLE}/surface", "Mesh3D:vertex_positions")[0])


def test_tip_that_is_away_is_drawn_near_and_spoils_no_scale(tmp_path: Path) -> None:
    near, far = (record(tmp_path / f"{away}.rrd", 3000, away=away) for away in (0, 100))
    assert words(near) == words(far)
    moved = rows(far, SAMPLE, "Transform3D:translation")
    up = rows(far, CANTILEVER, "Transform3D:mat3x3").reshape(-1, 3, 3)[:, 0, 2] * scene._LENGTH
    assert (up - moved[:, 2]).max() == pytest.approx(scene._AWAY, abs=1e-6)


def test_surface_of_a_scan_is_its_image(tmp_path: Path) -> None:
    path = record(tmp_path / "run.rrd", 1000, away=-1)
    vertices = surface(path)
    assert len(vertices) == SCAN.pixels * SCAN.lines
    assert np.abs(vertices[:, :2]).max() == pytest.approx(1.0, abs=0.05)


def test_run_without_a_height_of_the_tip_has_no_scene(tmp_path: Path) -> None:
    path = record(tmp_path / "run.rrd", 1000, height=float("nan"))
    assert not [chunk for chunk in chunks(path) if chunk.entity_path.startswith(layout.SCENE)]
