"""Store of a study on disk: a Zarr group that can be read before it is complete.

A chunk is a file of plain numbers, written completely or not at all (`jblast.files`). A
tile is done when every column has its intact chunk, so no other record of progress is
needed, and writing a tile twice changes nothing. The layout is Zarr 3
(https://zarr-specs.readthedocs.io/en/latest/v3/core/): little-endian numbers without
compression, one file a chunk, with a checksum (codec crc32c) at its end. Stores of
earlier versions have none. Zarr itself is not needed to write it.
"""

import contextlib
import errno
import functools
import json
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import google_crc32c
import numpy as np

from jblast.errors import InputError, shown, whole_number
from jblast.files import write_bytes, write_text

LOCK = ".lock"
SCHEMA = 1
"""Version of the attributes and columns: `jblast_study_schema`."""
GROUP = "zarr.json"
WHAT = "the store of a study"
PLACES = "sensor_position_m"
COORDINATES = ("sensor", PLACES)
Role = Literal["input", "axis", "outcome"]
Kind = Literal["number", "yes_no"]
NO_ANSWER = -1
"""Value of a yes-or-no outcome of a failed sample; a number is NaN."""
CHECKSUM = {"name": "crc32c"}
"""Codec that appends four bytes to a chunk."""


def sealed(data: bytes, checksums: bool) -> bytes:
    """Return the content of a chunk's file, with its checksum if the store has them."""
    if not checksums:
        return data
    return data + google_crc32c.value(data).to_bytes(4, "little")


def read_chunk(path: Path, checksums: bool, size: int | None = None) -> bytes:
    """Return the data of a chunk, without its checksum.

    Args:
        path: File of the chunk.
        checksums: Whether the store has checksums.
        size: Size of the data [bytes]; None if it varies.

    Raises:
        InputError: The file is missing, truncated or damaged.
    """
    try:
        whole = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: expected a chunk of the store, got none") from None
    data, check = (whole[:-4], whole[-4:]) if checksums else (whole, b"")
    if size is not None and len(data) != size:
        raise InputError(
            f"{path}: expected {size + 4 * checksums:,} bytes, got {len(whole):,}"
        )
    value = google_crc32c.value(data) if checksums else 0
    # Compared as bytes: a file shorter than a checksum would be the number 0.
    if checksums and check != value.to_bytes(4, "little"):
        raise InputError(
            f"{path}: expected the checksum {value:08x} of its data, got "
            f"{int.from_bytes(check, 'little'):08x}"
        )
    return data


