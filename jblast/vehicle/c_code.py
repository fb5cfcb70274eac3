"""C code of a JAX program of few numbers: each element of an array is a C variable.

`Code.run` walks a jaxpr. An array of the program is either a constant, a NumPy array of
numbers, or a NumPy array of objects, the names of C variables. An operation of elements
adds a line for each of them. One that moves elements moves their numbers, by JAX
itself, and so their names. Conditions and loops become those of C. Operations of
constants are evaluated. An array that is read at a computed place is one in memory: an
input, a table of constants or a local array.

Equal expressions are one variable, since the programs repeat many.
"""

import functools
import itertools
import operator
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

TYPES = {
    "float32": "float",
    "float64": "double",
    "int32": "int",
    "int64": "long long",
    "uint32": "unsigned",
    "bool": "bool",
}
ELEMENTS = {
    "convert_element_type": "({kind})({0})",
    "neg": "-{0}",
    "abs": "wp::abs({0})",
    "sign": "{0}!={0}?{0}:({0}>0)-({0}<0)",
    "square": "{0}*{0}",
    "sqrt": "wp::sqrt({0})",
    "rsqrt": "1/wp::sqrt({0})",
    "cbrt": "wp::cbrt({0})",
    "exp": "wp::exp({0})",
    "expm1": "(wp::exp({0})+1)*wp::tanh({0}/2)",
    "log": "wp::log({0})",
    "sin": "wp::sin({0})",
    "cos": "wp::cos({0})",
    "tan": "wp::tan({0})",
    "asin": "wp::abs({0})<=1?wp::asin({0}):NAN",
    "acos": "wp::abs({0})<=1?wp::acos({0}):NAN",
    "atan": "wp::atan({0})",
    "atan2": "wp::atan2({0},{1})",
    "sinh": "wp::sinh({0})",
    "cosh": "wp::cosh({0})",
    "tanh": "wp::tanh({0})",
    "erf": "wp::erf({0})",
    "logistic": "1/(1+wp::exp(-{0}))",
    "floor": "wp::floor({0})",
    "ceil": "wp::ceil({0})",
    "is_finite": "wp::isfinite({0})",
    "pow": "wp::pow({0},{1})",
    "rem": "wp::mod({0},{1})",
    "add": "{0}+{1}",
    "add_any": "{0}+{1}",
    "sub": "{0}-{1}",
    "mul": "{0}*{1}",
    "div": "{0}/{1}",
    "max": "{0}>{1}||{0}!={0}?{0}:{1}",
    "min": "{0}<{1}||{0}!={0}?{0}:{1}",
    "lt": "{0}<{1}",
    "lt_to": "{0}<{1}",
    "le_to": "{0}<={1}",
    "le": "{0}<={1}",
    "gt": "{0}>{1}",
    "ge": "{0}>={1}",
    "eq": "{0}=={1}",
    "ne": "{0}!={1}",
    "and": "{0}&{1}",
    "or": "{0}|{1}",
    "xor": "{0}^{1}",
    "clamp": "{1}<{0}?{0}:{1}>{2}?{2}:{1}",
}
"""Expressions of elements by operation; `{0}` is the first argument, `{kind}` the type
of the result.

Those of Warp lose a NaN in `max` and `min`, and clip the argument of `asin` and `acos`.
"""
CALLS = (
    *("jit", "pjit", "closed_call", "core_call", "remat", "remat2", "checkpoint"),
    *("custom_jvp_call", "custom_vjp_call", "call_hi_primitive"),
)
READS = ("dynamic_slice", "gather")
MOVES = (
    *READS,
    *("broadcast_in_dim", "concatenate", "copy", "expand_dims", "pad", "reshape"),
    *("rev", "slice", "split", "squeeze", "stack", "stop_gradient", "transpose"),
    "unstack",
)
"""Operations whose results are elements of their arguments; `READS`: of the first."""
REDUCTIONS = {
    "reduce_sum": "add",
    "reduce_prod": "mul",
    "reduce_max": "max",
    "reduce_min": "min",
    "reduce_and": "and",
    "reduce_or": "or",
}
LARGEST = 1024
"""Largest number of elements of which each becomes a line of code."""


