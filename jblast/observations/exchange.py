"""Logs as pandas and xarray have them."""

from typing import Any

import numpy as np

from jblast.observations.dialects.workbook import LOWER_BOUND
from jblast.observations.read import read
from jblast.observations.records.side_file import COVARIANCES, covariance_rows
from jblast.observations.table import NUMBERS, POSITION, Observations
from jblast.observations.write import typed_columns
from jblast.quantity_table import QUANTITIES
from jblast.units.names import dimension_of


def from_pandas(frame: Any, **asked: Any) -> Observations:
    """Return the log that a data frame holds; `asked` as `read` takes it."""
    return read(frame, **asked)


def to_pandas(observations: Observations) -> Any:
    """Return a log as a data frame: columns as in a file, units in their names."""
    import pandas

    columns: dict[str, Any] = dict(typed_columns(observations))
    if observations.bounds().any():
        columns[LOWER_BOUND] = observations.bounds()
    frame = pandas.DataFrame({name: list(held) for name, held in columns.items()})
    frame.attrs = {
        "source": observations.source,
        "comments": list(observations.comments),
        "units": {name: _unit(name) for name in columns if name in NUMBERS[2:]},
    }
    if observations.covariances:
        frame.attrs[COVARIANCES] = covariance_rows(observations)
    return frame


def to_xarray(observations: Observations) -> Any:
    """Return a log as a data set, a variable for each quantity, units as attributes."""
    import xarray

    quantity = np.array(observations.quantity)
    variables: dict[str, Any] = {}
    for name in dict.fromkeys(observations.quantity):
        if name not in QUANTITIES:  # samples, which stand in files of their own
            continue
        one, here = QUANTITIES[name], quantity == name
        variables[name] = (
            "row",
            np.where(here, observations.value, np.nan),
            {"units": one.unit, "long_name": one.meaning},
        )
        variables[f"sigma_{name}"] = (
            "row",
            np.where(here, observations.sigma, np.nan),
            {"units": one.unit, "long_name": f"standard deviation of {one.words}"},
        )
    numbers = dict(zip(POSITION, observations.position.T, strict=True))
    numbers |= {"range_m": observations.slant_range, "time_s": observations.time}
    coordinates: dict[str, Any] = {
        name: ("row", held, {"units": _unit(name)}) for name, held in numbers.items()
    }
    names = ("sensor", "quantity", "path", "shot", "clock")
    coordinates |= {name: ("row", list(getattr(observations, name))) for name in names}
    coordinates["record"] = ("row", list(observations.records()))
    coordinates[LOWER_BOUND] = ("row", observations.bounds())
    attributes = {
        "source": observations.source,
        "comments": "\n".join(observations.comments),
    }
    if observations.frame is not None:
        frame = observations.frame
        attributes["origin"] = f"{frame.lat_deg!r} {frame.lon_deg!r} {frame.alt_m!r}"
    if observations.epoch is not None:
        attributes["epoch"] = observations.epoch.isoformat()
    return xarray.Dataset(variables, coordinates, attributes)


def _unit(column: str) -> str:
    """Return the unit of a column, as an attribute has it."""
    if column.endswith("_deg"):
        return "degree"
    return "s" if dimension_of(column) == "time" else "m"
