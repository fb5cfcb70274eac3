"""MATLAB's .mat: variables with units in their names, by SciPy, or h5py from 7.3 on.

A file, or each struct in it, has `time_ms` and `pressure_kpa`, or a number `rate_hz`
(`fs`) in place of the times.
"""

import io
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, check_declared, child_output, shown
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

Arrays = Mapping[str, np.ndarray]
READER = """
import sys, warnings
import numpy as np
from scipy.io import loadmat
arrays, names = [], []
def add(struct, name, array):
    if np.issubdtype(array.dtype, np.number):
        arrays.append(array)
        names.append((struct, name))
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    held = loadmat(sys.argv[1])
for name, array in held.items():
    if not isinstance(array, np.ndarray):
        continue
    add("", name, array)
    for row, struct in enumerate(array.ravel() if array.dtype.names else ()):
        one = f"{name}." if array.size == 1 else f"{name}({row + 1})."
        for field in array.dtype.names:
            add(one, field, struct[field])
np.savez(
    sys.stdout.buffer,
    *arrays,
    names=np.array(names, str).reshape(-1, 2),
    warnings=np.array([str(one.message) for one in caught], str),
)
"""
"""Program of `child_output` that reads a file before version 7.3: SciPy ends with a
segmentation fault, or never, for some damaged files."""


def open_matlab(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the variables of pressure or volts of a .mat file.

    Raises:
        InputError: The file cannot be read, or lacks a variable of time or pressure.
    """
    pieces: list[Piece] = []
    others: list[str] = []
    held = _arrays(path)
    for struct, arrays in held.items():
        units = {name: word_and_unit(name)[1] for name in arrays}
        pressures = [
            name
            for name, unit in units.items()
            if pressure_factor(unit) is not None or volts_factor(unit) is not None
        ]
        others += [f"{struct}{name}" for name in arrays if name not in pressures]
        if not pressures:
            continue
        refuse_two_units([(n, units[n]) for n in pressures], f"{path}: variables")
        clock, length, used = _clock(path, struct, arrays, units)
        others.remove(f"{struct}{used}")
        pieces += [
            _piece(path, f"{struct}{name}", units[name], arrays[name], clock, length)
            for name in pressures
        ]
    if not pieces:
        got = ", ".join(others)
        raise InputError(
            f"{path}: expected a variable of pressure, as pressure_kpa, or of volts, "
            f"got {shown(got) if got else 'no numbers'}"
        )
    return recordings_of(path, pieces, scaling, left_out(others))


def _arrays(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Return numbers by name: those of the file under "", of a struct under `name.`."""
    import h5py

    # version 7.3, also without the first lines that MATLAB writes
    if h5py.is_hdf5(path):
        return _arrays_of_hdf5(path)
    output = child_output(path, READER, "SciPy", "a .mat file")
    found: dict[str, dict[str, np.ndarray]] = {"": {}}
    with np.load(io.BytesIO(output), allow_pickle=False) as held:
        for text in held["warnings"]:
            warnings.warn(str(text), stacklevel=2)
        for number, (struct, name) in enumerate(held["names"].tolist()):
            found.setdefault(struct, {})[name] = held[f"arr_{number}"]
    return found


def _arrays_of_hdf5(path: Path) -> dict[str, dict[str, np.ndarray]]:
    import h5py

    def numbers(held: Any) -> dict[str, np.ndarray]:
        sets = [one for one in held.values() if isinstance(one, h5py.Dataset)]
        check_declared(path, sum(one.nbytes for one in sets))
        return {
            # MATLAB counts columns first
            name: np.asarray(one).T
            for name, one in held.items()
            if isinstance(one, h5py.Dataset) and np.issubdtype(one.dtype, np.number)
        }

    try:
        with h5py.File(path) as file:
            structs = [
                (f"{name}.", numbers(held))
                for name, held in file.items()
                if isinstance(held, h5py.Group)
            ]
            return {"": numbers(file), **dict(structs)}
    except OSError as error:
        raise InputError(
            f"{path}: expected a .mat file, got one that h5py cannot read ({error})"
        ) from None


def _clock(
    path: Path, struct: str, arrays: Arrays, units: Mapping[str, str]
) -> tuple[SampleClock, int | None, str]:
    """Return the clock, its number of samples, and the variable that states it."""
    times = [name for name, unit in units.items() if time_factor(unit) is not None]
    if len(times) == 1:
        (name,) = times
        seconds = float(time_factor(units[name]) or 1.0) * arrays[name].ravel()
        clock = even_clock(
            np.asarray(seconds, np.float64),
            lambda row: f"{path}: variable {struct}{name}, row {row + 1}",
        )
        return SampleClock(*clock), seconds.size, name
    rates = [name for name in arrays if name.lower() in RATES]
    if times or len(rates) != 1:
        got = ", ".join(f"{struct}{name}" for name in times or arrays)
        raise InputError(
            f"{path}: expected one variable of time, as time_ms, or rate_hz, "
            f"got {shown(got)}"
        )
    rate = arrays[rates[0]].ravel().astype(float)
    if rate.size != 1 or not (np.isfinite(rate[0]) and rate[0] > 0):
        raise InputError(
            f"{path}: variable {struct}{rates[0]}: expected one positive number, "
            f"got {shown(rate.tolist())}"
        )
    return SampleClock(0.0, float(rate[0])), None, rates[0]


def _piece(
    path: Path,
    name: str,
    unit: str,
    array: np.ndarray,
    clock: SampleClock,
    length: int | None,
) -> Piece:
    """Return a variable's samples, along the axis that is as long as the times."""
    array = np.atleast_2d(array)
    # without times the longer axis is that of the samples
    length = length or max(array.shape)
    if array.ndim != 2 or length not in array.shape:
        raise InputError(
            f"{path}: variable {name}: expected {length} samples per channel, the "
            f"number of times, got the shape {array.shape}"
        )
    samples = array if array.shape[1] == length else array.T
    return Piece(
        label=f"variable {name}",
        unit=unit,
        channels=len(samples),
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        clock=clock,
        name=word_and_unit(name)[0] or name,
    )
