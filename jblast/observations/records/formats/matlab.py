"""MATLAB's .mat: variables whose names hold units, by SciPy, or h5py from version 7.3.

`time_ms` and `pressure_kpa`, or a number `rate_hz` (`fs`) in place of the times.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jblast.errors import InputError, shown
from jblast.observations.records.formats.columns import (
    refuse_two_units,
    word_and_unit,
)
from jblast.observations.records.formats.even_clock import even_clock
from jblast.observations.records.formats.pieces import (
    RATES,
    Piece,
    SampleClock,
    left_out,
    recordings_of,
)
from jblast.observations.records.formats.scale import (
    Scaling,
    pressure_factor,
    time_factor,
    volts_factor,
)
from jblast.observations.records.recording import Recording

Arrays = Mapping[str, np.ndarray]


def open_matlab(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the variables of pressure or volts of a .mat file.

    Raises:
        InputError: It is none, or its variables are no time and pressure.
    """
    arrays = _arrays(path)
    units = {name: word_and_unit(name)[1] for name in arrays}
    pressures = [
        name
        for name, unit in units.items()
        if pressure_factor(unit) is not None or volts_factor(unit) is not None
    ]
    if not pressures:
        raise InputError(
            f"{path}: expected a variable of pressure, as pressure_kpa, or of volts, "
            f"got {shown(', '.join(arrays))}"
        )
    refuse_two_units([(name, units[name]) for name in pressures], f"{path}: variables")
    clock, length, used = _clock(path, arrays, units)
    others = [name for name in arrays if name not in (*pressures, used)]
    pieces = [
        _piece(path, name, units[name], arrays[name], clock, length)
        for name in pressures
    ]
    return recordings_of(path, pieces, scaling, left_out(others))


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the numeric variables of a file by name."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        held = loadmat(path)
    except NotImplementedError:  # version 7.3 is HDF5
        return _arrays_of_hdf5(path)
    except (MatReadError, ValueError, OSError) as error:
        raise InputError(
            f"{path}: expected a .mat file, which SciPy cannot make of it ({error})"
        ) from None
    return {
        name: array
        for name, array in held.items()
        if isinstance(array, np.ndarray) and np.issubdtype(array.dtype, np.number)
    }


def _arrays_of_hdf5(path: Path) -> dict[str, np.ndarray]:
    import h5py

    try:
        with h5py.File(path) as file:
            return {
                name: np.asarray(held).T  # MATLAB counts columns first
                for name, held in file.items()
                if isinstance(held, h5py.Dataset)
                and np.issubdtype(held.dtype, np.number)
            }
    except OSError as error:
        raise InputError(
            f"{path}: expected a .mat file, which h5py cannot make of it ({error})"
        ) from None


def _clock(
    path: Path, arrays: Arrays, units: Mapping[str, str]
) -> tuple[SampleClock, int | None, str]:
    """Return the clock, how many samples it has, and the variable that tells it."""
    times = [name for name, unit in units.items() if time_factor(unit) is not None]
    if len(times) == 1:
        (name,) = times
        seconds = float(time_factor(units[name]) or 1.0) * arrays[name].ravel()
        clock = even_clock(
            np.asarray(seconds, np.float64),
            lambda row: f"{path}: variable {name}, row {row + 1}",
        )
        return SampleClock(*clock), seconds.size, name
    rates = [name for name in arrays if name.lower() in RATES]
    if times or len(rates) != 1:
        got = ", ".join(times or arrays)
        raise InputError(
            f"{path}: expected one variable of time, as time_ms, or rate_hz, "
            f"got {shown(got)}"
        )
    rate = arrays[rates[0]].ravel().astype(float)
    if rate.size != 1 or not (np.isfinite(rate[0]) and rate[0] > 0):
        raise InputError(
            f"{path}: variable {rates[0]}: expected one positive number, "
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
    length = length or max(array.shape)
    if array.ndim != 2 or length not in array.shape:
        raise InputError(
            f"{path}: variable {name}: expected {length} samples a channel, as the "
            f"times are, got the shape {array.shape}"
        )
    samples = array if array.shape[1] == length else array.T
    return Piece(
        label=f"variable {name}",
        unit=unit,
        channels=len(samples),
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        clock=clock,
    )
