"""Flights as a Warp kernel: a whole flight in the registers of one thread.

The kernel is the JAX step, translated to C (`c_code`): vehicle, controller, wind and
loads are those of JAX, a user's too. It is compiled for shapes, not for numbers: every
array of a flight is read from memory at the start, at a stride per vehicle that is zero
for an array that all share. The kernel has no derivatives.
"""

from functools import lru_cache
from typing import Any, NamedTuple, no_type_check

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from jaxtyping import Array, Float, PyTree

from jblast.errors import InputError
from jblast.vehicle.c_code import Code, Element, Untranslatable, ctype, filled, texts
from jblast.vehicle.rollout import MAX_SPLIT_SIZE, FlightState, Simulator, parted
from jblast.vehicle.state import State, Trajectory

wp.config.log_level = wp.LOG_ERROR
"""Warp prints a banner on stdout, which is for results, and warns without a GPU."""
THREADS = 256
"""Threads per block; of 32 to 256 the fastest on an H200, by 6 % with blasts."""
OPTIONS = {"enable_backward": False, "fast_math": True}
"""Compiler options; fast division and roots in float32 on a GPU are twice as fast, with
relative errors near 1e-7."""
FIELDS = (3, 3, 4, 3, 4, 3, 3)
"""Lengths of the vectors of a stored row: those of `Trajectory`."""
IN_REGISTERS = 64
"""Largest array of a flight that is read at the start; larger ones stay in memory."""


class Program(NamedTuple):
    """A kernel and the tables of constants that it reads after the flight's arrays."""

    kernel: Any
    tables: list[np.ndarray]


def fly_on(
    device: Any,
    simulator: Simulator,
    state: State,
    last_s: Float[Array, ""],
    time_s: Float[Array, " time"],
    *,
    batch: tuple[int, ...],
    steps: int,
    store_every: int,
) -> Trajectory:
    """Return the flights of a batch, or of one vehicle, on a device.

    Args:
        device: Warp device.
        simulator: Steps of a vehicle, with floats of one precision.
        state: Initial state.
        last_s: Length of the last step.
        time_s: Times of the stored rows.
        batch: Axes of the batch.
        steps: Number of steps.
        store_every: Steps between rows.

    Raises:
        InputError: The memory of the device is too small for the rows.
        Untranslatable: The step has an operation that has no C code.
    """
    own, shared = parted(simulator, state, batch)
    numbers, rest = eqx.partition(shared, eqx.is_array)
    arrays, tree = jax.tree.flatten((own, numbers, last_s))
    values, form = jax.tree.flatten(rest)
    # Those of `own` come first, with an axis of the vehicles.
    owned = [n < len(jax.tree.leaves(own)) for n in range(len(arrays))]
    shapes = [
        x.shape[1:] if mine else x.shape for x, mine in zip(arrays, owned, strict=True)
    ]
    kinds = tuple((shape, x.dtype) for shape, x in zip(shapes, arrays, strict=True))
    program = program_of(kinds, tree, tuple(values), form)
    lanes, size, real = int(np.prod(batch)), time_s.size, np.dtype(time_s.dtype)
    kind: Any = wp.dtype_from_numpy(real)
    flag: Any = wp.bool
    try:
        rows = [wp.empty((lanes, size, n), dtype=kind, device=device) for n in FIELDS]
    except RuntimeError:
        needed = lanes * size * sum(FIELDS) * real.itemsize / 1e9
        raise InputError(
            f"store_every: {size} rows of {lanes} vehicles take {needed:.3g} GB, more "
            f"than {device} has; increase store_every"
        ) from None
    lost = wp.empty(lanes, dtype=flag, device=device)
    # Shared without a copy, so they must be complete: Warp does not wait for JAX.
    sent = [
        wp.from_jax(jax.block_until_ready(jnp.ravel(x))).to(device)
        for x in (*arrays, *program.tables)
    ]
    strides = [
        mine * int(np.prod(shape)) for shape, mine in zip(shapes, owned, strict=True)
    ]
    pointers = [x.ptr for x in (*rows, lost, *sent)]
    given = [
        wp.array(pointers, dtype=wp.uint64, device=device),
        wp.array(strides, dtype=wp.int64, device=device),
        *(steps, size, store_every),
    ]
    run(program.kernel, lanes, given, device)
    x, v, q, w, speeds, force, moment = (
        wp.to_jax(x).reshape(*batch, *x.shape[1:]) for x in rows
    )
    ended = wp.to_jax(lost).reshape(batch)
    return Trajectory(time_s, x, v, q, w, speeds, force, moment, ended)


def run(kernel: Any, lanes: int, given: list[Any], device: Any) -> None:
    """Run a kernel to its end."""
    wp.launch(kernel, dim=lanes, inputs=given, device=device, block_dim=THREADS)
    # A launch returns before the kernel ends, and JAX does not wait for Warp.
    wp.synchronize_device(device)


def device_named(name: str | None) -> Any:
    """Return a Warp device by name; None: the first GPU, or the CPU.

    Raises:
        InputError: The name is unknown.
    """
    try:
        return wp.get_device(name)
    except (RuntimeError, ValueError):
        known = ", ".join(str(device) for device in wp.get_devices())
        raise InputError(
            f"backend: expected a device of warp:DEVICE among {known}, got {name}"
        ) from None


