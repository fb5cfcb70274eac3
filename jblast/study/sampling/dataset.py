"""A study's samples as a data set of xarray."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jblast.study.engine.variable import Variable

if TYPE_CHECKING:
    import xarray


def dataset_of(
    variables: Sequence[Variable],
    columns: Mapping[str, np.ndarray],
    attributes: Mapping[str, Any],
    places: Mapping[str, Sequence[float]],
) -> "xarray.Dataset":
    """Return columns as a data set, as a store of them is read by xarray.

    Args:
        variables: The columns.
        columns: Their values.
        attributes: What the set says of itself.
        places: East, north, up [m] of the sensors by name.
    """
    import xarray

    data = {v.name: (v.dims, columns[v.name], v.attributes()) for v in variables}
    coordinates: dict[str, Any] = {}
    if places:
        where = np.array(list(places.values()))
        said = {"long_name": "place of the sensor: east, north, up", "units": "m"}
        coordinates = {
            "sensor": (
                "sensor",
                np.array(list(places), object),
                {"long_name": "sensor"},
            ),
            "sensor_position_m": (("sensor", "direction"), where, said),
        }
    return xarray.Dataset(data, coordinates, dict(attributes))
