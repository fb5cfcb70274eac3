"""Arrays with names: MATLAB's .mat, HDF5 and NetCDF, by SciPy and h5py.

Units are attributes of arrays, or part of their names. Samples lie along the axis that
is as long as an array of times of the same group or struct; without times along the
longest, and the sampling rate is a number or an attribute `rate_hz` (`fs`). Scales and
offsets of packed numbers are applied, and fill values are missing samples (CF
conventions, 8.1).
"""

import io
import warnings
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Num

from jblast.errors import InputError, check_declared, child_output, shown
from jblast.observations.records.recording import RATES, Clock, Column, Group
from jblast.units import sample_unit, word_and_unit

READER = """
import sys, warnings
import numpy as np
from scipy.io import loadmat
arrays, names = [], []
def add(name, array):
    if np.issubdtype(array.dtype, np.number):
        arrays.append(array)
        names.append(name)
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    held = loadmat(sys.argv[1])
for name, array in held.items():
    if not isinstance(array, np.ndarray):
        continue
    add(name, array)
    for row, struct in enumerate(array.ravel() if array.dtype.names else ()):
        one = name if array.size == 1 else f"{name}({row + 1})"
        for field in array.dtype.names:
            add(f"{one}.{field}", struct[field])
np.savez(
    sys.stdout.buffer,
    *arrays,
    names=np.array(names, str),
    warnings=np.array([str(one.message) for one in caught], str),
)
"""
"""Program of `child_output` that reads a .mat file before version 7.3: SciPy ends with
a segmentation fault, or never, for some damaged files."""
Opener = Callable[[], AbstractContextManager[Mapping[str, Any]]]
"""Function that opens a file: arrays by name, with a dot behind each group or struct,
and attributes of groups under names that end in a dot, of the file under ""."""


def open_arrays(path: Path) -> tuple[Group, ...]:
    """Return the arrays of a file, by group or struct.

    Raises:
        InputError: The file cannot be read, or a sampling rate is not one number.
    """
    import h5py

    opened: Opener = partial(_hdf5 if h5py.is_hdf5(path) else _classic, path)
    if path.suffix.lower() == ".mat" and not h5py.is_hdf5(path):
        opened = partial(nullcontext, _mat_arrays(path))
    with opened() as held:
        arrays = {n: one for n, one in held.items() if hasattr(one, "shape")}
        check_declared(path, sum(_octets(one) for one in arrays.values()))
        named: dict[str, dict[str, Any]] = defaultdict(dict)
        for name, array in arrays.items():
            if len(array.shape) <= 2 and np.issubdtype(_type(array), np.number):
                named[name.rpartition(".")[0]][name] = array
        return tuple(
            _group(path, opened, group, members, held)
            for group, members in named.items()
        )


def _group(
    path: Path, opened: Opener, group: str, arrays: dict[str, Any], held: Mapping
) -> Group:
    """Return the arrays of one group, with the rate that it or the file states."""
    units = {n: _text(_attributes(a).get("units", "")) for n, a in arrays.items()}
    short = {name: name.rpartition(".")[2].lower() for name in arrays}
    rates = {key: arrays[name][...] for name, key in short.items() if key in RATES}
    lengths = {
        max(array.shape)
        for name, array in arrays.items()
        if array.shape
        and max(array.shape) == np.prod(array.shape)
        and sample_unit(units[name] or word_and_unit(name)[1]).dimension == "time"
    }
    columns = []
    for name, array in arrays.items():
        # the last axis of the right length, or of the largest
        axis = max(
            range(len(array.shape)),
            key=lambda n, of=array.shape: (of[n] in lengths, of[n], n),
            default=None,
        )
        if axis is None or short[name] in rates:
            continue
        length, stated = array.shape[axis], [_attributes(array)]
        if length not in lengths:
            stated += [rates, held.get(f"{group}.", {}), held.get("", {})]
        columns.append(
            Column(
                name=name,
                unit=units[name],
                length=length,
                read=partial(_read, opened, name, axis),
                channels=int(np.prod(array.shape)) // max(length, 1),
                clocks=_clocks(path, stated),
            )
        )
    return Group(tuple(columns))


def _clocks(path: Path, stated: list[Mapping]) -> tuple[Clock, ...]:
    """Return the clock of the first sampling rate; none without one."""
    for key, rate in ((k, of[k]) for of in stated for k in RATES if k in of):
        values = np.asarray(rate).ravel()
        if values.size != 1 or not (np.isfinite(values[0]) and values[0] > 0):
            raise InputError(
                f"{path}: {key}: expected one positive number, got "
                f"{shown(values.tolist())}"
            )
        return (Clock(float(values[0])),)
    return ()


def _read(
    opened: Opener, name: str, axis: int, start: int, stop: int
) -> Num[np.ndarray, "channel sample"]:
    with opened() as held:
        array = held[name]
        of = _attributes(array)
        part = np.array(array[(slice(None),) * axis + (slice(start, stop),)])
        empty = np.isin(
            part, [of[k] for k in ("_FillValue", "missing_value") if k in of]
        )
        if empty.any():
            part = np.where(empty, np.nan, part)
        if "scale_factor" in of or "add_offset" in of:
            part = part * of.get("scale_factor", 1.0) + of.get("add_offset", 0.0)
    return np.atleast_2d(part if axis == part.ndim - 1 else part.T)


def _attributes(array: Any) -> Mapping[str, Any]:
    return getattr(array, "attrs", None) or getattr(array, "_attributes", {})


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _type(array: Any) -> np.dtype:
    return array.dtype if hasattr(array, "dtype") else array.data.dtype


def _octets(array: Any) -> int:
    return int(np.prod(array.shape, dtype=object)) * _type(array).itemsize


def _mat_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a .mat file before version 7.3."""
    output = child_output(path, READER, "SciPy", "a .mat file")
    with np.load(io.BytesIO(output), allow_pickle=False) as held:
        for text in held["warnings"]:
            warnings.warn(str(text), stacklevel=2)
        names = held["names"].tolist()
        return {name: held[f"arr_{number}"] for number, name in enumerate(names)}


@contextmanager
def _hdf5(path: Path):
    """Open HDF5, which NetCDF 4 and .mat from version 7.3 on are."""
    import h5py

    with h5py.File(path) as file:
        held: dict[str, Any] = {"": file.attrs}

        def visit(name: str, one: Any) -> None:
            is_array = isinstance(one, h5py.Dataset)
            held[name.replace("/", ".") + "." * (not is_array)] = (
                one if is_array else one.attrs
            )

        file.visititems(visit)
        yield held


@contextmanager
def _classic(path: Path):
    """Open NetCDF 3."""
    from scipy.io import netcdf_file

    file = netcdf_file(path, mmap=True)
    yield {"": file._attributes, **file.variables}
    with warnings.catch_warnings():
        # arrays of it are alive: the file is closed with them
        warnings.simplefilter("ignore", RuntimeWarning)
        file.close()