@lru_cache(maxsize=64)
def program_of(
    kinds: tuple[tuple[tuple[int, ...], Any], ...],
    tree: Any,
    values: tuple[Any, ...],
    form: Any,
) -> Program:
    """Return the kernel of flights with arrays of some shapes.

    Args:
        kinds: Shape and type of each array of one vehicle; the last is the length of
            the last step, in the precision of the flight.
        tree: Structure of (own arrays, shared arrays, length of the last step).
        values: What is no array in the flight.
        form: Structure of `values`.

    Raises:
        Untranslatable: An operation has no C code.
    """
    rest = jax.tree.unflatten(form, values)

    def one(arrays: Any) -> tuple[Simulator, State, Array]:
        own, numbers, last_s = jax.tree.unflatten(tree, arrays)
        return *eqx.combine(own, numbers, rest), last_s

    def start(arrays: Any) -> FlightState:
        simulator, state, _ = one(arrays)
        return simulator.start(state)

    def step(arrays: Any, now: FlightState, n: Array, steps: Array) -> FlightState:
        simulator, _, last_s = one(arrays)
        return simulator.step_of(now, n, steps, last_s)

    def row(arrays: Any, now: FlightState, n: Array) -> PyTree[Array]:
        simulator, _, _ = one(arrays)
        return now.motion, simulator.wrench(now.motion, now.row_wrench, n)

    arrays = [jax.ShapeDtypeStruct(*kind) for kind in kinds]
    real = ctype(kinds[-1][1])
    begun, now = jax.make_jaxpr(start, return_shape=True)(arrays)
    leaves = jax.tree.leaves(now)
    for leaf in leaves:
        if leaf.size > MAX_SPLIT_SIZE:
            raise Untranslatable(f"a controller with a state of {leaf.size} numbers")
    code, number = Code(), jax.ShapeDtypeStruct((), jnp.int32)
    heads, given = _inputs(kinds)
    state = code.variables(leaves)
    code.assign(state, code.run(begun, given))
    taken, count = filled((), ["i"]), filled((), ["steps"])
    with code.block("for(int i=0,r=0;;i++)"):
        with code.block("if(i%every==0||i==steps)"):
            stored = jax.make_jaxpr(row)(arrays, now, number)
            _store(code, real, code.run(stored, [*given, *state, taken]))
        code.lines.append("if(i==steps) break;")
        made = jax.make_jaxpr(step)(arrays, now, number, number)
        code.assign(state, code.run(made, [*given, *state, taken, count]))
    code.lines.append(f"((bool*)data.data[{len(FIELDS)}])[lane]=!alive;")
    pointers = {
        **{f"array{n}": dtype for n, (_, dtype) in enumerate(kinds)},
        **{f"table{n}": table.dtype for n, table in enumerate(code.tables)},
    }
    lines = [
        f"const {ctype(dtype)}* {name}=(const {ctype(dtype)}*)data.data[{place}];"
        for place, (name, dtype) in enumerate(pointers.items(), len(FIELDS) + 1)
    ]
    return Program(kernel_of("\n".join([*lines, *heads, *code.lines])), code.tables)


def _inputs(kinds: Any) -> tuple[list[str], list[np.ndarray]]:
    """Return lines that read the arrays of a vehicle, and their elements."""
    lines, given = ["bool alive=true;"], []
    for n, (shape, _) in enumerate(kinds):
        name, size = f"array{n}", int(np.prod(shape))
        lines.append(f"{name}+=strides.data[{n}]*lane;")
        elements = [Element.of(name, j) for j in range(size)]
        if size <= IN_REGISTERS:
            elements = [Element.of(name, j, f"{name}_{j}") for j in range(size)]
            lines += [f"const auto {x}={x.array}[{x.offset}];" for x in elements]
        given.append(filled(shape, elements))
    return lines, given


def _store(code: Code, real: str, values: list[np.ndarray]) -> None:
    """Write the row `r`: NaN from the first row with a number that is not finite."""
    numbers = [text for value in values for text in texts(value).flat]
    # One test for 23 numbers: a NaN or an infinity in any makes the sum not finite.
    code.lines.append(f"alive=alive&&wp::isfinite({'+'.join(numbers)});")
    for n, length in enumerate(FIELDS):
        code.lines.append(
            f"{real}* row{n}=({real}*)data.data[{n}]+((long long)lane*rows+r)*{length};"
        )
        for j in range(length):
            code.lines.append(f"row{n}[{j}]=alive?{numbers.pop(0)}:({real})NAN;")
    code.lines.append("r++;")


@no_type_check
def kernel_of(snippet: str) -> Any:
    """Return a kernel of which each thread runs C code for its vehicle."""

    @wp.func_native(snippet)
    def fly(
        lane: int,
        data: wp.array[wp.uint64],
        strides: wp.array[wp.int64],
        steps: int,
        rows: int,
        every: int,
    ): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def kernel(
        data: wp.array[wp.uint64],
        strides: wp.array[wp.int64],
        steps: int,
        rows: int,
        every: int,
    ):
        fly(wp.tid(), data, strides, steps, rows, every)

    return kernel
