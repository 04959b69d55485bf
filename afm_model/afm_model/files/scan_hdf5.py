"""Scans as HDF5, written line by line: measured lines are in the file at once, and memory does not grow.

scan.h5
  channels/height/trace, ...          (lines, pixels), attribute `units`; row 0 at the least y, NaN: not measured
  time/trace, time/retrace            (lines,) when each line began [s]
  x, y                                places of the pixels in the frame, from its centre [m]
  metadata                            a group whose attributes are the scan's notes
  attributes of the file              the fields of the scan (SI units), `start`, `line_rate_reached`, and `names`
                                      and `units` of the channels in order
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..core.errors import ParameterError, ResultFileError, reason
from ..core.optional import needed
from ..core.schema import build, python_value
from ..microscope.image import DIRECTIONS, RETRACE, Image, Line, as_image
from ..microscope.raster import Raster
from ..microscope.verbs import Lift, Scan
from .result_files import Disk, checked
from .sxm import read_sxm

if TYPE_CHECKING:
    import xarray

_FORMAT = "afm_model scan 1"
_UNITS = {"height": "m", "error": "V", "lateral": "N", "x": "m", "y": "m"}
_UNITS |= {"amplitude_error": "m", "amplitude": "m", "phase": "rad"}


class ScanFile:
    """A scan that is being written.

    Every line is handed over to the system as it comes, so that a program that is killed leaves all lines that it had
    measured, in a file that opens. The file has its full size from the beginning: what does not fit on the disk is
    refused before the scan, and a line takes its place without anything else in the file being touched.

    Parameters
    ----------
    path : Path or str
        Ends with .h5. There must be no file of this name, unless `overwrite` is true: a scan in it would be lost at the
        first line.
    scan : Raster
    units : Mapping of str to str, optional
        SI unit of each channel, in order. Without, those of `scan.channels`, which are known of height, error, lateral,
        amplitude_error, amplitude, phase, x and y.
    metadata : Mapping of str to str, optional
        The scan's notes.
    start : float
        Simulated time at which the first line began [s].
    line_rate : float
        Reached [Hz].
    overwrite : bool

    Raises
    ------
    ResultFileError
        If it cannot be written; the message names it and says why.
    ValueError
        If the unit of a channel is not known.
    ImportError
        If h5py is not installed.
    """

    def __init__(
        self,
        path: Path | str,
        scan: Raster,
        units: Mapping[str, str] | None = None,
        metadata: Mapping[str, str] | None = None,
        *,
        start: float = 0.0,
        line_rate: float = 0.0,
        overwrite: bool = False,
    ) -> None:
        h5py = needed("h5py", "an HDF5 file")
        self.path = checked(path, ".h5")
        # An empty image gives the places of its rows.
        self._frame = Image(scan, dict(units or _units(self.path, scan)), {})
        self._rows: dict[str, Any] = {}
        with self._failing():
            self._disk = Disk(self.path, overwrite=overwrite)
        self._file = h5py.File(self._disk, "w")
        try:
            with self._failing():
                self._prepare(metadata or {}, start, line_rate)
                self._file.flush()
                self._disk.check()
        except BaseException:
            self._close()
            self.path.unlink()
            raise

    @contextmanager
    def _failing(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError:
            raise ResultFileError(
                f"{self.path} cannot be written: it is there already; give another name, or overwrite=True"
            ) from None
        except (OSError, RuntimeError) as error:
            raise ResultFileError(f"{self.path} cannot be written: {reason(error)}") from None

    def _prepare(self, metadata: Mapping[str, str], start: float, line_rate: float) -> None:
        scan, file = self._frame.scan, self._file
        file.attrs["format"] = _FORMAT
        file.attrs.update(scan.model_dump())
        file.attrs["start"], file.attrs["line_rate_reached"] = start, line_rate
        # A file of HDF5 lists its parts by name: here they are in order.
        file.attrs["names"], file.attrs["units"] = list(self._frame.units), list(self._frame.units.values())
        notes = file.create_group("metadata")
        for name, value in metadata.items():
            notes.attrs[name] = value
        for name, places in (("x", self._frame.x), ("y", self._frame.y)):
            file[name] = places
            file[name].attrs["units"] = "m"
            file[name].make_scale(name)
        for name, unit in self._frame.units.items():
            for direction in DIRECTIONS:
                created = self._reserve(_place(name, direction), (scan.lines, scan.pixels), unit)
                created.dims[0].attach_scale(file["y"])
                created.dims[1].attach_scale(file["x"])
        for direction in DIRECTIONS:
            self._reserve(f"time/{direction}", (scan.lines,), "s")

    def _reserve(self, place: str, shape: tuple[int, ...], unit: str) -> Any:
        """An array of NaN in the file."""
        created = self._file.create_dataset(place, shape=shape, dtype="<f8", fillvalue=np.nan)
        # With the first value the library writes the whole data set.
        created[0] = np.nan
        created.attrs["units"] = unit
        self._rows[place] = created
        return created

    def put(self, line: Line) -> None:
        """Write one direction of a line; it is in the file when this returns.

        Raises
        ------
        ResultFileError
            If it cannot be written: the disk is full, the file is closed, or the line is not in this scan.
        """
        if not self._file:
            raise ResultFileError(f"{self.path} cannot be written: it is closed")
        if not 0 <= line.index < self._frame.scan.lines:
            raise ResultFileError(
                f"{self.path} cannot be written: line {line.index} is not one of its {self._frame.scan.lines} lines"
            )
        row = self._frame.row(line.index)
        with self._failing():
            for name in self._frame.units:
                self._rows[_place(name, line.direction)][row] = line.channels[name]
            self._rows[f"time/{line.direction}"][row] = line.time
            self._file.flush()
            self._disk.check()

    def close(self) -> None:
        """Close the file.

        Raises
        ------
        ResultFileError
            If something of it could not be written.
        """
        if self._file:
            self._close()
            with self._failing():
                self._disk.check()

    def _close(self) -> None:
        self._file.close()
        self._disk.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _units(path: Path, scan: Raster) -> dict[str, str]:
    if unknown := [name for name in scan.channel_names if name not in _UNITS]:
        raise ValueError(f"{path} is not written: the unit of the channel {unknown[0]} is not known; give units")
    return {name: _UNITS[name] for name in scan.channel_names}


def _place(channel: str, direction: str) -> str:
    # A signal whose name has a slash in it is a group in a group.
    return f"channels/{channel}/{direction}"


def write_scan(path: Path | str, image: "Image | xarray.Dataset", *, overwrite: bool = False) -> Path:
    """Write a scan that is in memory into an HDF5 file, in the format of `ScanFile`.

    The times of the lines are not in an `Image`: in the file all lines begin at the start of the scan.

    Raises
    ------
    ResultFileError
        If it cannot be written.
    """
    image = as_image(image)
    file = ScanFile(
        path,
        image.scan,
        image.units,
        image.metadata,
        start=image.start,
        line_rate=image.line_rate,
        overwrite=overwrite,
    )
    with file:
        for index in range(image.scan.lines):
            for direction in DIRECTIONS:
                values = {name: image.data[name, direction][image.row(index)] for name in image.units}
                if any(np.isfinite(each).any() for each in values.values()):
                    file.put(Line(index, direction, image.start, values))
    return file.path


def read_scan(path: Path | str) -> Image:
    """Read a scan from an HDF5 file, or a .sxm file (see `read_sxm`), as far as it was written.

    Raises
    ------
    ResultFileError
        If it cannot be read, or is another kind of file; the message names it and says why.
    ImportError
        If it is an HDF5 file, and h5py is not installed.
    """
    if Path(path).suffix.lower() == ".sxm":
        return read_sxm(path)
    h5py = needed("h5py", "an HDF5 file")
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != _FORMAT:
                raise ResultFileError(f"{path} is no scan: it is an HDF5 file of another kind")
            return _image(file)
    except (OSError, KeyError, RuntimeError, ParameterError) as error:
        if isinstance(error, ResultFileError):
            raise
        raise ResultFileError(f"{path} cannot be read as a scan: {reason(error)}") from None


def _image(file: Any) -> Image:
    kind = Lift if "lift" in file.attrs else Scan
    scan = build(kind, {name: python_value(file.attrs[name]) for name in kind.model_fields})
    units = {str(name): str(unit) for name, unit in zip(file.attrs["names"], file.attrs["units"], strict=True)}
    image = Image.empty(scan, units)
    image.start, image.line_rate = float(file.attrs["start"]), float(file.attrs["line_rate_reached"])
    image.metadata = {str(name): str(value) for name, value in file["metadata"].attrs.items()}
    for (name, direction), values in image.data.items():
        file[_place(name, direction)].read_direct(values)
    done = np.flatnonzero(np.isfinite(file[f"time/{RETRACE}"][:]))
    if len(done):
        image.lines_done = 1 + max(image.row(int(row)) for row in done)
    image.complete = image.lines_done == scan.lines
    return image
