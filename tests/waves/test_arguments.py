"""Numbers that no scene has are refused by name, or are NaN in a program."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves
from jblast.errors import InputError
from jblast.registry import LAWS
from jblast.waves import (
    iso_9613_absorption,
    kingery_bulmash_pressure,
    light_arrival_time,
)
from jblast.waves.arguments import ARGUMENTS

REFUSED = [
    ({"slant_range": np.inf}, "slant_range: expected a finite number, got inf m"),
    ({"slant_range": np.nan}, "slant_range: expected a number, got nan m"),
    ({"slant_range": [5.0, 0.0]}, "slant_range: expected positive, got 0 m"),
    ({"charge_mass": -1.0}, "charge_mass: expected positive, got -1 kg"),
    ({"burst": "air"}, "burst: expected 'surface' or 'free-air', got air"),
    (
        {"slant_range": np.ones(2), "charge_mass": np.ones(3)},
        "kingery_bulmash_peak_overpressure_pa: expected one shape, or single numbers, "
        "got slant_range (2,), charge_mass (3,)",
    ),
]


@pytest.mark.parametrize(("given", "message"), REFUSED, ids=lambda x: str(x)[:24])
@pytest.mark.parametrize("array", [np.asarray, jnp.asarray])
def test_arguments_that_no_scene_has_are_refused_by_name(given, message, array):
    values = {"slant_range": 9.0, "charge_mass": 1.0} | given
    values = {k: v if isinstance(v, str) else array(v) for k, v in values.items()}
    with pytest.raises(InputError) as refused:
        kingery_bulmash_pressure(**values)
    assert str(refused.value) == message


CHECKED = {
    f"{law.name}_{quantity}": law.function for (quantity, _), law in LAWS.items()
} | {
    name: function
    for name, function in vars(jblast.waves).items()
    if hasattr(function, "__wrapped__")
}
"""Every law, and every public helper that checks its arguments."""


def usual_values(function):
    """Return a usual value of each argument; {} if one is no number of the table."""
    parameters = inspect.signature(function).parameters.values()
    needed = [p.name for p in parameters if p.default is inspect.Parameter.empty]
    if not set(needed) <= set(ARGUMENTS):
        return {}
    return {n: float(np.sqrt(np.prod(np.abs(ARGUMENTS[n].usual)))) for n in needed}


@pytest.mark.parametrize("name", CHECKED)
def test_beyond_a_bound_a_call_is_refused_and_a_program_gives_nan(name):
    usual, function = usual_values(CHECKED[name]), CHECKED[name]
    program = jax.jit(lambda values: function(**values))
    good = jax.tree.leaves(program(usual)) if usual else []
    for argument in usual:
        bounds = ARGUMENTS[argument].bounds
        low, high = max(bounds.above, bounds.at_least), bounds.at_most
        for bad in (low - 1.0, high + 1.0):
            if not np.isfinite(bad):
                continue
            with pytest.raises(InputError, match=f"^{argument}: expected "):
                function(**usual | {argument: bad})
            if ARGUMENTS[argument].open:
                continue
            found = jax.tree.leaves(program(usual | {argument: bad}))
            other = jax.tree.leaves(program(usual | {argument: 1.01 * usual[argument]}))
            for value, same, before in zip(found, other, good, strict=True):
                depends = value.dtype.kind == "f" and np.any(same != before)
                assert not depends or np.isnan(value).all(), argument


def test_a_negative_frequency_has_no_absorption_in_a_program():
    air = 293.15, 101325.0, 0.5
    assert jnp.isnan(jax.jit(iso_9613_absorption)(-100.0, *air))
    assert jax.jit(iso_9613_absorption)(0.0, *air) == 0.0


def test_the_slope_of_a_law_is_unmoved_by_the_guard():
    slope = jax.jit(jax.grad(light_arrival_time))(100.0)
    assert float(slope) == pytest.approx(1 / 299792458.0, rel=1e-12)