class Tiled(ABC):
    """Tiles that consist of several chunks.

    Attributes:
        tiles: Number of tiles.
    """

    tiles: int

    @abstractmethod
    def parts(self) -> list[tuple[Path, Callable[[int], object]]]:
        """Return the folder of each kind of chunk and the reader of a tile's chunk."""

    def fault(self, tile: int) -> str:
        """Return the message on the first damaged or missing chunk; "" without one."""
        try:
            for _, read in self.parts():
                read(tile)
        except InputError as error:
            return str(error)
        return ""

    def checked(self) -> tuple[set[int], dict[int, str]]:
        """Return the intact tiles, and the message on each damaged one.

        All chunks are read. A damaged tile has the message on its first damaged chunk;
        a tile without a chunk may have none.
        """
        faults: dict[int, str] = {}
        for folder, read in self.parts():
            for tile in self._files(folder):
                try:
                    read(tile)
                except InputError as error:
                    faults.setdefault(tile, str(error))
        return self.written() - set(faults), faults

    def done(self) -> set[int]:
        """Return the complete tiles, of which each chunk is intact."""
        return self.checked()[0]

    def written(self) -> set[int]:
        """Return the tiles with a file of each chunk, which is not read."""
        there = (self._files(folder) for folder, _ in self.parts())
        return set(range(self.tiles)).intersection(*there)

    def _files(self, folder: Path) -> set[int]:
        """Return the tiles that have a file in a folder."""
        numbers = (whole_number(n.partition(".")[0]) for n in os.listdir(folder))
        return {n for n in numbers if n is not None and n < self.tiles}


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Lock a store for this process; the lock ends with the process in any case.

    Raises:
        InputError: Another process has the lock.
        OSError: The folder is not writable.
    """
    try:
        import fcntl
    except ImportError:  # no such locks: two processes would write the same values
        yield
        return
    path.mkdir(parents=True, exist_ok=True)
    file = os.open(path / LOCK, os.O_CREAT | os.O_RDWR)  # closed with the process
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{path}: expected one process that writes this study, got another "
                "one; wait for it, or write to another store"
            ) from None
        except OSError as error:  # a file system without locks
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP):
                raise
        yield
    finally:
        os.close(file)


class Variable(NamedTuple):
    """A column of a study.

    Attributes:
        name: Name of the parameter, axis or outcome.
        role: Input (sampled from a prior), axis or outcome.
        units: Unit of the values; "1" for none.
        long_name: Description.
        kind: A number, or yes (1) and no (0).
        sensors: Names of the sensors with a value each; () for one value a sample.
        names: Meanings of the integers of an axis over words.
    """

    name: str
    role: Role
    units: str
    long_name: str
    kind: Kind = "number"
    sensors: tuple[str, ...] = ()
    names: tuple[str, ...] = ()

    @property
    def dtype(self) -> np.dtype:
        """Type of the stored values."""
        if self.kind == "yes_no":
            return np.dtype("<i1")
        return np.dtype("<i2" if self.names else "<f8")

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return ("sample", "sensor") if self.sensors else ("sample",)

    def shape(self, samples: int) -> tuple[int, ...]:
        """Return the shape of the values of `samples` samples."""
        return (samples, len(self.sensors)) if self.sensors else (samples,)

    @property
    def missing(self) -> float | int:
        """Stored value of a sample without an answer."""
        return NO_ANSWER if self.dtype.kind == "i" else float("nan")

    def attributes(self) -> dict[str, object]:
        """Return the attributes of the column in the store."""
        attributes: dict[str, object] = {
            "role": self.role,
            "units": self.units,
            "long_name": self.long_name,
        }
        if self.role == "outcome":
            attributes["kind"] = self.kind
        if self.names:
            attributes["names"] = list(self.names)
        return attributes


class Store(Tiled):
    """Store of a study.

    Attributes:
        path: Folder.
        variables: Columns.
        samples: Number of rows of the complete store.
        tile: Rows of a chunk.
        attributes: Attributes of the group.
        checksums: Whether the chunks have checksums.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        variables: Sequence[Variable],
        samples: int,
        tile: int,
        attributes: Mapping[str, Any],
        *,
        checksums: bool = True,
    ) -> None:
        self.path, self.variables = Path(path), tuple(variables)
        self.samples, self.tile = samples, tile
        self.attributes, self.checksums = dict(attributes), checksums

    @property
    def tiles(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Number of tiles."""
        return -(-self.samples // self.tile)

    def create(self, places: Mapping[str, Sequence[float]]) -> None:
        """Create the store, without samples.

        Args:
            places: Positions of the sensors by name: east, north, up [m].

        Raises:
            OSError: The folder is not writable.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        for variable in self.variables:
            (self.path / variable.name).mkdir(exist_ok=True)
        if places:
            names = "sensor", words_chunk(list(places))
            where = np.array(list(places.values()), "<f8").tobytes()
            for name, data in (names, (PLACES, where)):
                (self.path / name).mkdir(exist_ok=True)
                chunk = "0" if name == "sensor" else "0.0"
                write_bytes(self.path / name / chunk, sealed(data, self.checksums))
        self._describe(len(places))

    def _describe(self, sensors: int) -> None:
        """Write the descriptions of the arrays, and last of the group.

        A killed run leaves no group, so that its folder is not taken for a store.
        """
        arrays = {v.name: array_of(v, self.samples, self.tile) for v in self.variables}
        if sensors:
            words = {"long_name": "sensor"}
            where = {"long_name": "place of the sensor: east, north, up", "units": "m"}
            names, size = ("sensor",), (sensors,)
            arrays["sensor"] = described(size, size, "string", "", names, words)
            names, size = ("sensor", "direction"), (sensors, 3)
            arrays[PLACES] = described(size, size, "float64", "NaN", names, where)
        for name, array in arrays.items():
            if self.checksums:
                array["codecs"].append(CHECKSUM)
            write_text(self.path / name / GROUP, as_json(array))
        group = {
            "zarr_format": 3,
            "node_type": "group",
            "attributes": self.attributes,
            # inline: a reader opens one file instead of one for each array
            "consolidated_metadata": {
                "kind": "inline",
                "must_understand": False,
                "metadata": arrays,
            },
        }
        write_text(self.path / GROUP, as_json(group))

    def finish(self, samples: int, rows: int | None = None, **more: Any) -> None:
        """Mark the store as complete.

        Args:
            samples: Number of samples of the study.
            rows: Number of stored samples; None for all.
            **more: Further attributes.
        """
        self.samples = samples if rows is None else rows
        self.attributes |= {"complete": True, "samples": samples, **more}
        self._describe(len(self.sensors()))

    def sensors(self) -> tuple[str, ...]:
        """Return the names of the sensors."""
        return next((v.sensors for v in self.variables if v.sensors), ())

    def write_tile(self, tile: int, columns: Mapping[str, np.ndarray]) -> None:
        """Write the chunks of a tile, each completely or not at all.

        Args:
            tile: Number of the tile.
            columns: Values of each column, one row for each sample; missing rows at the
                end are padded.

        Raises:
            OSError: A chunk cannot be written.
        """
        for variable in self.variables:
            # Zarr chunks have one size: the last tile is padded with the fill value
            whole = np.full(
                variable.shape(self.tile), variable.missing, dtype=variable.dtype
            )
            given = columns[variable.name][: self.samples - tile * self.tile]
            whole[: len(given)] = given
            self.write_chunk(variable, tile, whole.tobytes())

    def write_chunk(self, variable: Variable, tile: int, data: bytes) -> None:
        """Write the chunk of a column, completely or not at all."""
        # no fsync of each chunk: a kill loses nothing that the system has
        whole = sealed(data, self.checksums)
        write_bytes(self.chunk_path(variable, tile), whole, durable=False)

    def read_chunk(self, variable: Variable, tile: int) -> bytes:
        """Return the values of a column of a tile.

        Raises:
            InputError: The chunk is missing or damaged.
        """
        size = int(np.prod(variable.shape(self.tile))) * variable.dtype.itemsize
        return read_chunk(self.chunk_path(variable, tile), self.checksums, size)

    def read_tile(self, tile: int, names: Sequence[str] = ()) -> dict[str, np.ndarray]:
        """Return the columns of a complete tile.

        Raises:
            InputError: A chunk is missing or damaged.
        """
        found = {}
        rows = min(self.tile, self.samples - tile * self.tile)
        for variable in self.variables:
            if names and variable.name not in names:
                continue
            whole = np.frombuffer(self.read_chunk(variable, tile), variable.dtype)
            found[variable.name] = whole.reshape(variable.shape(self.tile))[:rows]
        return found

    def parts(self) -> list[tuple[Path, Callable[[int], object]]]:
        """Return folder and reader of each column."""
        return [
            (self.path / v.name, functools.partial(self.read_chunk, v))
            for v in self.variables
        ]

    def chunk_path(self, variable: Variable, tile: int) -> Path:
        """Return the file of a column of a tile."""
        name = f"{tile}.0" if variable.sensors else f"{tile}"
        return self.path / variable.name / name

    def sweep(self) -> None:
        """Delete the partial files of a killed run."""
        for part in self.path.glob("**/.*.part"):
            part.unlink(missing_ok=True)


def open_store(path: str | os.PathLike[str]) -> Store | None:
    """Return the store at a path; None for an empty or missing folder.

    Raises:
        InputError: The folder has other files, or the store of a newer jblast, or the
            names of the sensors are damaged.
    """
    folder = Path(path)
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return None
    group = folder / GROUP
    try:
        document = json.loads(group.read_text())
        attributes = document["attributes"]
        schema = attributes["jblast_study_schema"]
        arrays = document["consolidated_metadata"]["metadata"]
    except FileNotFoundError:
        if {entry.name for entry in folder.iterdir()} <= _names_at_start(folder):
            return None  # a run killed before it wrote the group
        raise InputError(f"{path}: expected {WHAT}, got another folder") from None
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path}: expected {WHAT}, got something else") from None
    if schema != SCHEMA:
        raise InputError(
            f"{path}: expected schema {SCHEMA}, got {shown(schema)}: a newer jblast "
            "wrote it"
        )
    variables = tuple(
        _variable(name, array, arrays)
        for name, array in arrays.items()
        if name not in COORDINATES
    )
    first = arrays[variables[0].name]
    tile = first["chunk_grid"]["configuration"]["chunk_shape"][0]
    checksums = CHECKSUM in first["codecs"]
    if "sensor" in arrays:
        names = read_words(read_chunk(folder / "sensor" / "0", checksums))
        variables = tuple(
            v._replace(sensors=names) if v.sensors else v for v in variables
        )
    samples = first["shape"][0]
    return Store(folder, variables, samples, tile, attributes, checksums=checksums)


