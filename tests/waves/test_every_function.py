"""What every public function of jblast.waves must do that is not in the registry.

Functions are found by inspection, and their arguments drawn by name from the spans of
`waves.arguments`: one that is new is tested, or fails for an argument nobody described.
Laws of the registry are swept farther and closer in `every_law`; of them only
what they refuse is tested here.
"""

import inspect
from functools import cache
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves
from jblast.registry import LAWS
from jblast.waves.arguments import ARGUMENTS

WORDS = {"burst": ("surface", "free-air"), "ground_path": ("head", "thesis")}
POINTS = 200

PUBLIC = {
    name: value
    for name, value in vars(jblast.waves).items()
    if callable(value)
    and not isinstance(value, type | ModuleType)
    and not name.startswith("_")
}
NOT_ELEMENTWISE = {
    "slant_range",
    "blast_pulse",
    "pulse_of",
    "pulse_pressure",
    "pulse_mean",
    "pulse_samples",
}
"""One takes places, not numbers: test_paths.py. The others give or take a pulse: tested
as what it is made of, and in waveform/test_blast_pressure.py and test_pulse.py."""

COMPILED_FOR_LONG = {("blast_pressure", "free-air")}
"""Slow: over the ground it is the same function of other curves."""

FUNCTIONS = [
    pytest.param(f, word, id=f"{name}-{word or 'any'}", marks=marks)
    for name, f in PUBLIC.items()
    if name not in NOT_ELEMENTWISE
    for key in [next((k for k in WORDS if k in inspect.signature(f).parameters), "")]
    for word in WORDS.get(key, (None,))
    for marks in [pytest.mark.slow if (name, word) in COMPILED_FOR_LONG else ()]
]
REGISTERED = {law.function for law in LAWS.values()}
every_function = pytest.mark.parametrize(("f", "word"), FUNCTIONS)
every_other_function = pytest.mark.parametrize(
    ("f", "word"), [case for case in FUNCTIONS if case.values[0] not in REGISTERED]
)

# Single against double precision, relative to the largest value; one rounding is 6e-8.
SINGLE_PRECISION = 1e-5
BLUNTER = {
    "friedlander_decay": 3e-5,  # about i/(Ps td) = 1/2, from which b is a difference
}


def numbers_of(f) -> list[str]:
    """Arguments that are numbers: all but words, and what has a default of its own."""
    return [
        name
        for name, parameter in inspect.signature(f).parameters.items()
        if name not in WORDS
        and (name in ARGUMENTS or parameter.default is inspect.Parameter.empty)
    ]


def drawn(f, count: int = POINTS, seed: int = 0) -> dict[str, np.ndarray]:
    """Draw arguments from their usual spans; what belongs together is kept together."""
    rng = np.random.default_rng(seed)
    values = {}
    for name in sorted(ARGUMENTS):
        low, high = ARGUMENTS[name].usual
        u = rng.uniform(size=count)
        values[name] = (
            low * (high / low) ** u
            if low > 0 and high > 30 * low
            else low + (high - low) * u
        )
    # an impulse is the pressure times a part of the duration
    part = rng.uniform(0.05, 0.6, count)
    values["impulse"] = part * values["peak_overpressure"] * values["duration"]
    # what lies on one way
    values["ground_range"] = 0.9 * values["slant_range"]
    return {name: values[name] for name in numbers_of(f)}


def call(f, word, values):
    key = next((k for k in WORDS if k in inspect.signature(f).parameters), None)
    return f(**values, **({key: word} if key else {}))


def as_one(answer):
    """Stack what a function of several answers gives; complex as two."""
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(answer)]
    leaves = [leaf.astype(float) if leaf.dtype == bool else leaf for leaf in leaves]
    parts = [
        part
        for leaf in leaves
        for part in ((leaf.real, leaf.imag) if jnp.iscomplexobj(leaf) else (leaf,))
    ]
    return jnp.stack(jnp.broadcast_arrays(*parts), axis=-1)


@cache
def compiled(f, word):
    """What a function gives for drawn arguments, stacked."""
    return jax.jit(lambda values: as_one(call(f, word, values)))


def is_flag(f, word) -> bool:
    answer = jax.eval_shape(lambda: call(f, word, drawn(f, 2)))
    return any(leaf.dtype == bool for leaf in jax.tree.leaves(answer))


