"""One elementwise operation of cells: computed once, and only if it has to be."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import lax

from jblast.inference.many.residuals.fold.cells import Cell, identity, number, uniform
from jblast.inference.many.residuals.fold.constants import at_once


class Operations:
    """Remembers what was computed."""

    def __init__(self) -> None:
        self.known: dict[Any, Cell] = {}
        self.kept: list[Cell] = []  # an id is good while its object lives

    def __call__(self, primitive, cells: list[Cell], params) -> Cell:
        """Compute one elementwise operation of cells, if it has to be computed."""
        name = primitive.name
        short = shortcut(name, cells, params)
        if short is not None:
            return short
        key = (name, str(params), *(identity(c) for c in cells))
        if key not in self.known:
            cell = self._lower_power(name, cells)
            if cell is None:
                cell = computed(primitive, cells, params)
            self.known[key] = cell
            self.kept += cells
        return self.known[key]

    def _lower_power(self, name: str, cells: list[Cell]) -> Cell | None:
        """Return a power by the next higher one, if that is known."""
        if name != "pow" or not isinstance(cells[1], np.ndarray):
            return None
        higher = self.known.get(("pow", "{}", id(cells[0]), identity(cells[1] + 1.0)))
        return None if higher is None else computed(lax.div_p, [higher, cells[0]], {})


def shortcut(name: str, cells: list[Cell], params) -> Cell | None:
    """Return the answer where a cell known beforehand gives it."""
    if name == "select_n" and isinstance(cells[0], np.ndarray) and cells[0].size == 1:
        return cells[1 + int(cells[0].item())]
    if name == "convert_element_type" and cells[0].dtype == params["new_dtype"]:
        return cells[0]
    if name in ("copy", "stop_gradient"):
        return cells[0]
    if len(cells) != 2:
        return None
    a, b = (number(c) for c in cells)
    is_float = jnp.issubdtype(cells[0].dtype, jnp.floating)
    if name in ("add", "add_any"):
        return cells[1] if a == 0 else cells[0] if b == 0 else None
    if name == "sub" and b == 0:
        return cells[0]
    if name == "mul":
        if a == 0 or b == 0:
            return np.zeros((1, 1), cells[0].dtype)
        return cells[1] if a == 1 else cells[0] if b == 1 else None
    if name == "div" and is_float:
        return cells[0] if b == 1 or a == 0 else None
    if name == "and" and not is_float and cells[0].dtype == bool:
        return cells[1] if a == 1 else cells[0] if b == 1 else None
    return None


def computed(primitive, cells: list[Cell], params) -> Cell:
    """Compute, now if all is known."""
    shape = np.broadcast_shapes(*(c.shape for c in cells))
    if all(isinstance(c, np.ndarray) for c in cells):
        full = [np.broadcast_to(c, shape) for c in cells]
        return uniform(at_once(primitive, params, full)[0])
    return primitive.bind(*(jnp.broadcast_to(c, shape) for c in cells), **params)