def places_of(store: Store) -> dict[str, tuple[float, ...]]:
    """Return the sensor positions of a store, by name."""
    path = store.path / PLACES / "0.0"
    if not path.exists():
        return {}
    size = 8 * 3 * len(store.sensors())
    data = read_chunk(path, store.checksums, size)
    places = np.frombuffer(data, "<f8").reshape(-1, 3)
    return dict(zip(store.sensors(), map(tuple, places.tolist()), strict=True))


def _names_at_start(folder: Path) -> set[str]:
    """Return the entries that a store may have before its group is written."""
    inside = [entry for entry in folder.iterdir() if entry.is_dir()]
    return (
        {
            entry.name
            for entry in inside
            if all(
                p.name in (GROUP, "0", "0.0") or p.suffix == ".part"
                for p in entry.iterdir()
            )
        }
        | {LOCK}
        | {p.name for p in folder.glob(".*.part")}
    )


def _variable(name: str, array: dict[str, Any], arrays: dict[str, Any]) -> Variable:
    attributes = array["attributes"]
    sensors = ()
    if len(array["shape"]) > 1:
        sensors = tuple(str(n) for n in range(arrays["sensor"]["shape"][0]))
    kind = "yes_no" if array["data_type"] == "int8" else "number"
    return Variable(
        name,
        attributes["role"],
        attributes["units"],
        attributes["long_name"],
        kind,
        sensors,
        tuple(attributes.get("names", ())),
    )