class Untranslatable(Exception):
    """An operation or an array that has no C code; the message names it."""


class Element(str):
    """Text of an element of an array in memory.

    Attributes:
        array: C expression of the array.
        offset: Index of the element.
    """

    array: str
    offset: int

    @classmethod
    def of(cls, array: str, offset: int, text: str | None = None) -> "Element":
        """Return an element; `text`: a variable that holds it."""
        made = cls(text or f"{array}[{offset}]")
        made.array, made.offset = array, offset
        return made


def ctype(dtype: Any) -> str:
    """Return the C type of numbers.

    Raises:
        Untranslatable: There is none.
    """
    if str(dtype) not in TYPES:
        raise Untranslatable(f"numbers of the type {dtype}")
    return TYPES[str(dtype)]


def literal(number: Any) -> str:
    """Return a number in C."""
    kind, value = ctype(number.dtype), repr(number.item())
    named = {"nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY"}
    return f"({kind})({named.get(value, value.lower())})"


def filled(shape: tuple[int, ...], elements: Iterable[str]) -> np.ndarray:
    """Return an array of objects."""
    array = np.empty(int(np.prod(shape)), object)
    for n, element in enumerate(elements):
        array[n] = element
    return array.reshape(shape)


def texts(array: np.ndarray) -> np.ndarray:
    """Return the C texts of an array."""
    if array.dtype == object:
        return array
    return filled(array.shape, map(literal, array.ravel()))


def size_of(aval: Any) -> int:
    """Return the number of elements of an array.

    Raises:
        Untranslatable: There are too many for a line each.
    """
    size = int(np.prod(aval.shape))
    if size > LARGEST:
        raise Untranslatable(f"an array of {size} numbers")
    return size


