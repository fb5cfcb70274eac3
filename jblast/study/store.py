"""Store of a study on disk: a Zarr group that can be read before it is complete.

A column has the dimensions draw, axes and sensor; its chunks are slabs. The group
"moments" has the seven moments of each slab, case and sensor. zarr-python writes a
chunk completely or not at all, with a checksum. Moments are written after the samples:
a slab is done when all its chunks are intact and its moments count all its draws, so no
other record of progress is needed, and writing a slab twice changes nothing.
"""

import contextlib
import errno
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np

from jblast.errors import InputError, require, shown
from jblast.study.statistics import Moments

if TYPE_CHECKING:
    import zarr

SCHEMA = 2
"""Version of the attributes and columns: `jblast_study_schema`."""
MOMENTS = "moments"
"""Name of the group with the moments of each slab."""
PLACES = "sensor_position_m"
Role = Literal["input", "axis", "outcome"]
Kind = Literal["number", "yes_no"]


class Variable(NamedTuple):
    """A column or an axis of a study.

    Attributes:
        name: Name of the parameter, axis or outcome.
        role: Input (sampled from a prior), axis or outcome.
        units: Unit of the values; "1" for none.
        long_name: Description.
        kind: A number, or yes (1), no (0) and failed (-1).
        sensors: Names of the sensors with a value each; () for one value a sample.
        values: Values of an axis, numbers or words.
    """

    name: str
    role: Role
    units: str
    long_name: str
    kind: Kind = "number"
    sensors: tuple[str, ...] = ()
    values: tuple[Any, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values of a sample."""
        return (len(self.sensors),) if self.sensors else ()

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the column in the store."""
        found: dict[str, Any] = {
            "role": self.role,
            "units": self.units,
            "long_name": self.long_name,
        }
        return found | ({"kind": self.kind} if self.role == "outcome" else {})


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
    # the folder itself: a file in it would be no part of a Zarr group
    file = os.open(path, os.O_RDONLY)  # closed with the process
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{path}: expected one process that writes this study, got another "
                "one; wait for it, or write to another store"
            ) from None
        except OSError as error:  # a file system without locks
            if error.errno not in (errno.EBADF, errno.ENOLCK, errno.ENOTSUP):
                raise
        yield
    finally:
        os.close(file)


class Store:
    """Store of a study.

    Attributes:
        group: Group of Zarr, on disk or in memory.
        path: Folder, or a name for messages.
        outcomes: Names of the outcomes.
        faults: Messages on damaged chunks by slab, as far as they were read.
    """

    def __init__(self, group: "zarr.Group", path: str | os.PathLike[str]) -> None:
        self.group, self.path = group, Path(path)
        self.columns: tuple[str, ...] = tuple(self.attributes["columns"])
        self.outcomes: tuple[str, ...] = tuple(self.attributes["outcomes"])
        self.faults: dict[int, str] = {}

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the group."""
        return self.group.attrs.asdict()

    @property
    def slab(self) -> int:
        """Number of draws of a slab."""
        return self.attributes["slab"]

    @property
    def draws(self) -> int:
        """Number of draws of the complete study."""
        return self.attributes["draws"]

    @property
    def keep(self) -> int:
        """Number of draws of which samples are stored."""
        return min(self.attributes["keep"], self.draws)

    @property
    def slabs(self) -> int:
        """Number of slabs."""
        return -(-self.draws // self.slab)

    def rows(self, n: int) -> slice:
        """Return the stored draws of a slab."""
        return slice(n * self.slab, min((n + 1) * self.slab, self.keep))

    def write(
        self, n: int, columns: Mapping[str, np.ndarray], states: Mapping[str, Moments]
    ) -> None:
        """Write a slab: its samples, and last its moments.

        Args:
            n: Number of the slab.
            columns: Values by name, shape (draw, case) or (draw, case, sensor).
            states: Moments by name of the outcome.

        Raises:
            OSError: A chunk cannot be written.
        """
        for name, values in columns.items():
            array = self.array(name)
            array[self.rows(n)] = values.reshape(len(values), *array.shape[1:])
        for name, state in states.items():
            array = self.array(f"{MOMENTS}/{name}")
            whole = np.stack([np.asarray(part, float) for part in state])
            array[n] = whole.reshape(array.shape[1:])

    def array(self, name: str) -> "zarr.Array[Any]":
        """Return an array of the store."""
        found = cast("zarr.Array[Any]", self.group[name])
        # else a chunk of missing values would not be written, and never be done
        return found.with_config({"write_empty_chunks": True})

    def states(self, n: int) -> dict[str, Moments] | None:
        """Return the moments of a slab by outcome; None if a chunk is not intact."""
        if n * self.slab < self.keep:
            rows = self.rows(n)
            if any(self._read(q, n, rows) is None for q in self.columns):
                return None
        found = {}
        for name in self.outcomes:
            flat = self._read(f"{MOMENTS}/{name}", n, n)
            draws = min(self.slab, self.draws - n * self.slab)
            # other draws: the last slab of a study with fewer samples
            if flat is None or (flat[:3].sum(axis=0) != draws).any():
                return None
            found[name] = Moments(*flat)
        return found

    def _read(self, name: str, n: int, where: int | slice) -> np.ndarray | None:
        """Return the values of a chunk; None if it is missing or damaged."""
        array = self.array(name)
        about: Any = array.metadata  # of the third format, which has names
        key = about.encode_chunk_key((n, *(0,) * (array.ndim - 1)))
        if not (self.path / name / key).exists():
            return None
        try:
            values = np.asarray(array[where])
        except ValueError as error:
            self.faults[n] = f"{name}: {error}"
            return None
        sensors = values.shape[-1:] if "sensor" in about.dimension_names else ()
        return values.reshape(len(values), -1, *sensors)

    def resized(self, draws: int, attributes: Mapping[str, Any]) -> None:
        """Set the number of draws, and further attributes."""
        whole = {**self.attributes, **attributes, "draws": draws}
        sizes = dict.fromkeys(self.columns, min(whole["keep"], draws))
        for name in self.outcomes:
            sizes[f"{MOMENTS}/{name}"] = -(-draws // self.slab)
        for name, size in sizes.items():
            array = self.array(name)
            array.resize((size, *array.shape[1:]))
        # last: a killed run leaves the old attributes, and resizes again
        self.group.update_attributes(whole)

    def sweep(self) -> None:
        """Delete the partial files of a killed run."""
        for part in self.path.glob("**/*.partial"):
            part.unlink(missing_ok=True)


def open_store(path: str | os.PathLike[str]) -> Store | None:
    """Return the store at a path; None for an empty or missing folder.

    Raises:
        InputError: The folder has other files, or the store of another schema.
    """
    import zarr

    folder = Path(path)
    if not folder.exists() or not any(folder.iterdir()):
        return None
    try:
        group = zarr.open_group(folder, mode="r+")
    except (OSError, ValueError):
        raise InputError(
            f"{path}: expected the store of a study, got another folder"
        ) from None
    schema = group.attrs.get("jblast_study_schema")
    if schema is None:
        return None  # a run killed before it wrote the attributes
    got = f"{shown(schema)}: another version of jblast wrote it"
    require(schema == SCHEMA, path, f"schema {SCHEMA}", got)
    return Store(group, folder)


def opened_store(path: str | os.PathLike[str]) -> Store:
    """Return the store at a path.

    Raises:
        InputError: There is none.
    """
    store = open_store(path)
    if store is None:
        raise InputError(f"{path}: no such store; expected a store of jblast study")
    return store
