"""Scans and force curves as files that other programs open, as pictures and as tables. Needs no ROS.

What a format needs (gwyfile, h5py, matplotlib) is imported when a file is written, not before.
"""

from .curve_files import write_curve_tab, write_curves
from .curve_picture import curve_picture, write_curve_picture
from .gwyddion import FrameWarning, write_gsf, write_gwy
from .layer_statistics import Figures, figures, text_table, write_table
from .layers import Layer, layer, layers
from .level import background as level_background
from .level import lines as level_lines
from .level import plane as level_plane
from .picture import picture, sheet, write_picture, write_sheet
from .scan_hdf5 import ScanFile, read_scan, write_scan
from .spectrum_dat import read_curve, write_dat
from .sxm import read_sxm, write_sxm

__all__ = [
    "Figures",
    "FrameWarning",
    "Layer",
    "ScanFile",
    "curve_picture",
    "figures",
    "layer",
    "layers",
    "level_background",
    "level_lines",
    "level_plane",
    "picture",
    "read_curve",
    "read_scan",
    "read_sxm",
    "sheet",
    "text_table",
    "write_curve_picture",
    "write_curve_tab",
    "write_curves",
    "write_dat",
    "write_gsf",
    "write_gwy",
    "write_picture",
    "write_scan",
    "write_sheet",
    "write_sxm",
    "write_table",
]
