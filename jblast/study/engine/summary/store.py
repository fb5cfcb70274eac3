"""Statistics of tiles on disk: a Zarr group of its own within the store of a study.

Of each tile and outcome there is a chunk of what its state is made of, written whole or
not at all; counts of sketches, most of which are none, are packed by gzip. A tile is
done when all its chunks are whole. Tiles merged in their order are the whole study.
"""

import gzip
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jblast.files import write_bytes, write_text
from jblast.study.engine.summary.states import (
    NUMBERS,
    SHARES,
    Anchor,
    State,
    outcomes_of,
    packed,
    shape_of,
    unpacked,
)
from jblast.study.engine.variable import Variable
from jblast.study.engine.zarr_format import as_json, described
from jblast.study.statistics.quantile_sketch import BINS

FOLDER = "summary"
GROUP = "zarr.json"
PACKED = "counts"
ANCHOR = ".anchor"
GZIP = {"name": "gzip", "configuration": {"level": 1}}
PARTS = {
    "number": {"moments": ("float64", len(NUMBERS)), PACKED: ("int64", BINS)},
    "yes_no": {"share": ("int64", len(SHARES))},
}
LAST = {"moments": "moment", PACKED: "bin", "share": "count"}


class SummaryStore:
    """The statistics of a study's tiles.

    Attributes:
        path: Folder of the group.
        variables: Columns of the study.
        groups: Variants and cells, as one number.
        tiles: How many there are.
    """

    def __init__(
        self,
        store: str | os.PathLike[str],
        variables: Sequence[Variable],
        groups: int,
        tiles: int,
    ) -> None:
        self.path = Path(store) / FOLDER
        self.variables, self.groups, self.tiles = tuple(variables), groups, tiles

    def create(self, anchors: Mapping[str, Anchor], tile: int) -> None:
        """Make it, with no tile in it.

        Args:
            anchors: What numbers are counted from.
            tile: Samples of a tile.

        Raises:
            OSError: It cannot be written.
        """
        arrays = {}
        for v, part, shape, kind in self._arrays():
            name = f"{v.name}.{part}"
            arrays[name] = self._described(v, part, shape, kind)
            (self.path / name).mkdir(parents=True, exist_ok=True)
        for name, anchor in anchors.items():
            whole = np.stack(anchor, -1).astype("<f8")
            key = f"{name}{ANCHOR}"
            dims = ("group", "sensor", "anchor")[-whole.ndim :]
            if whole.ndim == 2:
                dims = ("group", "anchor")
            said = {"long_name": f"shift of the sums and origin of the bins of {name}"}
            arrays[key] = described(
                whole.shape, whole.shape, "float64", "NaN", dims, said
            )
            (self.path / key).mkdir(parents=True, exist_ok=True)
            write_bytes(self.path / key / _chunk(0, whole.ndim), whole.tobytes())
        for name, array in arrays.items():
            write_text(self.path / name / GROUP, as_json(array))
        group = {
            "zarr_format": 3,
            "node_type": "group",
            "attributes": {
                "tile": tile,
                "moments": list(NUMBERS),
                "shares": list(SHARES),
            },
            "consolidated_metadata": {
                "kind": "inline",
                "must_understand": False,
                "metadata": arrays,
            },
        }
        write_text(self.path / GROUP, as_json(group))

    def _arrays(self):
        for v in outcomes_of(self.variables):
            for part, (kind, last) in PARTS[v.kind].items():
                yield v, part, (*shape_of(v, self.groups), last), kind

    def _described(
        self, v: Variable, part: str, shape: tuple[int, ...], kind: str
    ) -> dict[str, Any]:
        sensors = ("sensor",) if v.sensors else ()
        dims = ("tile", "group", *sensors, LAST[part])
        said = {"units": v.units, "long_name": f"{part} of {v.name}, tile by tile"}
        fill = "NaN" if kind == "float64" else 0
        array = described((self.tiles, *shape), (1, *shape), kind, fill, dims, said)
        if part == PACKED:
            array["codecs"].append(GZIP)
        return array

    @property
    def there(self) -> bool:
        """Whether it was made."""
        return (self.path / GROUP).exists()

    def tile_samples(self) -> int:
        """Return how many samples a tile has, but for the last of a study."""
        return int(json.loads((self.path / GROUP).read_text())["attributes"]["tile"])

    def tiles_said(self) -> int:
        """Return how many tiles it says that it has when it is complete."""
        arrays = json.loads((self.path / GROUP).read_text())["consolidated_metadata"]
        shapes = [
            array["shape"][0]
            for name, array in arrays["metadata"].items()
            if not name.endswith(ANCHOR)
        ]
        return int(shapes[0])

    def resized(self, tiles: int, tile: int) -> None:
        """Say that there are so many tiles."""
        self.tiles = tiles
        self.create(self.anchors(), tile)

    def anchors(self) -> dict[str, Anchor]:
        """Return what numbers are counted from."""
        found = {}
        for v in outcomes_of(self.variables):
            if v.kind == "number":
                shape = (*shape_of(v, self.groups), 2)
                path = self.path / f"{v.name}{ANCHOR}" / _chunk(0, len(shape))
                whole = np.frombuffer(path.read_bytes(), "<f8").reshape(shape)
                found[v.name] = Anchor(whole[..., 0], whole[..., 1])
        return found

    def write(self, tile: int, states: Mapping[str, State]) -> None:
        """Write the states of a tile, each chunk whole or not at all.

        Raises:
            OSError: A chunk cannot be written.
        """
        for v in outcomes_of(self.variables):
            for part, array in packed(v, states[v.name]).items():
                kind = PARTS[v.kind][part][0]
                data = np.ascontiguousarray(array, f"<{kind[0]}8").tobytes()
                if part == PACKED:
                    data = gzip.compress(data, 1, mtime=0)
                write_bytes(self.chunk_path(v, part, tile), data, durable=False)

    def read(self, tile: int, anchors: Mapping[str, Anchor]) -> dict[str, State]:
        """Return the states of a tile that is done."""
        found: dict[str, dict[str, np.ndarray]] = {}
        for v, part, shape, kind in self._arrays():
            data = self.chunk_path(v, part, tile).read_bytes()
            if part == PACKED:
                data = gzip.decompress(data)
            whole = np.frombuffer(data, f"<{kind[0]}8").reshape(shape)
            found.setdefault(v.name, {})[part] = whole
        return {
            v.name: unpacked(v, found[v.name], anchors)
            for v in outcomes_of(self.variables)
        }

    def done(self) -> set[int]:
        """Return the tiles that are there, whole."""
        there: set[int] | None = None
        for v, part, shape, _ in self._arrays():
            size = 8 * int(np.prod(shape))
            whole = set()
            folder = self.path / f"{v.name}.{part}"
            for path in folder.iterdir():
                number = path.name.partition(".")[0]
                if number.isdigit() and _size(path, part) == size:
                    whole.add(int(number))
            there = whole if there is None else there & whole
        return {tile for tile in there or () if tile < self.tiles}

    def chunk_path(self, v: Variable, part: str, tile: int) -> Path:
        """Return the file of a part of a tile."""
        dims = len(shape_of(v, self.groups)) + 2
        return self.path / f"{v.name}.{part}" / _chunk(tile, dims)


def _chunk(tile: int, dims: int) -> str:
    return ".".join([str(tile), *["0"] * (dims - 1)])


def _size(path: Path, part: str) -> int:
    """Return how many bytes a chunk holds; -1 of one that was cut off."""
    size = path.stat().st_size
    if part != PACKED:
        return size
    if size < 18:  # head and tail of gzip
        return -1
    with path.open("rb") as file:  # a chunk ends with its size
        file.seek(-4, os.SEEK_END)
        return int.from_bytes(file.read(), "little")