class Code:
    """Lines of C.

    Attributes:
        lines: The lines.
        tables: Constant arrays in memory, which the lines call `table0`, `table1`, ...
    """

    def __init__(self) -> None:
        """Begin without lines."""
        self.lines: list[str] = []
        self.tables: list[np.ndarray] = []
        self._count = itertools.count()
        self._known: dict[tuple[str, str], str] = {}
        self._tables: dict[tuple[str, str], str] = {}

    def name(self) -> str:
        """Return a new name."""
        return f"v{next(self._count)}"

    def let(self, kind: str, text: str) -> str:
        """Return the variable of an expression."""
        key = kind, text
        if key not in self._known:
            name = self._known[key] = self.name()
            self.lines.append(f"const {kind} {name}={text};")
        return self._known[key]

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Write lines into a block, outside of which its variables are unknown."""
        known = dict(self._known)
        self.lines.append(head + "{")
        yield
        self.lines.append("}")
        self._known = known

    def variables(self, avals: Sequence[Any]) -> list[np.ndarray]:
        """Declare arrays of variables that are assigned later."""
        made = [
            filled(aval.shape, (self.name() for _ in range(size_of(aval))))
            for aval in avals
        ]
        for names, aval in zip(made, avals, strict=True):
            self.lines += [f"{ctype(aval.dtype)} {name};" for name in names.flat]
        return made

    def assign(
        self, variables: Sequence[np.ndarray], values: Sequence[np.ndarray]
    ) -> None:
        """Assign all values at once: some may be the variables themselves."""
        pairs = [
            (self.name(), name, text)
            for names, value in zip(variables, values, strict=True)
            for name, text in zip(names.flat, texts(value).flat, strict=True)
        ]
        self.lines += [f"const auto {new}={text};" for new, _, text in pairs]
        self.lines += [f"{name}={new};" for new, name, _ in pairs]

    def memory(self, array: np.ndarray) -> str:
        """Return a C expression of an array in memory with these elements."""
        if not unknown(array):
            key = str(array.dtype), array.tobytes().hex()
            if key not in self._tables:
                self._tables[key] = f"table{len(self.tables)}"
                self.tables.append(array)
            return self._tables[key]
        elements = list(array.flat)
        first = elements[0]
        if isinstance(first, Element) and all(
            isinstance(x, Element)
            and (x.array, x.offset) == (first.array, first.offset + n)
            for n, x in enumerate(elements)
        ):
            return f"({first.array}+{first.offset})"
        kind, name = self.name(), self.name()
        self.lines.append(f"using {kind}=decltype({first}+0);")
        self.lines.append(f"const {kind} {name}[]={{{','.join(elements)}}};")
        return name

    def run(
        self, closed: ClosedJaxpr, arguments: Sequence[np.ndarray]
    ) -> list[np.ndarray]:
        """Write a program and return its results.

        Raises:
            Untranslatable: An operation has no C code.
        """
        jaxpr, values = closed.jaxpr, {}

        def read(var: Any) -> np.ndarray:
            if isinstance(var, Literal):
                aval: Any = var.aval  # a Python number has the program's precision
                return np.asarray(var.val, aval.dtype)
            return values[var]

        values.update(zip(jaxpr.constvars, map(np.asarray, closed.consts), strict=True))
        values.update(zip(jaxpr.invars, arguments, strict=True))
        for equation in jaxpr.eqns:
            made = self.results(equation, [read(var) for var in equation.invars])
            values.update(zip(equation.outvars, made, strict=True))
        return [read(var) for var in jaxpr.outvars]

    def results(
        self, equation: Any, given: Sequence[np.ndarray]
    ) -> Sequence[np.ndarray]:
        """Write an operation and return its results."""
        name, params = equation.primitive.name, equation.params
        out = [var.aval for var in equation.outvars]
        if name in CALLS:
            return self.run(called(params), given)
        if name in CONTROL:
            return CONTROL[name](self, params, out, *given)
        if not any(map(unknown, given)):
            return evaluated(equation, given)
        if name in MOVES and not (name in READS and any(map(unknown, given[1:]))):
            return moved(equation, given)
        if name in ELEMENTS:
            return [self.each(out[0], ELEMENTS[name], *given)]
        if name in ARRAYS:
            return [ARRAYS[name](self, params, out[0], *given)]
        raise Untranslatable(f"the operation {name}")

    def each(self, aval: Any, form: str, *arrays: np.ndarray) -> np.ndarray:
        """Write an expression of each element."""
        size_of(aval)
        columns = [np.broadcast_to(texts(x), aval.shape).flat for x in arrays]
        kind, lines = ctype(aval.dtype), zip(*columns, strict=True)
        made = (self.let(kind, form.format(*x, kind=kind)) for x in lines)
        return filled(aval.shape, made)

    def read(
        self, aval: Any, array: np.ndarray, begin: Callable[[tuple[int, ...]], Any]
    ) -> np.ndarray:
        """Read elements at computed places.

        Args:
            aval: Shape and type of the result.
            array: The array.
            begin: Function from an index of the result to the index in the array: its
                computed part, C texts, and its constant part.
        """
        size_of(aval)
        name, kind = self.memory(array), ctype(aval.dtype)
        strides = [int(np.prod(array.shape[n + 1 :])) for n in range(array.ndim)]

        def element(place: tuple[int, ...]) -> str:
            first, within = begin(place)
            offset = sum(map(operator.mul, within, strides))
            parts = [f"{x}*{n}" for x, n in zip(first, strides, strict=True)]
            return self.let(kind, f"{name}[{'+'.join([*parts, str(offset)])}]")

        return filled(aval.shape, map(element, np.ndindex(aval.shape)))

    def bounded(self, text: str, most: int) -> str:
        """Return an index of at least 0 and at most `most`."""
        return self.let("int", f"wp::min(wp::max((int)({text}),0),{most})")


def unknown(array: np.ndarray) -> bool:
    """Return whether an array holds names instead of numbers."""
    return array.dtype == object


def called(params: dict[str, Any]) -> ClosedJaxpr:
    """Return the program that an operation calls."""
    if "_prim" in params:  # from JAX 0.12 on, of a function with its own derivatives
        call = params["_prim"]
        numbers = (jax.ShapeDtypeStruct(x.shape, x.dtype) for x in call.in_avals_flat)
        arguments = jax.tree.unflatten(call.in_tree, numbers)
        return jax.make_jaxpr(call.expand)(*arguments)
    inner = next(params[key] for key in ("jaxpr", "call_jaxpr") if key in params)
    return inner if isinstance(inner, ClosedJaxpr) else ClosedJaxpr(inner, ())


def evaluated(equation: Any, given: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the results of an operation of constants."""
    with jax.ensure_compile_time_eval():
        made = equation.primitive.bind(
            *map(jax.numpy.asarray, given), **equation.params
        )
    made = made if equation.primitive.multiple_results else [made]
    return [np.asarray(array) for array in made]


