"""Numbers that no scene has are refused by name, whichever way they are none."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves
from jblast.registry import LAWS
from jblast.waves import kingery_bulmash_pressure, swisdak_pressure
from jblast.waves.arguments import ARGUMENTS


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.inf, "slant_range must be finite, got inf m"),
        (np.nan, "slant_range must be a number, got nan m"),
        (0.0, "slant_range must be positive, got 0 m"),
        (-1.0, "slant_range must be positive, got -1 m"),
    ],
)
@pytest.mark.parametrize("law", [kingery_bulmash_pressure, swisdak_pressure])
def test_a_range_that_is_none_is_refused_by_name(law, value, expected):
    with pytest.raises(ValueError, match=f"^{expected}$"):
        law(np.array([10.0, value]), 1.0)


@pytest.mark.parametrize("name", [n for n, one in ARGUMENTS.items() if not one.open])
@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_what_has_to_be_finite_says_so(name, value):
    said = ARGUMENTS[name].fault(np.array([value]))
    assert said.startswith("must be ")
    assert f"got {value:g}" in said


NUMERIC = {
    f"{law.name}_{quantity}": law.function for (quantity, _), law in LAWS.items()
} | {
    name: function
    for name in dir(jblast.waves)
    if hasattr(function := getattr(jblast.waves, name), "__wrapped__")
}
"""Every law, and every helper that checks its arguments."""


def usual_values(function):
    """Give every argument a usual value; {} if one is no number of the table."""
    needed = [
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.default is inspect.Parameter.empty
    ]
    if not set(needed) <= set(ARGUMENTS):
        return {}
    return {
        name: float(np.sqrt(np.prod(np.abs(ARGUMENTS[name].usual)))) for name in needed
    }


@pytest.mark.parametrize("name", NUMERIC)
def test_under_jit_a_negative_number_where_a_positive_is_expected_gives_nan(name):
    """A range of -1 m has no arrival of light and no scaled distance, jitted or not."""
    usual = usual_values(NUMERIC[name])
    positive = [
        argument
        for argument in usual
        if ARGUMENTS[argument].bounds.above == 0.0 and not ARGUMENTS[argument].open
    ]

    if not positive:
        return

    @jax.jit
    def of(factors):  # one program for all arguments
        return NUMERIC[name](
            **usual | {one: factors[i] * usual[one] for i, one in enumerate(positive)}
        )

    same = np.ones(len(positive))
    good = jax.tree.leaves(of(same))
    for i, argument in enumerate(positive):
        unit = np.eye(len(positive))[i]
        other, bad = (jax.tree.leaves(of(same + x * unit)) for x in (0.01, -2.0))
        for one, two, leaf in zip(good, other, bad, strict=True):
            depends = np.any(np.asarray(one) != np.asarray(two))
            if depends and jnp.issubdtype(leaf.dtype, jnp.floating):
                assert jnp.isnan(leaf).all(), argument


def test_the_slope_of_a_law_is_unmoved_by_the_guard():
    slope = jax.jit(jax.grad(jblast.waves.light_arrival_time))(100.0)
    assert float(slope) == pytest.approx(1 / 299792458.0, rel=1e-12)