def as_json(document: Mapping[str, Any]) -> str:
    """Return a description as the text of its file."""
    # NaN is not JSON: as a fill value it is the word "NaN"
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def array_of(variable: Variable, samples: int, tile: int) -> dict[str, Any]:
    """Return the Zarr description of a column."""
    attributes = variable.attributes()
    if variable.sensors:
        attributes["coordinates"] = PLACES  # by convention of CF, for xarray
    kinds = {"f8": "float64", "i1": "int8", "i2": "int16"}
    kind = kinds[variable.dtype.str[1:]]
    fill = "NaN" if kind == "float64" else variable.missing
    return described(
        variable.shape(samples),
        variable.shape(tile),
        kind,
        fill,
        variable.dims,
        attributes,
    )


def described(
    shape: Sequence[int],
    chunk: Sequence[int],
    kind: str,
    fill: Any,
    dims: Sequence[str],
    attributes: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the Zarr 3 description of an array."""
    codec = {"name": "bytes", "configuration": {"endian": "little"}}
    # one byte has no order of bytes: Zarr forbids the entry
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
        # the default of Zarr 3 nests folders; "v2" needs one folder a column
        "chunk_key_encoding": {"name": "v2", "configuration": {"separator": "."}},
        "fill_value": fill,
        "codecs": [codec],
        "attributes": dict(attributes),
        "dimension_names": list(dims),
    }


def words_chunk(words: Sequence[str]) -> bytes:
    """Return words in the encoding vlen-utf8 of Zarr."""
    encoded = [word.encode() for word in words]
    parts = [len(encoded).to_bytes(4, "little")]
    for word in encoded:
        parts += [len(word).to_bytes(4, "little"), word]
    return b"".join(parts)


def read_words(data: bytes) -> tuple[str, ...]:
    """Return the words of a chunk of `words_chunk`."""
    # vlen-utf8: number of words, then length and bytes of each; 32-bit integers
    at, words = 4, []
    for _ in range(int.from_bytes(data[:4], "little")):
        length = int.from_bytes(data[at : at + 4], "little")
        words.append(data[at + 4 : at + 4 + length].decode())
        at += 4 + length
    return tuple(words)
