"""Every law: NumPy and JAX, slopes, scaling, validity, and refused arguments."""

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
from jblast.waves.tables import Curve
from tests.waves.points import (
    compiled,
    evaluated,
    every_law,
    grid,
    numbers,
    points,
    shifted,
    sweep,
    word_of,
)

STEP = 1e-4


@every_law
def test_tables_and_forms_agree_and_slopes_are_finite(law, word):
    values = sweep()
    value, slopes = compiled(law, word)(values)
    np.testing.assert_allclose(value, np.log(evaluated(law, word, values)), atol=1e-6)
    assert all(np.all(np.isfinite(each)) for each in slopes.values())


@pytest.mark.slow
@every_law
def test_curvatures_are_finite(law, word):
    # a branch not taken makes NaN of nothing times an infinite second derivative
    curvatures = compiled(law, word, curved=True)(sweep())
    assert all(np.all(np.isfinite(each)) for each in curvatures.values())


@every_law
def test_slopes_are_those_of_differences_of_the_forms(law, word):
    values = {name: value[:400] for name, value in sweep().items()}
    _, slopes = compiled(law, word)(sweep())

    def log_law(name, step):
        moved = shifted(values, {name: np.float64(step)}, exp=np.exp)
        return np.log(evaluated(law, word, moved))

    for name in numbers(law):
        near = log_law(name, STEP) - log_law(name, -STEP)
        far = log_law(name, 2 * STEP) - log_law(name, -2 * STEP)
        difference = (8 * near - far) / (12 * STEP)
        # tables: a slope to 1e-5; a kink within a step, at a join or an end of a range
        apart = np.abs(np.asarray(slopes[name])[:400] - difference)
        assert np.sort(apart)[-5] < 2e-5, name


@pytest.mark.slow
@every_law
def test_forms_agree_in_numpy_and_jax(law, word, monkeypatch):
    monkeypatch.setattr(Curve, "__call__", Curve.exact)
    values = sweep()
    # ln y is up to 40; fused multiply-adds move the last bits of polynomials
    in_jax = jax.jit(lambda v: jnp.log(evaluated(law, word, v)))(values)
    apart = np.abs(in_jax - np.log(evaluated(law, word, values)))
    assert np.max(apart) < 1e-12


@pytest.mark.slow
@every_law
def test_single_precision_stays_close_to_double(law, word):
    single = {name: v.astype(np.float32) for name, v in sweep().items()}
    got = jax.jit(lambda v: evaluated(law, word, v))(single)
    assert got.dtype == np.float32
    # the same rounded numbers in double, so that rounding the input does not count
    double = evaluated(law, word, {n: v.astype(float) for n, v in single.items()})
    # ln y of up to 20 is rounded to 1e-6: reflected pressure is worst, 4e-6
    assert np.max(np.abs(np.log(np.asarray(got, float)) - np.log(double))) < 1e-5


@every_law
def test_numbers_broadcast_against_arrays(law, word):
    values = {name: value[1] for name, value in grid(4, seed=4).items()}
    for name in numbers(law):
        if (word, name) == ("head", "sensor_height"):
            continue  # the path along the ground does not depend on it
        array = np.full((2, 3), values[name])
        assert evaluated(law, word, {**values, name: array}).shape == (2, 3), name


LENGTHS = ("slant_range", "ground_range", "height_of_burst", "sensor_height")
LENGTHS += ("toward_east", "toward_north", "toward_up")
TIMES = ("time_since_detonation", "fireball_growth")
OWN_LENGTHS = ("wu_hao", "weak_shock_iso")
"""Constants with units; absorption over lengths of the air."""
NO_AIR = ("fireball", "ground_motion", *OWN_LENGTHS)


@every_law
def test_a_larger_blast_is_the_same_blast_at_a_larger_scale(law, word):
    if law.name in OWN_LENGTHS:
        pytest.skip("not scaled by design")
    values, k = grid(60, seed=8), 7.0
    larger = values | {n: values[n] * k for n in (*LENGTHS, *TIMES)}
    larger |= {"charge_mass": values["charge_mass"] * k**3}
    ratio = evaluated(law, word, larger) / evaluated(law, word, values)
    # lengths, times, and impulses, which are pressure times time
    grows = not law.quantity.endswith(("_m_s", "_pa", "_px", "_rad"))
    np.testing.assert_allclose(ratio, k if grows else 1.0, rtol=1e-11)


@every_law
def test_in_denser_air_a_larger_charge_is_the_same_blast(law, word):
    if law.name in NO_AIR:
        pytest.skip("it scales with the charge alone, or not by design")
    values, k = grid(60, seed=9), 1.7
    scaled = ("charge_mass", "ambient_pressure", "air_density")
    denser = values | {n: values[n] * k for n in scaled}
    ratio = evaluated(law, word, denser) / evaluated(law, word, values)
    # the strong shock starts where the charge ends, which air has no part in
    late = values["time_since_detonation"] > 2e-7 * np.cbrt(values["charge_mass"])
    counts = late if law.name == "sedov_taylor" else np.ones(60, bool)
    expected = k if "_pa" in law.quantity else 1.0
    np.testing.assert_allclose(ratio[counts], expected, rtol=1e-11)


FALLING = ("peak_overpressure_pa", "reflected_pressure_pa", "reflected_impulse_pa_s")
FALLING += ("shock_speed_m_s", "blast_wind_m_s", "dynamic_pressure_pa")
FALLING += ("ground_displacement_m", "ground_peak_velocity_m_s")
RISING = ("air_arrival_s", "ground_arrival_s", "flash_time_s")
# as printed: the first leaves the speed of sound past its table, the second turns up
MONOTONE_TO = {"kingery_bulmash": 40.0, "swisdak": 38.0}
"""Largest Z to which a shock speed falls."""


@every_law
def test_with_distance_waves_come_later_and_grow_weaker(law, word):
    if law.quantity not in (*FALLING, *RISING):
        pytest.skip("impulse and duration rise and fall")
    z = np.geomspace(0.01, 1e5, 4000)
    if law.quantity == "shock_speed_m_s":
        z = z[z < MONOTONE_TO.get(law.name, np.inf)]
    along = points(np.ones(1), np.ones(1)) | dict.fromkeys(LENGTHS[:2], z)
    steps = np.diff(np.log(evaluated(law, word, along)))
    sign = 1.0 if law.quantity in RISING else -1.0
    assert np.all(sign * steps > -1e-12)


@every_law
def test_each_states_validity_scatter_and_source(law, word):
    values = grid(60, seed=6) | {"burst": "surface", "ground_path": "head"}

    def call(function, **words):
        names = inspect.signature(function).parameters
        return function(**{n: (values | words)[n] for n in names})

    words = [{word_of(law): word}] if word else [{"burst": b} for b in ("surface",)]
    words += [] if word else [{"burst": "free-air"}]
    valid = np.array([call(law.valid, **each) for each in words])
    assert valid.dtype == bool
    assert valid.any()
    assert all(np.all(np.asarray(sd) >= 0.0) for sd in call(law.scatter))
    assert law.range
    assert law.source
    assert law.scatter_source


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
