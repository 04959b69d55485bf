"""Claims about force curves as files: what afmformats reads from them."""

import afmformats
import h5py
import numpy as np
import pytest

from afm_model.files import write_curve_tab, write_curves

from . import scans

KEYS = {
    "imaging mode": "force-distance",
    "feedback mode": "contact",
    "sensitivity": 1e-7,
    "spring constant": 0.2,
    "setpoint": 8e-9,
    "speed approach": 2.5e-6,
    "speed retract": 2.5e-6,
    "rate approach": 5e4,
    "rate retract": 5e4,
    "duration approach": 2001 / 5e4,
    "duration retract": 2001 / 5e4,
    "z range": 1e-7,
    "point count": 4002,
    "position x": 3e-9,
    "position y": -2e-9,
    "software": "afm_model",
    "segment count": 2,
}


@pytest.mark.parametrize("suffix", ["h5", "tab"])
def test_afmformats_reads_force_height_time_and_segments_with_its_keys(tmp_path, suffix):
    curve = scans.curve(3e-9, -2e-9)
    path = (write_curves if suffix == "h5" else write_curve_tab)(tmp_path / f"curve.{suffix}", curve)
    (read,) = afmformats.load_data(path)
    assert read.modality == "force-distance"
    for key, wanted in KEYS.items():
        assert read.metadata[key] == (pytest.approx(wanted, rel=1e-9) if isinstance(wanted, float) else wanted), key
    # The dwell belongs to neither segment.
    z, force = curve.record.channels["z"], curve.record.channels["deflection_voltage"] * 1e-7 * 0.2
    exact = {"rtol": 0.0 if suffix == "h5" else 1e-8, "atol": 0.0}
    for segment, part in ((read.appr, slice(0, 2001)), (read.retr, slice(2101, None))):
        np.testing.assert_allclose(segment["force"], force[part], **exact)
        np.testing.assert_allclose(segment["height (piezo)"], -z[part], **exact)
        np.testing.assert_allclose(segment["time"], curve.record.time[part] - 12.5, rtol=1e-8)
    # On a hard sample the tip stands still while the cantilever is pressed on.
    tip = read.appr["tip position"]
    assert np.ptp(tip[-700:]) < 1e-15
    assert read.appr["height (piezo)"][0] > read.appr["height (piezo)"][-1]


def test_curves_on_a_grid_are_a_map_to_afmformats(tmp_path):
    places = [(x, y) for y in (0.0, 20e-9) for x in (-10e-9, 0.0, 10e-9)]
    path = write_curves(tmp_path / "map.h5", [scans.curve(x, y, dwell=0) for x, y in places])
    read = afmformats.load_data(path)
    assert [each.metadata["enum"] for each in read] == list(range(6))
    group = afmformats.AFMGroup(path)
    qmap = afmformats.AFMQMap(group)
    assert qmap.shape == (3, 2)
    for curve, (x, y) in zip(sorted(read, key=lambda each: each.enum), places, strict=True):
        meta = curve.metadata
        assert (meta["grid index x"], meta["grid index y"]) == (round(x / 10e-9) + 1, round(y / 20e-9))


def test_groups_are_listed_in_the_order_of_the_curves_beyond_ten(tmp_path):
    path = write_curves(tmp_path / "many.h5", [scans.curve(1e-9 * i, 0.0, dwell=0) for i in range(12)])
    with h5py.File(path) as file:
        assert list(file) == [str(i) for i in range(12)]
    assert [each.metadata["position x"] for each in afmformats.load_data(path)] == pytest.approx(1e-9 * np.arange(12))


def test_every_feature_of_a_map_of_afmformats_is_computed(tmp_path):
    # Reading the base point needs `height (measured)`; nanite takes over these features.
    places = [(x, y) for y in (0.0, 20e-9) for x in (-10e-9, 0.0, 10e-9, 20e-9, 30e-9, 40e-9)]
    curves = [scans.curve(x, y, dwell=0) for x, y in places]
    qmap = afmformats.AFMQMap(write_curves(tmp_path / "map.h5", curves))
    maps = {feature: qmap.get_qmap(feature, qmap_only=True) for feature in qmap.features}
    lowest = -max(curves[0].record.channels["z"])
    np.testing.assert_allclose(maps["data: height base point"], np.full((2, 6), 1e6 * lowest), rtol=1e-12)
    np.testing.assert_array_equal(maps["data: scan order"], np.arange(12).reshape(2, 6))


def test_curves_that_are_on_no_full_grid_are_no_map(tmp_path):
    path = write_curves(tmp_path / "line.h5", [scans.curve(x, x) for x in (0.0, 1e-8, 2e-8, 3e-8)])
    assert all("grid shape x" not in each.metadata for each in afmformats.load_data(path))


def test_curves_on_a_grid_of_uneven_steps_are_no_map(tmp_path):
    places = [(x, y) for y in (0.0, 20e-9) for x in (0.0, 10e-9, 30e-9)]
    path = write_curves(tmp_path / "uneven.h5", [scans.curve(x, y) for x, y in places])
    assert all("grid shape x" not in each.metadata for each in afmformats.load_data(path))


def test_curve_that_was_broken_off_has_its_approach_alone(tmp_path):
    curve = scans.curve()
    cut = curve.record.channels["phase"] == 2.0
    record = type(curve.record)(
        curve.record.time[cut][:500],
        {name: values[cut][:500] for name, values in curve.record.channels.items()},
        curve.record.units,
    )
    path = write_curves(tmp_path / "part.h5", type(curve)(record, False, 0.0, 0.0, 1e-6, 1e-6, 1e-7, 0.2))
    (read,) = afmformats.load_data(path)
    assert len(read.appr["force"]) == 500
    assert len(read.retr["force"]) == 0


def test_no_curve_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"none\.h5 is not written: there is no force curve to write"):
        write_curves(tmp_path / "none.h5", [])
    assert not list(tmp_path.iterdir())
