"""What Zarr 3 says of a study's columns, and words as it writes them.

As https://zarr-specs.readthedocs.io/en/latest/v3/core/ has it: plain numbers in little
endian, without compression, a file a chunk.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from jblast.study.engine.variable import Variable

PLACES = "sensor_position_m"


def as_json(document: Mapping[str, Any]) -> str:
    """Return a description as its file has it."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def array_of(variable: Variable, samples: int, tile: int) -> dict[str, Any]:
    """Return a column as Zarr describes it."""
    said = variable.attributes()
    if variable.sensors:
        said["coordinates"] = PLACES  # so that xarray takes it for one
    kinds = {"f8": "float64", "i1": "int8", "i2": "int16"}
    kind = kinds[variable.dtype.str[1:]]
    fill = "NaN" if kind == "float64" else variable.missing
    return described(
        variable.shape(samples),
        variable.shape(tile),
        kind,
        fill,
        variable.dims,
        said,
    )


def described(
    shape: Sequence[int],
    chunk: Sequence[int],
    kind: str,
    fill: Any,
    dims: Sequence[str],
    attributes: Mapping[str, Any],
) -> dict[str, Any]:
    """Return an array as Zarr 3 describes it."""
    codec = {"name": "bytes", "configuration": {"endian": "little"}}
    if kind == "int8":
        codec = {"name": "bytes"}
    if kind == "string":
        codec = {"name": "vlen-utf8"}
    grid = {"chunk_shape": list(chunk)}
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": list(shape),
        "data_type": kind,
        "chunk_grid": {"name": "regular", "configuration": grid},
        "chunk_key_encoding": {"name": "v2", "configuration": {"separator": "."}},
        "fill_value": fill,
        "codecs": [codec],
        "attributes": dict(attributes),
        "dimension_names": list(dims),
    }


def sensor_arrays(count: int) -> dict[str, Any]:
    """Return what stands of the sensors: their names, and where they are."""
    words = {"long_name": "sensor"}
    where = {"long_name": "place of the sensor: east, north, up", "units": "m"}
    dims = ("sensor", "direction")
    return {
        "sensor": described((count,), (count,), "string", "", ("sensor",), words),
        PLACES: described((count, 3), (count, 3), "float64", "NaN", dims, where),
    }


def words_chunk(words: Sequence[str]) -> bytes:
    """Return words as Zarr's vlen-utf8 has them."""
    encoded = [word.encode() for word in words]
    parts = [len(encoded).to_bytes(4, "little")]
    for word in encoded:
        parts += [len(word).to_bytes(4, "little"), word]
    return b"".join(parts)


def read_words(data: bytes) -> tuple[str, ...]:
    """Return the words of such a chunk."""
    at, words = 4, []
    for _ in range(int.from_bytes(data[:4], "little")):
        length = int.from_bytes(data[at : at + 4], "little")
        words.append(data[at + 4 : at + 4 + length].decode())
        at += 4 + length
    return tuple(words)
