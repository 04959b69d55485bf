"""Claims about what the files of results import."""

import subprocess
import sys

from . import scans


def test_what_a_format_needs_is_imported_when_it_is_written_and_asked_for_in_one_sentence(tmp_path):
    script = f"""
import sys
sys.path.insert(0, {str(scans.__file__).rsplit("/model/", 1)[0]!r})
from model.files import scans
from afm_model import files
from afm_model.microscope.arrays import to_xarray
needed = ("matplotlib", "gwyfile", "h5py", "xarray", "pandas")
print(*(name for name in needed if name in sys.modules))
for name in needed:
    sys.modules[name] = None  # as if it were not installed
image = scans.scanned(pixels=8, lines=8)
files.write_gsf("scan.gsf", image)
files.write_curve_tab("curve.tab", scans.curve())
for call in (
    lambda: files.write_picture("a.png", image),
    lambda: files.write_gwy("a.gwy", image),
    lambda: files.write_scan("a.h5", image),
    lambda: files.write_curves("a.h5", scans.curve()),
    lambda: to_xarray(image),
):
    try:
        call()
    except ImportError as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines() == [
        "",
        "a picture needs matplotlib, which is not installed: pip install matplotlib",
        "a .gwy file needs gwyfile, which is not installed: pip install gwyfile",
        "an HDF5 file needs h5py, which is not installed: pip install h5py",
        "an HDF5 file needs h5py, which is not installed: pip install h5py",
        "a labelled array needs xarray, which is not installed: pip install xarray",
    ], done.stderr
    assert sorted(each.name for each in tmp_path.iterdir()) == ["curve.tab", "scan.gsf"]
