"""HDF5 and NetCDF: variables with units as attributes, or in their names, by xarray.

A variable of pressure or volts has times along its last dimension (or along that of a
variable of time), or an attribute `rate_hz` or `sampling_rate`. Each group of a file
has its own times.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, check_declared, shown
from jblast.observations.records.recording import (
    RATES,
    Piece,
    Recording,
    SampleClock,
    Scaling,
    even_clock,
    left_out,
    pressure_factor,
    recordings_of,
    refuse_two_units,
    time_factor,
    volts_factor,
    word_and_unit,
)

if TYPE_CHECKING:
    import xarray as xr

SINCE = re.compile(r"\s*(\w+)\s+since\s+(.+?)\s*")
"""Unit of time with its epoch in the CF conventions: "seconds since 2020-08-04"."""


def open_netcdf(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the variables of pressure or volts of a file, read in segments.

    Raises:
        InputError: xarray cannot read the file, no variable is a pressure, or one has
            no clock.
    """
    pieces: list[Piece] = []
    held: list[str] = []
    others: list[str] = []
    for group in _groups(path):
        with _opened(path, group) as file:
            # before times, which are read whole
            check_declared(path, sum(v.nbytes for v in file.variables.values()))
            units = {
                str(n): str(v.attrs.get("units", "")) or word_and_unit(str(n))[1]
                for n, v in file.variables.items()
            }
            wanted = [
                name
                for name, unit in units.items()
                if pressure_factor(unit) is not None or volts_factor(unit) is not None
            ]
            refuse_two_units([(n, units[n]) for n in wanted], f"{path}: variables")
            pieces += [_piece(path, group, file, name, units) for name in wanted]
        held += [f"{group}{n} ({u or 'no units'})" for n, u in units.items()]
        others += [
            f"{group}{name}"
            for name, unit in units.items()
            if name not in wanted and _seconds(unit) is None
        ]
    if not pieces:
        raise InputError(
            f"{path}: expected a variable with units of pressure, or of volts, "
            f"got {shown(', '.join(held)) if held else 'no variable'}"
        )
    return recordings_of(path, pieces, scaling, left_out(others))


def _is_classic(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(3) == b"CDF"


def _groups(path: Path) -> list[str]:
    """Return the groups with variables, as `gate/`; "" is the root."""
    if _is_classic(path):
        return [""]
    import h5py

    found = {"": True}

    def visit(name: str, held: Any) -> None:
        if isinstance(held, h5py.Dataset) and "/" in name:
            found[name.rpartition("/")[0] + "/"] = True

    try:
        with h5py.File(path) as file:
            file.visititems(visit)
    except OSError:
        # xarray opens the root next, and its error is more specific
        return [""]
    return list(found)


@contextmanager
def _opened(path: Path, group: str = "") -> Iterator["xr.Dataset"]:
    """Open a file: NetCDF 3 by SciPy, others by h5netcdf."""
    import xarray as xr

    engine: dict[str, Any] = {"engine": "scipy"}
    if not _is_classic(path):
        # plain HDF5 has no named dimensions: h5netcdf must invent them
        engine = {"engine": "h5netcdf", "phony_dims": "sort", "group": group or None}
    try:
        opened = xr.open_dataset(path, decode_times=False, **engine)
    except Exception as error:  # of many kinds, by the library below
        raise InputError(
            f"{path}: expected HDF5 or NetCDF, got a file that xarray cannot read "
            f"({error})"
        ) from None
    with opened:
        yield opened


def _piece(
    path: Path, group: str, file: "xr.Dataset", name: str, units: dict[str, str]
) -> Piece:
    variable = file[name]
    times = [
        other
        for other, unit in units.items()
        if _seconds(unit) is not None
        and file[other].ndim == 1
        and file[other].dims[0] in variable.dims
    ]
    along = str(file[times[0]].dims[0] if times else variable.dims[-1])
    if variable.ndim > 2 or len(times) > 1:
        got = f"the dimensions {', '.join(map(str, variable.dims))}"
        if len(times) > 1:
            got = f"the times {', '.join(times)}"
        raise InputError(
            f"{path}: variable {group}{name}: expected channels along one time, got "
            f"{got}"
        )

    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        with _opened(path, group) as opened:
            stretch = opened[name].isel({along: slice(start, stop)})
            return np.atleast_2d(stretch.transpose(..., along).values)

    length = variable.sizes[along]
    clock = _clock(path, group, file, name, times, units)
    channels = variable.size // max(length, 1)
    label = f"variable {group}{name}"
    short = f"{group}{word_and_unit(name)[0] or name}".replace("/", ".")
    return Piece(label, units[name], channels, length, read, clock, short)


def _clock(
    path: Path,
    group: str,
    file: "xr.Dataset",
    name: str,
    times: list[str],
    units: dict[str, str],
) -> SampleClock:
    if times:
        seconds, epoch = _seconds(units[times[0]]) or (1.0, None)
        start, rate = even_clock(
            seconds * np.asarray(file[times[0]].values, np.float64),
            lambda row: f"{path}: variable {group}{times[0]}, row {row + 1}",
        )
        return SampleClock(start, rate, epoch)
    with _opened(path) as root:
        attributes = {**root.attrs, **file.attrs, **file[name].attrs}
    rates = [attributes[key] for key in RATES if key in attributes]
    if not rates:
        raise InputError(
            f"{path}: variable {group}{name}: expected a variable of time along it, "
            "with units of time, or an attribute rate_hz; got neither"
        )
    return SampleClock(0.0, float(np.asarray(rates[0]).ravel()[0]))


def _seconds(unit: str) -> tuple[float, datetime | None] | None:
    """Return seconds per unit of time, and its epoch if any; None for other units."""
    since = SINCE.fullmatch(unit)
    factor = time_factor(since[1] if since else unit)
    if factor is None or not unit:
        return None
    if not since:
        return factor, None
    # CF conventions: a time without a zone is UTC
    epoch = datetime.fromisoformat(since[2].replace(" UTC", "+00:00"))
    return factor, epoch if epoch.tzinfo else epoch.replace(tzinfo=UTC)