@pytest.mark.slow
@every_other_function
def test_jit_changes_nothing_and_a_batch_is_a_loop(f, word):
    values = drawn(f)
    with jax.disable_jit():  # a law compiles itself when called
        eager = np.asarray(as_one(call(f, word, values)))
    assert eager.shape[0] == POINTS
    fused = np.asarray(compiled(f, word)(values))
    scale = np.abs(eager).max(axis=0)
    assert np.all(np.abs(fused - eager) <= 1e-11 * np.maximum(scale, np.abs(eager)))
    for row in (0, 57):
        alone = as_one(call(f, word, {n: float(v[row]) for n, v in values.items()}))
        np.testing.assert_allclose(
            alone, eager[row], rtol=1e-9, atol=1e-12 * scale.max()
        )


@every_other_function
def test_numbers_broadcast_against_arrays(f, word):
    numbers = {name: float(value[0]) for name, value in drawn(f, 1).items()}
    for name in numbers:
        together = jax.eval_shape(
            lambda x, name=name: call(f, word, {**numbers, name: x}),
            jax.ShapeDtypeStruct((2, 3), float),
        )
        for leaf in jax.tree.leaves(together):
            assert leaf.shape == (2, 3), name


@every_other_function
def test_slopes_are_those_of_finite_differences_and_curvatures_finite(f, word):
    if is_flag(f, word):
        pytest.skip("says yes or no")
    values, step = drawn(f), 1e-5
    units = {}
    for name in values:
        low, high = ARGUMENTS[name].usual
        units[name] = np.abs(values[name]) if low > 0 else np.full(POINTS, high - low)

    @jax.jit
    @jax.vmap
    def at(place, way):  # each argument its own number of units aside, and a way on

        def moved(s):
            return as_one(
                call(
                    f,
                    word,
                    {
                        name: value + (place[i] + s * way[i]) * units[name]
                        for i, (name, value) in enumerate(values.items())
                    },
                )
            )

        def with_slope(s):
            return jax.jvp(moved, (s,), (1.0,))

        return jax.jvp(with_slope, (0.0,), (1.0,))

    one = np.eye(len(values))
    places = np.concatenate([step * n * one for n in (0, 1, -1, 2, -2)])
    (value, slope), (_, curvature) = at(places, np.tile(one, (5, 1)))
    value, *ends = np.split(np.asarray(value), 5)
    slope, curvature = (np.split(np.asarray(part), 5)[0] for part in (slope, curvature))
    near, far = ends[0] - ends[1], ends[2] - ends[3]
    quotient = (8 * near - far) / (12 * step)
    # truncation step^4 times a fifth derivative of up to 1e10; rounding 1e-15/step.
    # Relative to the value where it is not small, as d ln y/d ln x is.
    size = np.maximum(np.abs(value), 1e-3 * np.abs(value).max(axis=1, keepdims=True))
    apart = np.max(np.abs(slope - quotient) / size, axis=(1, 2))
    for i, name in enumerate(values):
        assert apart[i] < 1e-6, name
        assert np.all(np.isfinite(slope[i])), name
        assert np.all(np.isfinite(curvature[i])), name


@pytest.mark.slow
@every_other_function
def test_single_precision_stays_close_to_double(f, word):
    if is_flag(f, word):
        pytest.skip("says yes or no")
    single = {name: v.astype(np.float32) for name, v in drawn(f).items()}
    answer = np.asarray(compiled(f, word)(single))
    assert answer.dtype == np.float32
    double = {name: v.astype(float) for name, v in single.items()}
    double = np.asarray(compiled(f, word)(double))
    scale = np.maximum(np.abs(double), 1e-3 * np.abs(double).max(axis=0))
    bound = BLUNTER.get(f.__name__, SINGLE_PRECISION)
    assert np.max(np.abs(answer - double) / scale) < bound


@every_function
def test_what_no_scene_can_have_is_refused(f, word):
    if is_flag(f, word):
        pytest.skip("it says no")
    values = {name: float(value[0]) for name, value in drawn(f, 1).items()}
    for name in values:
        bounds = ARGUMENTS[name].bounds
        beyond = [bounds.above, bounds.above - 1.0, bounds.at_least - 1.0]
        beyond = [x for x in [*beyond, bounds.at_most + 1.0] if np.isfinite(x)]
        for bad in beyond if ARGUMENTS[name].open else [*beyond, np.nan, np.inf]:
            with pytest.raises(ValueError, match=f"{name} must be"):
                call(f, word, values | {name: bad})
