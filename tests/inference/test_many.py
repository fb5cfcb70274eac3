"""Many logs at once: each lane ends where the fit of that log ends."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import batch_of, fit, fit_many
from jblast.inference.answer import Answer, constrained
from jblast.inference.density import density_of
from jblast.inference.many.engine import engine_for
from jblast.inference.many.lanes import LaneResults, better, beyond_array, doubtful
from jblast.inference.many.residuals import faults_of
from jblast.scene import (
    LogNormal,
    Normal,
    Scene,
    Sensor,
    UncertainScene,
    freed,
    read_scene,
    with_laws,
    with_values,
)
from jblast.sensors import layout_of, observe, planned_layout, record
from tests.inference.logs import log

FREE = ["charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s"]
TRUTH = {
    "charge_mass_kg": 30.0,
    "charge_east_m": 10.0,
    "charge_north_m": -5.0,
    "origin_time_s": 1.5,
}
LAWS = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
COMMON = tuple(LAWS.items())
RECORDS = (("air_arrival_s", 1e-4), ("ground_arrival_s", 1e-4))
PLACES = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100), (-90, -60))


def problem(count, **how):
    """A scene and the first of 16 logs of it."""
    uncertain, layout, values, sigma, names = problem_of_16(**how)
    return uncertain, layout, values[:count].copy(), sigma, names


@functools.cache
def problem_of_16(scatter=False, records=RECORDS, laws=COMMON):
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([*place, 0.0]), records=records)
        for i, place in enumerate(PLACES)
    )
    scene = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors, law=laws)
    scene = with_values(scene, TRUTH)
    layout, sigma, names = planned_layout(scene)
    keys = jax.random.split(jax.random.key(3), 16)
    draw = jax.jit(
        jax.vmap(
            lambda k: observe(k, scene, layout, dict(laws), sigma, noise="gaussian")
        )
    )
    uncertain = freed(UncertainScene(scene), FREE)
    return uncertain, layout, np.asarray(draw(keys)), np.asarray(sigma), names


@functools.cache
def fitted():
    """The sixteen logs and one more of which a reading is no number, fitted."""
    uncertain, layout, values, sigma, _ = problem(16)
    values = np.concatenate([values, values[:1]])
    values[16, 3] = np.nan
    return fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")


def as_log(layout, names, values, sigma):
    timed = [q.endswith("arrival_s") for q in layout.quantity]
    return log(
        *(
            (name, quantity, value, s if t else s * value, tuple(place))
            for name, quantity, value, s, t, place in zip(
                names,
                layout.quantity,
                values,
                sigma,
                timed,
                np.asarray(layout.position),
                strict=True,
            )
        )
    )


def density_for(uncertain, layout, names, values, sigma, noise):
    named = with_laws(uncertain, LAWS)
    return density_of(as_log(layout, names, values, sigma), named, noise)


def newton_step(density, z):
    """How far Newton would step on the density that `fit` samples, and its curvature.

    Without the weak prior, and at the expected information.
    """
    values = constrained(density, np.asarray(z)[None])[0]
    answer = Answer(density, values, np.zeros(len(values)))
    known = answer.information + np.diag(answer.has_prior)
    slope = np.asarray(jax.jit(jax.grad(density.log_density))(jnp.asarray(z)))
    prior = jax.grad(lambda z: of_prior(density, z))(jnp.asarray(z))
    return np.linalg.solve(known, slope - np.asarray(prior)), known


def of_prior(density, z):
    """The prior of free numbers."""
    axes = density.coordinates
    values = [b.constrain(x) for b, x in zip(axes.beliefs, z, strict=True)]
    priors = [b.log_density(x) for b, x in zip(axes.beliefs, z, strict=True)]
    return axes.log_prior_of(jnp, jnp.stack(values)) - sum(priors)


def assert_optimum(found, lane, density):
    """The optimum and the covariance of a lane are those that `fit` finds."""
    step, known = newton_step(density, found.z[lane])
    # slopes by differences of 1e-3 of a step
    assert (np.abs(step) < 1e-4 * found.sd()[lane]).all()
    product = known @ np.asarray(found.covariance[lane])
    np.testing.assert_allclose(product, np.eye(4), atol=1e-3)


@pytest.mark.slow
def test_each_lane_has_the_optimum_and_the_covariance_that_fit_finds():
    uncertain, layout, values, sigma, names = problem(16)
    density = density_for(uncertain, layout, names, values[5], sigma, "gaussian")
    assert_optimum(fitted(), 5, density)


@pytest.mark.slow
def test_student_errors_end_where_their_density_is_level():
    uncertain, layout, values, sigma, names = problem(16)
    values[5, 2] += 30e-4  # a wild reading
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise="student")
    assert found.converged.all()
    density = density_for(uncertain, layout, names, values[5], sigma, "student")
    assert_optimum(found, 5, density)
    truth = [math.log(30.0), 10.0, -5.0, 1.5]
    # normal errors beside the wild one: within 5 standard deviations
    assert (np.abs(found.z[5] - np.array(truth)) < 5 * found.sd()[5]).all()


@pytest.mark.slow
def test_with_scatter_and_a_prior_the_joint_optimum_is_near_that_of_fit():
    uncertain, layout, values, sigma, names = problem(1, scatter=True)
    prior = LogNormal(jnp.asarray(33.0), jnp.asarray(1.05))
    beliefs = dict(uncertain.beliefs) | {"charge_mass_kg": prior}
    uncertain = dataclasses.replace(uncertain, beliefs=beliefs)
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")
    assert found.converged.all()
    density = density_for(uncertain, layout, names, values[0], sigma, "gaussian")
    step, known = newton_step(density, found.z[0])
    # effects at their mode, not integrated out
    assert (np.abs(step) < 0.1 * found.sd()[0]).all()
    expected = np.sqrt(np.diag(np.linalg.inv(known)))
    np.testing.assert_allclose(found.sd()[0], expected, rtol=0.02)


def test_answers_lie_about_the_truth_as_far_as_they_say():
    found = fitted()
    good = np.arange(17) < 16
    assert found.converged[good].all()
    truth = np.array([np.log(TRUTH["charge_mass_kg"]), *list(TRUTH.values())[1:]])
    off = (np.asarray(found.z) - truth)[good] / np.asarray(found.sd())[good]
    # the mean square of 64 unit normals, each log's four nearly independent: sd 0.18
    assert np.mean(off**2) == pytest.approx(1.0, abs=0.6)
    # 12 readings and 4 unknowns: minus ln of the density is half of chi-squared, of 8
    # degrees of freedom; the mean of 16 has an sd of 0.5
    assert np.mean(found.cost[good]) == pytest.approx(4.0, abs=1.5)


def test_one_bad_log_fails_alone_and_is_named():
    found = fitted()
    assert list(np.flatnonzero(found.bad)) == [16]
    assert found.faults == (
        (16, "log 16, row 3, ground_arrival_s: expected a finite time, got nan"),
    )
    assert np.isnan(found.z[16]).all()
    assert not found.converged[16]


@pytest.mark.slow
def test_logs_without_a_closed_form_start_from_the_nearest_of_a_reference_set():
    records = (("air_arrival_s", 1e-4), ("peak_overpressure_pa", 0.02))
    laws = dict.fromkeys(dict(records), "kingery_bulmash")
    uncertain, layout, values, sigma, _ = problem(
        16, records=records, laws=tuple(laws.items())
    )
    found = fit_many(uncertain, layout, values, sigma, laws, noise="gaussian")
    assert found.converged.all()
    away = (found.values["charge_east_m"] - 10.0) / found.sd()[:, 1]
    # normal errors: none of 16 is 5 standard deviations away
    assert (jnp.abs(away) < 5).all()


def results(cost, converged, place=0.0):
    """Results of one unknown that differ by what is given."""
    cost = jnp.asarray(cost)
    lanes = cost.shape
    return LaneResults(
        y=jnp.full((1, *lanes), place),
        cost=cost,
        misfit=cost,
        covariance=jnp.ones((1, 1, *lanes)),
        converged=jnp.asarray(converged),
        tolerance=jnp.full(lanes, 1e-8),
        steps=jnp.ones(lanes, jnp.int32),
        done=jnp.ones(lanes, bool),
    )


@pytest.mark.parametrize(
    ("a", "b", "chosen"),
    [
        # the lower end counts, whatever it says of itself
        (([5.0, 5.0], [True, True]), ([4.0, 6.0], [False, True]), [2.0, 1.0]),
        # 1e-12 of a cost of 5 is rounding: the one that converged counts
        (
            ([5.0, 5.0 + 1e-12], [True, False]),
            ([5.0 - 1e-12, 5.0 + 2e-12], [False, True]),
            [1.0, 2.0],
        ),
        # what is not a number never counts
        (([np.nan, 5.0], [False, True]), ([9.0, np.nan], [True, False]), [2.0, 1.0]),
    ],
)
def test_the_better_of_two_ends_of_a_lane_counts(a, b, chosen):
    both = better(results(*a, place=1.0), results(*b, place=2.0))
    np.testing.assert_array_equal(both.y[0], chosen)


def test_an_end_is_doubtful_if_it_did_not_converge_or_readings_hardly_cost_so_much():
    # 12 normal errors cost 6 at the mean, and 6 standard deviations more are 20.7
    cost = [6.0, 6.0, 20.6, 20.8, 20.8]
    found = results(cost, [True, False, True, True, True])
    bad = jnp.array([False, False, False, False, True])
    found_doubtful = doubtful("gaussian", 12, found, bad)
    np.testing.assert_array_equal(found_doubtful, [False, True, False, True, False])


def test_places_beyond_the_array_are_marked():
    _, layout, *_ = problem(1)
    width = np.hypot(120 + 90, 100 + 60)  # of the two sensors farthest apart
    middle = np.mean(PLACES, axis=0)
    east = middle[0] + width * np.array([0.0, 0.99, 1.01, np.nan])
    numbers = {
        "charge_east_m": jnp.asarray(east),
        "charge_north_m": jnp.full(4, middle[1]),
    }
    bad = jnp.array([False, False, False, True])
    far = beyond_array(layout, numbers, bad)
    np.testing.assert_array_equal(far, [False, False, True, False])
    known = beyond_array(layout, {"charge_mass_kg": jnp.asarray(east)}, bad)
    np.testing.assert_array_equal(known, [False] * 4)


@pytest.mark.slow
def test_a_log_that_cannot_tell_its_unknowns_does_not_converge():
    uncertain, _, _, _, _ = problem(1)
    # sensors in one place tell a distance, and nothing of the direction
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([60.0, 0.0, 0.0]), records=RECORDS) for i in range(3)
    )
    scene = dataclasses.replace(uncertain.scene, sensors=sensors)
    uncertain = dataclasses.replace(uncertain, scene=scene)
    layout, sigma, _ = planned_layout(scene)
    values = np.asarray(
        observe(jax.random.key(0), scene, layout, LAWS, sigma, noise="gaussian")
    )
    start = np.array([[3.0, 5.0, 5.0, 1.5]])
    found = fit_many(
        uncertain,
        layout,
        values[None],
        np.asarray(sigma),
        LAWS,
        noise="gaussian",
        starts=start,
    )
    assert not found.converged[0]
    assert not found.bad[0]
    assert np.isfinite(found.z).all()
    assert np.isnan(found.covariance).all()


@pytest.mark.slow
def test_every_lane_from_random_starts_is_at_the_optimum_or_says_it_is_not():
    uncertain, layout, values, sigma, _ = problem(16)
    best = fitted()
    rng = np.random.default_rng(0)
    starts = np.stack(
        [
            rng.uniform(0.0, 7.0, (3, 16)),
            *rng.uniform(-100, 100, (2, 3, 16)),
            1.5 + rng.uniform(-0.1, 0.1, (3, 16)),
        ],
        axis=-1,
    )
    found = fit_many(
        uncertain, layout, values, sigma, LAWS, noise="gaussian", starts=starts
    )
    away = np.abs(np.asarray((found.z - best.z[:16]) / best.sd()[:16])).max(axis=1)
    assert (away[np.asarray(found.converged)] < 1e-6).all()
    assert found.converged.mean() > 0.9


@pytest.mark.parametrize(
    ("values", "sigma", "starts", "said"),
    [
        (np.ones((2, 5)), np.ones(12), None, "values: expected"),
        (np.ones(12), np.ones(12), None, r"expected \(log, row\) with 12 rows"),
        (np.ones((2, 12)), np.ones(5), None, r"sigma: expected \(12,\) or \(2, 12\)"),
        (np.ones((2, 12)), np.full(12, np.nan), None, "sigma: expected finite"),
        (np.ones((2, 12)), np.ones(12), np.ones((2, 3)), "starts: expected"),
    ],
)
def test_a_batch_of_the_wrong_shape_is_refused(values, sigma, starts, said):
    uncertain, layout, *_ = problem(1)
    with pytest.raises(InputError, match=said):
        fit_many(uncertain, layout, values, sigma, LAWS, starts=starts)


def test_effects_beyond_what_is_written_out_are_refused():
    laws = {"air_arrival_s": "kingery_bulmash", "positive_impulse_pa_s": "ford_2021"}
    records = (("air_arrival_s", 1e-4), ("positive_impulse_pa_s", 0.02))
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([20.0 + i, 0.0, 0.0]), records=records)
        for i in range(18)
    )
    scene = Scene(sensors=sensors, law=tuple(laws.items()))
    layout, *_ = planned_layout(scene)
    with pytest.raises(InputError, match="at most 16"):
        engine_for(freed(UncertainScene(scene), FREE), layout, laws, "gaussian")


OFF_M = 5.0


def logs_off_a_line(count):
    """Logs of charges off a line by what the prior says, and what is known of them."""
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([20.0 * (i + 1), 0.0, 0.0]), records=RECORDS)
        for i in range(5)
    )
    scene = dataclasses.replace(Scene(), scatter=False, sensors=sensors, law=COMMON)
    layout, sigma, _ = planned_layout(scene)

    def one(key):
        north = OFF_M * jax.random.normal(jax.random.fold_in(key, 1))
        true = with_values(scene, {"charge_mass_kg": 10.0, "charge_north_m": north})
        return observe(key, true, layout, LAWS, sigma, noise="gaussian")

    keys = jax.random.split(jax.random.key(0), count)
    uncertain = freed(UncertainScene(scene), ["charge_mass_kg"])
    beliefs = {**uncertain.beliefs, "charge_north_m": Normal(0.0, OFF_M)}
    uncertain = dataclasses.replace(uncertain, beliefs=beliefs)
    return (
        uncertain,
        layout,
        np.asarray(jax.jit(jax.vmap(one))(keys)),
        np.asarray(sigma),
    )


@pytest.mark.slow
def test_fits_end_though_gauss_newton_steps_across_the_line_for_ever():
    found = fit_many(*logs_off_a_line(128), LAWS, noise="gaussian", devices=1)
    assert found.converged.all()


TRIANGLE = ((60.0, 0.0, 0.0), (-70.0, 30.0, 0.0), (0.0, 90.0, 0.0))


def two_logs(errors, later):
    """A scene and two logs of it: one exact, one late by so many errors, by turns."""
    records, laws = (("air_arrival_s", 1e-4),), {"air_arrival_s": "wu_hao"}
    sensors = tuple(
        Sensor(name, jnp.array(at), records=records)
        for name, at in zip("abc", TRIANGLE, strict=True)
    )
    scene = dataclasses.replace(Scene(), scatter=False, sensors=sensors)
    scene = with_values(scene, {"charge_mass_kg": 30.0, "origin_time_s": 1.5})
    layout, *_ = planned_layout(scene)
    exact = np.asarray(record(scene, layout, laws).value)
    away = later * errors * np.array([1.0, -1.0, 1.0])
    logs = [
        log(
            *(
                (name, "air_arrival_s", time, errors, at)
                for name, time, at in zip("abc", times, TRIANGLE, strict=True)
            )
        )
        for times in (exact, exact + away)
    ]
    uncertain = with_laws(
        freed(UncertainScene(scene), ["charge_mass_kg", "origin_time_s"]),
        {"air_arrival_s": "wu_hao"},
    )
    return batch_of(logs, uncertain), uncertain


@pytest.mark.parametrize(
    "noise", ["gaussian", pytest.param("student", marks=pytest.mark.slow)]
)
def test_a_perfect_log_with_errors_of_its_own_is_missed_by_nothing(noise):
    batch, uncertain = two_logs(1e-4, 0.5)
    assert batch.relative_sigma.shape == (2, 3)
    found = fit_many(uncertain, *batch, noise=noise, starts=np.full((2, 2), [3.0, 1.5]))
    assert found.converged.all()
    assert not found.doubtful.any()
    # half of the square of what rounding leaves, 1e-16 s in 1e-4 s
    assert abs(found.misfit[0]) < 1e-20
    assert abs(found.cost[0]) < 1e-20
    # three readings half an error off, each 5/2 ln(1 + 0.5^2/4) by Student-t and less
    # by normal errors; some of it fitted away
    assert 0 < found.misfit[1] < 0.455
    np.testing.assert_allclose(found.cost, found.misfit, atol=1e-20)


SENSOR = """
[[sensor]]
name = "m{n}"
position_m = [{east}, 0.0, 0.0]
records = {{ air_arrival_s = 2e-4, peak_overpressure_pa = "20%" }}
"""
LINE = """
[charge]
mass_kg = "free"
position_m = [{ normal = [0.0, 5.0] }, { normal = [0.0, 5.0] }, 0.0]
time_s = { normal = [0.0, 0.1] }
[air]
temperature_k = { normal = [288.0, 3.0] }
[law]
scatter = false
air_arrival_s = "kingery_bulmash"
peak_overpressure_pa = "kingery_bulmash"
""" + "".join(SENSOR.format(n=n, east=20.0 * n) for n in range(1, 7))
KINGERY_BULMASH: dict[str, str] = dict.fromkeys(
    ("air_arrival_s", "peak_overpressure_pa"), "kingery_bulmash"
)
# Of 100 kg in a line of sensors, one of 384 that were drawn. Times, then pressures.
TIMES_S = (
    *(0.18114950713937522, 0.2340108233116311, 0.2897074714221626),
    *(0.3460141156118789, 0.40376688519010495, 0.46132491525986263),
)
PRESSURES_PA = (
    *(25587.641579829928, 9951.546529732526, 3877.6129866348124),
    *(5912.701382619683, 2277.3778013392775, 5139.237365541541),
)


@pytest.mark.slow
def test_a_fit_that_starts_again_sooner_finds_the_better_optimum(tmp_path):
    (tmp_path / "scene.toml").write_text(LINE)
    uncertain = read_scene(tmp_path / "scene.toml")
    layout, sigma, _ = planned_layout(uncertain.scene)
    readings = np.ravel(np.column_stack([TIMES_S, PRESSURES_PA]))[None]
    assert layout.quantity[:2] == ("air_arrival_s", "peak_overpressure_pa")
    given = (uncertain, layout, readings, np.asarray(sigma), KINGERY_BULMASH)
    own = fit_many(*given)
    # the first start is on the line of sensors, where the cost is level across it; the
    # coordinates are ln of the mass, then east, north, time and temperature in sd
    starts = [[[4.2, 0.0, 0.0, 0.0, 0.0]], [[4.2, -1.0, 1.5, 1.3, 1.0]]]
    late, soon = (
        fit_many(*given, starts=np.array(starts), again_z=z) for z in (6.0, 2.0)
    )
    for found in (own, late, soon):
        assert found.converged.all()
        assert found.values["charge_mass_kg"][0] > 50
    assert soon.cost[0] < late.cost[0] - 2
    np.testing.assert_allclose(own.cost, soon.cost, rtol=1e-9)


OPEN = freed(UncertainScene(Scene(scatter=False)), ["charge_mass_kg"])
SCENE = with_laws(OPEN, KINGERY_BULMASH)


def made(*values):
    """A log of two pressures and an arrival."""
    return log(
        ("a", "peak_overpressure_pa", values[0], 100.0, (40.0, 0.0, 1.0)),
        ("b", "peak_overpressure_pa", values[1], 50.0, (0.0, 80.0, 1.0)),
        ("a", "air_arrival_s", values[2], 1e-3, (40.0, 0.0, 1.0)),
    )


LOGS = [made(9000.0, 3400.0, 0.09), made(12000.0, 4400.0, 0.086)]


@pytest.mark.slow
def test_plain_logs_are_fitted_as_one_by_one_and_a_bad_one_fails_alone():
    bad = made(-1.0, 3400.0, 0.09)
    found = fit_many(SCENE, *batch_of([LOGS[0], bad, LOGS[1]], SCENE), noise="gaussian")
    np.testing.assert_array_equal(found.bad, [False, True, False])
    np.testing.assert_array_equal(found.converged, [True, False, True])
    assert found.faults == (
        (1, "log 1, row 0, peak_overpressure_pa: expected a positive number, got -1.0"),
    )
    for lane, observations in ((0, LOGS[0]), (2, LOGS[1])):
        alone = fit(observations, SCENE, noise="gaussian").summary
        mass = alone.estimates["charge_mass_kg"]
        # both stop where a Newton step would gain 1e-4 in ln-density at most
        assert abs(np.log(found.values["charge_mass_kg"][lane] / mass.value)) < (
            0.015 * mass.log_sd
        )


SHORT = log(("a", "air_arrival_s", 0.1, 1e-3, (40.0, 0.0, 1.0)))
MOVED = dataclasses.replace(
    LOGS[1], position=LOGS[1].position + 1.0, source="moved.csv"
)
MUTE = dataclasses.replace(LOGS[1], sigma=np.array([100.0, 50.0, np.nan]))


@pytest.mark.parametrize(
    ("logs", "scene", "said"),
    [
        ([], SCENE, "at least one, got none"),
        (LOGS, OPEN, "peak_overpressure_pa: expected a name"),
        ([LOGS[0], SHORT], SCENE, r"log 1: expected 3 rows .* got 1; .*fit_each"),
        ([LOGS[0], MOVED], SCENE, r"moved.csv: row 1: expected a, peak"),
        ([LOGS[0], MUTE], SCENE, "air_arrival_s: expected a sigma"),
    ],
)
def test_what_is_no_batch_is_refused(logs, scene, said):
    with pytest.raises(InputError, match=said):
        batch_of(logs, scene)


@pytest.mark.parametrize("each", [False, True], ids=["of each row", "of each log"])
def test_errors_in_the_unit_of_the_reading_are_refused_with_the_share(each):
    batch = batch_of(LOGS, SCENE)
    sigma = np.array([100.0, 50.0, 1e-3])  # Pa, Pa, s: as in the logs
    sigma = np.tile(sigma, (2, 1)) if each else sigma
    said = (
        r"relative_sigma, row 0 \(peak_overpressure_pa\).*the reading, 10500 .*0.00952"
    )
    with pytest.raises(InputError, match=said):
        fit_many(SCENE, batch.layout, batch.values, sigma, batch.laws)


PLACE = (40.0, 0.0, 1.0)
LAYOUT = layout_of(
    log(
        ("a", "peak_overpressure_pa", 9000.0, 100.0, PLACE),
        ("a", "air_arrival_s", 0.09, 1e-3, PLACE),
        ("a", "bearing_rad", 0.1, 1e-3, PLACE),
    ),
    Scene(),
)
GOOD = np.array([9000.0, -0.09, -0.1])
SIGMA = np.array([0.01, 1e-3, 1e-3])


@pytest.mark.parametrize(
    ("row", "value", "said"),
    [
        (0, -1.0, "peak_overpressure_pa: expected a positive number, got -1.0"),
        (0, np.inf, "peak_overpressure_pa: expected a positive number, got inf"),
        (1, np.nan, "air_arrival_s: expected a finite time, got nan"),
        (2, np.inf, "bearing_rad: expected a finite angle, got inf"),
    ],
)
def test_a_reading_that_cannot_be_is_told_with_what_was_expected(row, value, said):
    values = np.tile(GOOD, (3, 1))
    values[1, row] = value
    found = faults_of(LAYOUT, values, SIGMA, jnp.array([False, True, False]))
    assert found == ((1, f"log 1, row {row}, {said}"),)


@pytest.mark.parametrize("sigma", [-1e-3, np.nan])
def test_an_error_that_cannot_be_is_told(sigma):
    sigmas = np.tile(SIGMA, (2, 1))
    sigmas[1, 1] = sigma
    found = faults_of(LAYOUT, np.tile(GOOD, (2, 1)), sigmas, jnp.array([False, True]))
    said = f"log 1, row 1, air_arrival_s: expected a finite sigma, got {sigma}"
    assert found == ((1, said),)
