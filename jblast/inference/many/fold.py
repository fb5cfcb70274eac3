"""A program for one row of one log, run over arrays of rows and lanes.

`vmap` gives every array of such a program a leading lane axis: a position becomes
(lane, 3), a selection of rows a gather, a wind of zero a sum of products with zero.
Here the program's small arrays are taken apart instead: each of their entries is a
*cell*, one array of shape (row, lane), (row, 1), (1, lane) or (1, 1), and every
operation is one of cells. A small array is a NumPy array of objects whose entries are
cells.

Values that depend on the layout alone are computed once, by NumPy where it gives the
same result. Sums with zero and products with zero and one are omitted (zero times
anything is zero), known branches are resolved, common subexpressions are computed once,
and a derivative's $x^{c-1}$ is $x^c / x$. Elementwise arithmetic remains, with the
lanes last, which XLA vectorises best. Primitives that cannot be written in cells raise
`CannotFoldError`. Measured by processor time, fits of 12 arrivals are 1.3 times as fast
as with nested `vmap` (1.5 with one over rows and lanes), and those of 12 arrivals and
pressures by Kingery and Bulmash 1.5 times (3.9).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core import ClosedJaxpr, Literal
from jaxtyping import Array

# Primitives that wrap a jaxpr, which is run in place.
INNER = ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "remat2")
# Primitives that cannot be evaluated entry by entry; most are loops or branches.
NOT_ELEMENTWISE = ("while", "scan", "cond", "sort", "cumsum", "custom_vjp_call")
# Reductions, with the primitive that combines two entries.
REDUCE = {
    "reduce_sum": lax.add_p,
    "reduce_max": lax.max_p,
    "reduce_min": lax.min_p,
    "reduce_and": lax.and_p,
    "reduce_or": lax.or_p,
    "reduce_prod": lax.mul_p,
}
# Scatters, with the operation that combines an entry with its update (None: replace).
SCATTER = {
    "scatter": None,
    "scatter-add": lax.add_p,
    "scatter-mul": lax.mul_p,
    "scatter-min": lax.min_p,
    "scatter-max": lax.max_p,
}
# Primitives that only move entries: they are run on the numbers of the entries.
REARRANGE = [
    "broadcast_in_dim",
    "reshape",
    "squeeze",
    "expand_dims",
    "transpose",
    "slice",
    "rev",
    "gather",
    "dynamic_slice",
    "concatenate",
    "stack",
    "pad",
    "copy",
    "copy_p",
    "split",
    "unstack",
]
BY_NUMPY: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "add_any": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "abs": np.abs,
    "sign": np.sign,
    "max": np.maximum,
    "min": np.minimum,
    "pow": np.power,
    "exp": np.exp,
    "log": np.log,
    "log1p": np.log1p,
    "sqrt": np.sqrt,
    "square": np.square,
    "cbrt": np.cbrt,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "eq": np.equal,
    "ne": np.not_equal,
    "and": np.bitwise_and,
    "or": np.bitwise_or,
    "not": np.bitwise_not,
    "is_finite": np.isfinite,
    "stop_gradient": np.asarray,
    "copy": np.asarray,
    "select_n": lambda which, *cases: np.choose(np.asarray(which, int), cases),
}
"""Operations that NumPy computes for known cells: JAX would compile each call."""
Cell = Any
"""A two-dimensional array: of NumPy for values known at tracing, else of JAX."""


def fold(
    function: Callable[..., Any], arguments: Sequence[Cell]
) -> list[Array | np.ndarray]:
    """Run a function of numbers over cells.

    Args:
        function: Function of scalars that returns a flat sequence of scalars.
        arguments: One cell for each scalar; NumPy arrays count as known at tracing.

    Raises:
        CannotFoldError: The function has a primitive that cannot be folded (a loop).
    """
    shapes = [jax.ShapeDtypeStruct((), a.dtype) for a in arguments]
    closed = jax.make_jaxpr(function)(*shapes)
    inputs = [boxed(uniform(a)) for a in arguments]
    return [cell.item() for cell in _run(Operations(), closed, inputs)]


def over_cells(
    function: Callable[..., Any],
    arguments: Sequence[Cell],
) -> list[Array | np.ndarray]:
    """Run a function of numbers over cells by `fold`, or if that fails by `vmap`.

    Args:
        function: Function of scalars that returns a flat sequence of scalars.
        arguments: One cell for each scalar.
    """
    try:
        return fold(function, arguments)
    except CannotFoldError:
        shape = np.broadcast_shapes(*(a.shape for a in arguments))
        full = [jnp.broadcast_to(a, shape) for a in arguments]
        return list(jax.vmap(jax.vmap(function))(*full))


class Operations:
    """Elementwise operations of cells with a cache (common subexpressions)."""

    def __init__(self) -> None:
        self.known: dict[Any, Cell] = {}
        # Keys contain ids of cells. An id is unique only while its object lives, so
        # cells are kept alive.
        self.kept: list[Cell] = []

    def __call__(self, primitive, cells: list[Cell], params) -> Cell:
        """Return the result of one elementwise operation of cells."""
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
        """Return $x^{c-1}$ as $x^c / x$ if $x^c$ is known; a division costs less."""
        if name != "pow" or not isinstance(cells[1], np.ndarray):
            return None
        higher = self.known.get(("pow", "{}", id(cells[0]), identity(cells[1] + 1.0)))
        return None if higher is None else computed(lax.div_p, [higher, cells[0]], {})


def _run(
    operation: Operations, closed: ClosedJaxpr, inputs: list[np.ndarray]
) -> list[np.ndarray]:
    """Run a jaxpr over boxes of cells."""
    values: dict[Any, np.ndarray] = {}

    def read(var):
        return cells(var.val) if isinstance(var, Literal) else values[var]

    jaxpr = closed.jaxpr
    values.update(zip(jaxpr.constvars, map(cells, closed.consts), strict=True))
    values.update(zip(jaxpr.invars, inputs, strict=True))
    for equation in jaxpr.eqns:
        out = _equation(operation, equation, [read(v) for v in equation.invars])
        values.update(zip(equation.outvars, out, strict=True))
    return [read(v) for v in jaxpr.outvars]


def _equation(
    operation: Operations, equation: Any, inputs: list[np.ndarray]
) -> list[np.ndarray]:
    """Run one equation of a jaxpr over boxes of cells."""
    name, params = equation.primitive.name, equation.params
    if name in INNER:
        inner = params.get("jaxpr", params.get("call_jaxpr"))
        inner = inner if hasattr(inner, "consts") else ClosedJaxpr(inner, ())
        return _run(operation, inner, inputs)
    if all(plain(x) for x in inputs):
        out = at_once(equation.primitive, params, [unboxed(x) for x in inputs])
        return [cells(o) for o in out]
    if name in REARRANGE:
        return rearranged(equation, inputs)
    if name in REDUCE:
        return [reduced(operation, REDUCE[name], inputs[0], params["axes"])]
    if name in SCATTER:
        return [scattered(operation, equation, inputs)]
    if name == "dot_general":
        return [contracted(operation, *inputs, *params["dimension_numbers"])]
    if name in NOT_ELEMENTWISE or equation.effects or len(equation.outvars) > 1:
        raise CannotFoldError(name)
    shapes = [x.shape for x in inputs]
    if np.broadcast_shapes(*shapes) != equation.outvars[0].aval.shape:
        raise CannotFoldError(name)
    return [elementwise(operation, equation.primitive, inputs, params)]


def elementwise(operation: Operations, primitive, inputs, params) -> np.ndarray:
    """Combine arrays of cells entry by entry."""
    shape = np.broadcast_shapes(*(x.shape for x in inputs))
    spread = [np.broadcast_to(x, shape) for x in inputs]
    out = np.empty(shape, object)
    for at in np.ndindex(shape):
        out[at] = operation(primitive, [x[at] for x in spread], params)
    return out


def shortcut(name: str, cells: list[Cell], params) -> Cell | None:
    """Return the result if a known cell (0, 1, a branch) determines it, else None."""
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
        # 0 times inf is 0 here, not NaN: entries that are zero by the layout are left
        # out
        if a == 0 or b == 0:
            return np.zeros((1, 1), cells[0].dtype)
        return cells[1] if a == 1 else cells[0] if b == 1 else None
    if name == "div" and is_float:
        return cells[0] if b == 1 or a == 0 else None
    if name == "and" and not is_float and cells[0].dtype == bool:
        return cells[1] if a == 1 else cells[0] if b == 1 else None
    return None


def computed(primitive, cells: list[Cell], params) -> Cell:
    """Compute an operation, at tracing if all cells are known."""
    shape = np.broadcast_shapes(*(c.shape for c in cells))
    if all(isinstance(c, np.ndarray) for c in cells):
        full = [np.broadcast_to(c, shape) for c in cells]
        return uniform(at_once(primitive, params, full)[0])
    return primitive.bind(*(jnp.broadcast_to(c, shape) for c in cells), **params)


def reduced(
    operation: Operations, primitive, x: np.ndarray, axes: Sequence[int]
) -> np.ndarray:
    """Combine cells along axes by a primitive."""
    kept = [a for a in range(x.ndim) if a not in axes]
    shape = tuple(x.shape[a] for a in kept)
    rows = x.transpose(*kept, *axes).reshape(*shape, -1)
    out = np.empty(shape, object)
    for at in np.ndindex(shape):
        total, *rest = rows[at]
        for cell in rest:
            total = operation(primitive, [total, cell], {})
        out[at] = total
    return out


def scattered(operation: Operations, equation, inputs: list[np.ndarray]) -> np.ndarray:
    """Combine entries of an array with updates at known positions."""
    onto, places, new = inputs
    primitive = SCATTER[equation.primitive.name]
    if not plain(places):
        raise CannotFoldError("scatter to unknown positions")
    params = dict(equation.params) | {"update_jaxpr": None, "update_consts": ()}
    # the primitive itself is run on numbers of updates, which gives where each goes
    numbers = np.arange(new.size, dtype=np.int32).reshape(new.shape)
    with jax.ensure_compile_time_eval():
        nowhere = jnp.full(onto.shape, -1, jnp.int32)
        where = np.asarray(
            lax.scatter_p.bind(nowhere, unboxed(places), numbers, **params)
        )
    if np.unique(where[where >= 0]).size != new.size:
        raise CannotFoldError("scatter of several updates to one position")
    out, flat = onto.copy(), new.ravel()
    for at in np.ndindex(onto.shape):
        if where[at] >= 0:
            pair = [onto[at], flat[where[at]]]
            out[at] = operation(primitive, pair, {}) if primitive else pair[1]
    return out


def contracted(operation: Operations, a, b, contract, batch) -> np.ndarray:
    """Multiply small matrices of cells, for each element of a batch."""

    def matrices(x: np.ndarray, batch, contract) -> tuple[np.ndarray, list[int]]:
        free = [d for d in range(x.ndim) if d not in (*batch, *contract)]
        sizes = [
            math.prod(x.shape[d] for d in dims) for dims in (batch, free, contract)
        ]
        shape = [x.shape[d] for d in (*batch, *free)]
        return x.transpose(*batch, *free, *contract).reshape(sizes), shape

    left, shape = matrices(a, batch[0], contract[0])
    right, ahead = matrices(b, batch[1], contract[1])
    pairs = [left[:, :, None], right[:, None]]
    products = elementwise(operation, lax.mul_p, pairs, {})
    out = reduced(operation, lax.add_p, products, [3])
    return out.reshape(*shape, *ahead[len(batch[1]) :])


def rearranged(equation, inputs: list[np.ndarray]) -> list[np.ndarray]:
    """Run a primitive that only moves entries: on their numbers, then look them up."""
    name = equation.primitive.name
    moved = inputs if name in ("concatenate", "stack", "pad") else inputs[:1]
    if not all(plain(x) for x in inputs[len(moved) :]):
        raise CannotFoldError(f"{name} at unknown positions")
    numbers, start = [], 0
    for x in moved:
        number = np.arange(start, start + x.size, dtype=np.int32)
        numbers.append(number.reshape(x.shape))
        start += x.size
    rest = [unboxed(x) for x in inputs[len(moved) :]]
    every = np.concatenate([x.ravel() for x in moved])
    params = dict(equation.params)
    if name == "gather":
        params["fill_value"] = -1  # marks entries outside of the array
    found = []
    for where in at_once(equation.primitive, params, [*numbers, *rest]):
        if (where < 0).any():
            raise CannotFoldError("gather outside of its array")
        # entry by entry: indexing by an array of no dimensions would return the cell
        # itself
        out = np.empty(where.shape, object)
        for at in np.ndindex(where.shape):
            out[at] = every[where[at]]
        found.append(out)
    return found


def by_numpy(primitive, params, inputs: list[np.ndarray]) -> np.ndarray | None:
    """Return the result by NumPy if it has the same meaning there; else None."""
    name, x = primitive.name, inputs[0] if inputs else None
    floating = all(i.dtype.kind in "fb" for i in inputs)
    with np.errstate(all="ignore"):
        if name in BY_NUMPY and (floating or name not in ("div", "pow", "sign")):
            return np.asarray(BY_NUMPY[name](*inputs))
        if x is None:
            return None
        if name == "convert_element_type":
            return np.asarray(x, params["new_dtype"])
        if name == "integer_pow":
            power = float(params["y"])
            return np.asarray(np.power(x, power)) if floating else None
    if name == "broadcast_in_dim":
        shape = [1] * len(params["shape"])
        for size, dim in zip(x.shape, params["broadcast_dimensions"], strict=True):
            shape[dim] = size
        return np.broadcast_to(x.reshape(shape), params["shape"])
    if name == "reshape":
        return x.reshape(params["new_sizes"])
    if name == "squeeze":
        return np.squeeze(x, params["dimensions"])
    if name == "transpose":
        return x.transpose(params["permutation"])
    if name == "concatenate":
        return np.concatenate(inputs, params["dimension"])
    if name == "stack":
        return np.stack(inputs, params["axis"])
    if name == "slice":
        steps = params["strides"] or [1] * x.ndim
        ends = zip(params["start_indices"], params["limit_indices"], steps, strict=True)
        return x[tuple(slice(*end) for end in ends)]
    return None


def at_once(primitive, params, inputs: list[np.ndarray]) -> list[np.ndarray]:
    """Compute at tracing: by NumPy, or if that is not possible by JAX."""
    out = by_numpy(primitive, params, inputs)
    if out is not None:
        return [out]
    with jax.ensure_compile_time_eval():
        out = primitive.bind(*map(jnp.asarray, inputs), **params)
    return [np.asarray(o) for o in (out if primitive.multiple_results else [out])]


class CannotFoldError(Exception):
    """The program has an operation that cannot be written in cells."""


def boxed(cell: Cell) -> np.ndarray:
    """Return an object array of no dimensions with one cell."""
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
    """Return True if every cell of a box is a single known number."""
    return all(isinstance(c, np.ndarray) and c.size == 1 for c in x.ravel())


def unboxed(x: np.ndarray) -> np.ndarray:
    """Return the numbers of a plain box."""
    if x.size == 0:
        return np.zeros(x.shape)
    return np.array([c.item() for c in x.ravel()], x.ravel()[0].dtype).reshape(x.shape)


def uniform(cell: Cell) -> Cell:
    """Return a known cell of equal values as a single number, else the cell."""
    if isinstance(cell, np.ndarray) and cell.size > 1:
        first = cell[:1, :1]
        if np.array_equal(cell, np.broadcast_to(first, cell.shape), equal_nan=True):
            return first
    return cell


def number(cell: Cell) -> float | None:
    """Return the number of a cell with a single known value, else None."""
    if isinstance(cell, np.ndarray) and cell.size == 1:
        return float(cell.item())
    return None


def identity(cell: Cell) -> Any:
    """Return a key that equal cells share."""
    if isinstance(cell, np.ndarray) and cell.size == 1:
        return cell.dtype.str, cell.item()
    return id(cell)
