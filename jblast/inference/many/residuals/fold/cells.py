"""A cell: one entry of a small array, as an array over rows and lanes.

Boxes are NumPy arrays of objects whose entries are cells, of the small array's shape.
"""

from typing import Any

import numpy as np

Cell = Any
"""A NumPy array where it is known beforehand, else a JAX array; of two dimensions."""


class CannotFoldError(Exception):
    """The program holds an operation that cannot be taken apart."""


def boxed(cell: Cell) -> np.ndarray:
    """Return a box of no dimensions, which holds one cell."""
    box = np.empty((), object)
    box[()] = cell
    return box


def cells(values: Any) -> np.ndarray:
    """Return an array of plain numbers as cells of (1, 1)."""
    values = np.asarray(values)
    out = np.empty(values.shape, object)
    for at in np.ndindex(values.shape):
        out[at] = np.asarray(values[at]).reshape(1, 1)
    return out


def plain(x: np.ndarray) -> bool:
    """Return whether every cell of a box is one number known beforehand."""
    return all(isinstance(c, np.ndarray) and c.size == 1 for c in x.ravel())


def unboxed(x: np.ndarray) -> np.ndarray:
    """Return the numbers of a plain box."""
    if x.size == 0:
        return np.zeros(x.shape)
    return np.array([c.item() for c in x.ravel()], x.ravel()[0].dtype).reshape(x.shape)


def uniform(cell: Cell) -> Cell:
    """Return a known cell that is the same everywhere as one number."""
    if isinstance(cell, np.ndarray) and cell.size > 1:
        first = cell[:1, :1]
        if np.array_equal(cell, np.broadcast_to(first, cell.shape), equal_nan=True):
            return first
    return cell


def number(cell: Cell) -> float | None:
    """Return the number a cell is everywhere, if that is known."""
    if isinstance(cell, np.ndarray) and cell.size == 1:
        return float(cell.item())
    return None


def identity(cell: Cell) -> Any:
    """Return what two cells share if they are the same."""
    if isinstance(cell, np.ndarray) and cell.size == 1:
        return cell.dtype.str, cell.item()
    return id(cell)