def moved(equation: Any, given: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the results of an operation that moves elements, by their numbers."""
    count = 1 if equation.primitive.name in READS else len(given)
    arrays = [texts(array) for array in given[:count]]
    ends = np.cumsum([array.size for array in arrays], dtype=np.int32)
    numbers = [
        np.arange(end - array.size, end, dtype=np.int32).reshape(array.shape)
        for array, end in zip(arrays, ends, strict=True)
    ]
    elements = np.concatenate([array.ravel() for array in arrays])
    places = evaluated(equation, [*numbers, *given[count:]])
    return [filled(x.shape, elements[x.ravel()]) for x in places]


def _branches(
    code: Code, params: Any, out: list[Any], index: np.ndarray, *given: np.ndarray
) -> Sequence[np.ndarray]:
    """One of several programs, by its number."""
    if not unknown(index):
        return code.run(params["branches"][int(index)], given)
    made = code.variables(out)
    for n, branch in enumerate(params["branches"]):
        last = n + 1 == len(params["branches"])
        head = "else " if last else f"if({index.item()}=={n})"
        with code.block(head if last or not n else "else " + head):
            code.assign(made, code.run(branch, given))
    return made


def _scan(
    code: Code, params: Any, out: list[Any], *given: np.ndarray
) -> Sequence[np.ndarray]:
    """A program for each row of some arrays; rows of results are a local array."""
    length, body = params["length"], params["jaxpr"].jaxpr
    # what has rows is last, in and out: versions of JAX name the numbers differently
    with_rows = sum(
        x.ndim > var.aval.ndim for x, var in zip(given, body.invars, strict=True)
    )
    stacked_rows = sum(
        aval.ndim > var.aval.ndim for aval, var in zip(out, body.outvars, strict=True)
    )
    count = len(out) - stacked_rows
    fixed = len(given) - count - with_rows
    shared, rows = given[:fixed], given[fixed + count :]
    carried, n = code.variables(out[:count]), code.name()
    code.assign(carried, given[fixed : fixed + count])
    inputs, results = [code.memory(row) for row in rows], []
    for aval in out[count:]:
        results.append(code.name())
        code.lines.append(f"{ctype(aval.dtype)} {results[-1]}[{size_of(aval)}];")
    at = f"({length - 1}-{n})" if params["reverse"] else n
    avals = [var.aval for var in body.invars[fixed + count :]]
    with code.block(f"for(int {n}=0;{n}<{length};{n}++)"):
        now = [
            filled(
                aval.shape,
                (
                    code.let(ctype(aval.dtype), f"{name}[{at}*{size_of(aval)}+{j}]")
                    for j in range(size_of(aval))
                ),
            )
            for name, aval in zip(inputs, avals, strict=True)
        ]
        made = code.run(params["jaxpr"], [*shared, *carried, *now])
        for name, array in zip(results, made[count:], strict=True):
            code.lines += [
                f"{name}[{at}*{array.size}+{j}]={text};"
                for j, text in enumerate(texts(array).flat)
            ]
        code.assign(carried, made[:count])
    stacked = [
        filled(aval.shape, (Element.of(name, j) for j in range(size_of(aval))))
        for name, aval in zip(results, out[count:], strict=True)
    ]
    return [*carried, *stacked]


CONTROL = {"cond": _branches, "scan": _scan}


def _inverted(code: Code, params: Any, out: Any, array: np.ndarray) -> np.ndarray:
    return code.each(out, "!{0}" if out.dtype == bool else "~{0}", array)


def _selected(
    code: Code, params: Any, out: Any, which: np.ndarray, *cases: np.ndarray
) -> np.ndarray:
    """Elements of one of several arrays, by a condition or a number."""
    last = len(cases) - 1
    form = "".join(f"{{0}}=={n}?{{{n + 1}}}:" for n in range(last))
    return code.each(out, f"{form}{{{last + 1}}}", which, *cases)


def _integer_pow(code: Code, params: Any, out: Any, array: np.ndarray) -> np.ndarray:
    product = "*".join(["{0}"] * abs(params["y"]))
    return code.each(out, product if params["y"] > 0 else f"1/({product})", array)


def _reduced(
    form: str, code: Code, params: Any, out: Any, array: np.ndarray
) -> np.ndarray:
    axes = params["axes"]
    terms = np.moveaxis(texts(array), axes, range(len(axes))).reshape(-1, out.size)
    parts = (filled(out.shape, term) for term in terms)
    return functools.reduce(lambda a, b: code.each(out, form, a, b), parts)


def _product(
    code: Code, params: Any, out: Any, left: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Product of matrices: axes of a batch, of one of the factors, and summed ones."""
    (sum_l, sum_r), (batch_l, batch_r) = params["dimension_numbers"]
    size_of(out)
    shape = [left.shape[n] for n in batch_l]
    terms = int(np.prod([left.shape[n] for n in sum_l]))

    def arranged(array: np.ndarray, batch: Any, summed: Any) -> np.ndarray:
        free = [n for n in range(array.ndim) if n not in (*batch, *summed)]
        moved = texts(array).transpose([*batch, *free, *summed])
        return moved.reshape(int(np.prod(shape)), -1, terms)

    pairs = zip(
        arranged(left, batch_l, sum_l), arranged(right, batch_r, sum_r), strict=True
    )
    sums = (
        "+".join(f"{x}*{y}" for x, y in zip(row, column, strict=True))
        for rows, columns in pairs
        for row in rows
        for column in columns
    )
    return filled(out.shape, (code.let(ctype(out.dtype), x) for x in sums))


def _sliced(
    code: Code, params: Any, out: Any, array: np.ndarray, *starts: np.ndarray
) -> np.ndarray:
    """A part of an array from a computed start."""
    first = [
        code.bounded(texts(start).item(), length - size)
        for start, length, size in zip(
            starts, array.shape, params["slice_sizes"], strict=True
        )
    ]
    return code.read(out, array, lambda place: (first, place))


def _gathered(
    code: Code, params: Any, out: Any, array: np.ndarray, starts: np.ndarray
) -> np.ndarray:
    """Parts of an array from computed starts; a place outside is the nearest one."""
    if params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP:
        raise Untranslatable("the operation gather with mode='fill', as of jnp.take")
    numbers, sizes = params["dimension_numbers"], params["slice_sizes"]
    batched = dict(
        zip(
            numbers.operand_batching_dims,
            numbers.start_indices_batching_dims,
            strict=True,
        )
    )
    gone = (*numbers.collapsed_slice_dims, *batched)
    kept = [n for n in range(array.ndim) if n not in gone]
    starts = texts(starts)

    def begin(place: tuple[int, ...]) -> tuple[list[str], list[int]]:
        row = tuple(x for n, x in enumerate(place) if n not in numbers.offset_dims)
        within = dict(zip(kept, (place[n] for n in numbers.offset_dims), strict=True))
        first = ["0"] * array.ndim
        for column, n in enumerate(numbers.start_index_map):
            first[n] = code.bounded(starts[(*row, column)], array.shape[n] - sizes[n])
        for n, axis in batched.items():
            first[n] = str(row[axis])
        return first, [within.get(n, 0) for n in range(array.ndim)]

    return code.read(out, array, begin)


ARRAYS = {
    "dot_general": _product,
    "dynamic_slice": _sliced,
    "gather": _gathered,
    "integer_pow": _integer_pow,
    "not": _inverted,
    "select_n": _selected,
    **{
        name: functools.partial(_reduced, ELEMENTS[form])
        for name, form in REDUCTIONS.items()
    },
}
