"""What every registered law must do; importing jblast.waves registers them all."""

import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves
from jblast.constants import STANDARD_PRESSURE, TNT_SPECIFIC_ENERGY
from jblast.registry import LAWS, Law

CHOICES = {"burst": ("surface", "free-air"), "ground_path": ("head", "thesis")}
"""Arguments that are words, and what they may say; a law has at most one."""


def _words(law: Law) -> str | None:
    return next((name for name in CHOICES if name in law.arguments()), None)


CASES = [
    pytest.param(law, word, id=f"{law.quantity}-{law.name}-{word or 'any'}")
    for law in LAWS.values()
    for word in CHOICES.get(_words(law) or "", (None,))
]
every_law = pytest.mark.parametrize(("law", "word"), CASES)


# Single against double precision, in ln of the result: one rounding is 6e-8. Laws that
# are one division, or products of powers, err by few of them; curves summed in ln round
# ln y of up to 20 to 1e-6 (reflected pressure by Kingery and Bulmash is worst, 4e-6).
SINGLE_PRECISION = 1e-5
SHARPER = {"light": 2e-7, "acoustic": 2e-7, "wu_hao": 2e-6, "sedov_taylor": 2e-6}

STEP = 1e-5


def points(z: np.ndarray, mass: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Everything a path holds, at scaled distances and masses; the rest is drawn."""
    rng = np.random.default_rng(seed)

    def draw(lo: float, hi: float) -> np.ndarray:
        return rng.uniform(lo, hi, z.shape)

    pressure, density = draw(5e4, 1.05e5), draw(0.7, 1.3)
    distance = z * (mass / (pressure / STANDARD_PRESSURE)) ** (1 / 3)
    # the time at which a strong shock (alpha = 1) is there
    time = np.sqrt(density * distance**5 / (TNT_SPECIFIC_ENERGY * mass))
    return {
        "slant_range": distance,
        "ground_range": distance,
        "charge_mass": mass,
        "height_of_burst": draw(-0.3, 2.0) * mass ** (1 / 3),
        "ambient_pressure": pressure,
        "sound_speed": draw(300.0, 360.0),
        "air_density": density,
        "p_speed": draw(2e3, 6e3),
        "sedov_gamma": draw(1.15, 1.65),
        "time_since_detonation": time,
        "sensor_height": draw(0.0, 5.0),
        "temperature": draw(255.0, 320.0),
        "relative_humidity": draw(0.05, 0.95),
        "toward_east": draw(0.1, 1.0) * distance,
        "toward_north": draw(0.1, 1.0) * distance,
        "toward_up": draw(0.1, 1.0) * distance,
        "fireball_growth": draw(3e-4, 3e-3) * mass ** (1 / 3),
        "camera_focal": draw(1e2, 1e4),
    }


def arguments(law: Law) -> list[str]:
    return [name for name in law.arguments() if name not in CHOICES]


def evaluate(law: Law, word: str | None, values: dict):
    """Call a law by name, as `sensors.record` does by position."""
    chosen = {name: values[name] for name in arguments(law)}
    return law.function(**chosen, **{key: word for key in [_words(law)] if key})


def shifted(values: dict, steps: dict) -> dict:
    """Move each number by a step in its ln; heights by a step in W^(1/3) metres."""
    moved = {name: values[name] * jnp.exp(step) for name, step in steps.items()}
    if "height_of_burst" in steps:
        unit = values["charge_mass"] ** (1 / 3)
        moved["height_of_burst"] = (
            values["height_of_burst"] + steps["height_of_burst"] * unit
        )
    return {**values, **moved}


@cache
def compiled(law: Law, word: str | None):
    """ln of a law over a batch of points; its slopes by reverse mode, and how these
    change where all arguments grow, forward over reverse: one program for both."""

    def log_value(steps, values):
        return jnp.log(evaluate(law, word, shifted(values, steps)))

    def value_slopes_and_curvatures(values):
        nothing = dict.fromkeys(arguments(law), 0.0)
        along_all = dict.fromkeys(arguments(law), 1.0)

        def at(steps):
            return jax.value_and_grad(log_value)(steps, values)

        (value, slopes), (_, curvatures) = jax.jvp(at, (nothing,), (along_all,))
        return value, slopes, curvatures

    return jax.jit(log_value), jax.jit(jax.vmap(value_slopes_and_curvatures))


def quotients(law, word, values, above: float, below: float) -> dict[str, np.ndarray]:
    """Difference quotients of ln y between two shifts of each argument in turn."""
    log_value, _ = compiled(law, word)
    names = arguments(law)
    axes = (len(names), values["charge_mass"].size)
    steps = {
        name: np.repeat(np.eye(len(names))[:, [i]], axes[1], axis=1)
        for i, name in enumerate(names)
    }
    spread = {name: np.broadcast_to(value, axes) for name, value in values.items()}
    ends = [
        np.asarray(log_value({n: s * shift for n, s in steps.items()}, spread))
        for shift in (above, below)
    ]
    return dict(zip(names, (ends[0] - ends[1]) / (above - below), strict=True))


def away_from_joins(law: Law, values: dict) -> np.ndarray:
    """True where no listed join is within a hundred steps."""
    distance = values["slant_range"] * np.cbrt(
        values["ambient_pressure"] / STANDARD_PRESSURE / values["charge_mass"]
    )
    time = values["time_since_detonation"] / np.cbrt(values["charge_mass"])
    scaled = time if "time_since_detonation" in law.arguments() else distance
    gaps = [abs(np.log(scaled / join)) for join in law.joins]
    return np.min([np.full(scaled.shape, np.inf), *gaps], axis=0) > 100 * STEP


def grid(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Z from 0.01 to 1e5 and masses from 0.1 g to 1 Mt, evenly in ln, paired."""
    rng = np.random.default_rng(seed + 1)
    z = np.geomspace(0.01, 1e5, count)
    return points(z, rng.permutation(np.geomspace(1e-4, 1e9, count)), seed)


def sweep(law: Law) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The grid, its corners and every join of a law; and which of these are joins.

    One batch for every law, so each compiles once: a law with few joins repeats them.
    """
    values = grid(400)
    corners = points(np.repeat([0.01, 1e5], 2), np.tile([1e-4, 1e9], 2))
    joins = np.resize(law.joins or (1.0,), 40)
    at_joins = points(joins, np.full(joins.shape, 3.0), seed=2)
    at_joins["time_since_detonation"] = joins * np.cbrt(3.0)
    parts = values, corners, at_joins
    together = {name: np.concatenate([p[name] for p in parts]) for name in values}
    return together, np.arange(444) >= 404


@every_law
def test_value_and_slopes_are_finite_from_the_fireball_to_the_far_field(law, word):
    value, slopes, _ = compiled(law, word)[1](sweep(law)[0])
    assert np.all(np.isfinite(value))
    for name, slope in slopes.items():
        assert np.all(np.isfinite(slope)), name


@every_law
def test_log_slopes_are_those_of_finite_differences(law, word):
    values, _ = sweep(law)
    keep = away_from_joins(law, values)
    assert keep[:404].mean() > 0.98
    _, slopes, _ = compiled(law, word)[1](values)
    differences = quotients(law, word, values, STEP, -STEP)
    for name in arguments(law):
        # truncation: a sixth of the step squared times the third derivative, which
        # inside a blend (5 % wide, jump 2 %) is up to 1e4; rounding: 1e-9
        np.testing.assert_allclose(
            slopes[name][keep], differences[name][keep], rtol=0, atol=1e-6, err_msg=name
        )


@every_law
def test_at_a_join_the_slope_lies_between_those_of_its_sides(law, word):
    values, at_join = sweep(law)
    _, slopes, _ = compiled(law, word)[1](values)
    step = 1e-6  # one-sided: half a step times a curvature of up to 100
    right = quotients(law, word, values, step, 0.0)
    left = quotients(law, word, values, 0.0, -step)
    for name, slope in slopes.items():
        low, high = np.sort([left[name], right[name]], axis=0)
        assert np.all((slope >= low - 5e-5)[at_join]), name
        assert np.all((slope <= high + 5e-5)[at_join]), name


@every_law
def test_jit_changes_nothing_and_a_batch_is_a_loop(law, word):
    values, _ = sweep(law)
    # compiled: jit of vmap of a law of numbers; here: the law of arrays, as it stands
    fused = compiled(law, word)[1](values)[0]
    with jax.disable_jit():  # a law compiles itself when called
        eager = evaluate(law, word, values)
    assert eager.shape == fused.shape
    # In ln, so that a law that spans decades is held equally everywhere. Fused
    # multiply-adds move the last bits of polynomials that cancel.
    np.testing.assert_allclose(fused, np.log(eager), rtol=0, atol=1e-12)
    alone = evaluate(law, word, {name: float(v[123]) for name, v in values.items()})
    assert alone.shape == ()
    np.testing.assert_allclose(alone, eager[123], rtol=1e-12)


@every_law
def test_numbers_broadcast_against_arrays(law, word):
    numbers = {name: float(value[1]) for name, value in grid(4, seed=4).items()}
    for name in arguments(law):
        together = jax.eval_shape(
            lambda x, name=name: evaluate(law, word, {**numbers, name: x}),
            jax.ShapeDtypeStruct((2, 3), float),
        )
        assert together.shape == (2, 3), name


@every_law
def test_single_precision_stays_close_to_double(law, word):
    values = {name: v.astype(np.float32) for name, v in sweep(law)[0].items()}
    single = jax.jit(lambda v: evaluate(law, word, v))(values)
    assert single.dtype == np.float32
    # the same rounded numbers in double, so that rounding the input is not counted
    double, *_ = compiled(law, word)[1](
        {name: v.astype(float) for name, v in values.items()}
    )
    apart = np.abs(np.log(np.asarray(single, float)) - double)
    assert apart.max() < SHARPER.get(law.name, SINGLE_PRECISION)


@every_law
def test_each_says_where_it_holds_and_how_far_nature_departs(law, word):
    values = {**grid(60, seed=6), "burst": "surface", "ground_path": "head"}

    # Path calls by name; a law without a burst may still hold for one of them alone
    def call(f, **choice):
        chosen = values | choice
        return f(**{n: chosen[n] for n in Law.arguments(_as_law(law, f))})

    key = _words(law) or "burst"
    somewhere = np.zeros(60, bool)
    for choice in (word,) if _words(law) else CHOICES["burst"]:
        valid = jax.jit(lambda choice=choice: call(law.valid, **{key: choice}))()
        assert valid.shape == (60,)
        assert valid.dtype == bool
        somewhere |= np.asarray(valid)
    assert somewhere.any()
    for sd in call(law.scatter):
        assert np.all(np.isfinite(sd))
        assert np.all(np.asarray(sd) >= 0)
    assert law.range
    assert law.source
    assert law.scatter_source


@every_law
def test_curvatures_are_finite(law, word):
    # a branch not taken makes NaN of nothing times an infinite second derivative here
    # as it does in reverse over reverse
    *_, curvatures = compiled(law, word)[1](sweep(law)[0])
    for name, curvature in curvatures.items():
        assert np.all(np.isfinite(curvature)), name


LENGTHS = ("slant_range", "ground_range", "height_of_burst", "sensor_height")
LENGTHS += ("toward_east", "toward_north", "toward_up")


def grows_as(quantity: str) -> float:
    """Power of the length scale by which a quantity grows, pressures kept."""
    if quantity.endswith(("_m_s", "_pa", "_px", "_rad")):
        return 0.0
    return 1.0  # lengths, times, and impulses: pressure times time


KNOWS_NO_AIR = ("fireball",)
"""Laws that scale with the charge alone, whatever the air."""

OWN_LENGTHS = {
    "wu_hao": "its constants have units, and it knows no ambient pressure",
    "weak_shock_iso": "the air absorbs over lengths and times of its own",
}
"""Laws that no scaling law holds for, by design, and why."""


@every_law
def test_hopkinson_and_cranz_a_larger_blast_is_the_same_blast_at_a_larger_scale(
    law, word
):
    if law.name in OWN_LENGTHS:
        pytest.skip(OWN_LENGTHS[law.name])
    values, k = grid(60, seed=8), 7.0
    larger = dict(values) | {n: values[n] * k for n in LENGTHS}
    larger |= {"charge_mass": values["charge_mass"] * k**3}
    larger |= {n: values[n] * k for n in ("time_since_detonation", "fireball_growth")}
    ratio = evaluate(law, word, larger) / evaluate(law, word, values)
    # a sum of logarithms of up to 20: a few roundings of 2e-15 each, steep curves
    np.testing.assert_allclose(ratio, k ** grows_as(law.quantity), rtol=1e-11)


def test_wu_hao_breaks_that_scaling():
    values, k = grid(4, seed=8), 7.0
    larger = values | {n: values[n] * k for n in LENGTHS}
    larger |= {"charge_mass": values["charge_mass"] * k**3}
    law = LAWS["air_arrival_s", "wu_hao"]
    ratio = evaluate(law, None, larger) / evaluate(law, None, values)
    np.testing.assert_allclose(ratio, k**0.8, rtol=1e-12)  # 1.4 - 3 * 0.2, not 1


@every_law
def test_sachs_in_denser_air_a_larger_charge_is_the_same_blast(law, word):
    if law.name in OWN_LENGTHS:
        pytest.skip(OWN_LENGTHS[law.name])
    if law.name in KNOWS_NO_AIR:
        pytest.skip("the denser the air, the smaller a fireball should be; it is not")
    values, k = grid(60, seed=9), 1.7
    scaled = ("charge_mass", "ambient_pressure", "air_density")
    denser = dict(values) | {n: values[n] * k for n in scaled}
    ratio = evaluate(law, word, denser) / evaluate(law, word, values)
    # The strong shock starts where the charge ends, which air has no part in.
    early = law.name == "sedov_taylor" and (
        values["time_since_detonation"]
        < 2 * law.joins[0] * np.cbrt(values["charge_mass"])
    )
    has_pressure = "_pa" in law.quantity
    expected = np.where(early, ratio, k if has_pressure else 1.0)
    np.testing.assert_allclose(ratio, expected, rtol=1e-11)


FALLING = ("peak_overpressure_pa", "reflected_pressure_pa", "reflected_impulse_pa_s")
FALLING += ("shock_speed_m_s", "blast_wind_m_s", "dynamic_pressure_pa")
RISING = ("air_arrival_s", "ground_arrival_s", "flash_time_s")
DIPS = {
    # as printed: the first leaves the speed of sound past its table, the second turns
    # up at its end
    ("shock_speed_m_s", "kingery_bulmash", "surface"): (0.0, 40.0),
    ("shock_speed_m_s", "swisdak", None): (0.0, 38.0),
}
"""Where a law is not monotone though physics says so, and where it is."""


@every_law
def test_with_distance_waves_come_later_and_grow_weaker(law, word):
    if law.quantity not in (*FALLING, *RISING):
        pytest.skip("physics does not say: impulse and duration rise and fall")
    z = np.geomspace(0.01, 1e5, 4000)
    low, high = DIPS.get((law.quantity, law.name, word), (0.0, np.inf))
    z = z[(z > low) & (z < high)]
    one = points(z[:1], np.ones(1))
    along = {name: np.full(z.shape, value) for name, value in one.items()}
    along |= dict.fromkeys(("slant_range", "ground_range"), z)
    sign = 1.0 if law.quantity in RISING else -1.0
    steps = sign * np.diff(np.log(np.asarray(evaluate(law, word, along))))
    assert np.all(steps > -1e-12), z[:-1][steps <= -1e-12]


@every_law
@pytest.mark.parametrize("bad", [-1.0, 0.0])
def test_a_distance_that_is_none_is_refused(law, word, bad):
    values = {name: float(value[1]) for name, value in grid(4, seed=4).items()}
    for name in {"slant_range", "charge_mass"} & set(arguments(law)):
        with pytest.raises(ValueError, match=f"{name} must be positive, got"):
            evaluate(law, word, values | {name: bad})


@every_law
@pytest.mark.parametrize(
    ("bad", "word_for_it"), [("nan", "a number"), ("inf", "finite")]
)
def test_a_distance_without_an_end_or_no_number_is_refused_by_its_own_name(
    law, word, bad, word_for_it
):
    values = {name: float(value[1]) for name, value in grid(4, seed=4).items()}
    for name in {"slant_range", "charge_mass"} & set(arguments(law)):
        with pytest.raises(
            ValueError, match=f"{name} must be {word_for_it}, got {bad}"
        ):
            evaluate(law, word, values | {name: float(bad)})


def test_every_module_of_the_table_has_public_functions():
    public = {getattr(f, "__module__", "") for f in vars(jblast.waves).values()}
    assert {law.function.__module__ for law in LAWS.values()} <= public


def _as_law(law, function):
    return Law(**{**vars(law), "function": function})


def test_names_of_arguments_are_those_of_a_path():
    known = {*jblast.waves.Path.__dataclass_fields__}
    for law in LAWS.values():
        assert set(law.arguments()) <= known


def test_the_grid_reaches_as_far_as_it_says():
    values = grid(200)
    z = values["slant_range"] * np.cbrt(
        values["ambient_pressure"] / STANDARD_PRESSURE / values["charge_mass"]
    )
    assert math.isclose(z.min(), 0.01)
    assert math.isclose(z.max(), 1e5)
