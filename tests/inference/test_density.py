"""The density of a log: against sums, integrals, the same in JAX, and its slopes."""

import dataclasses
import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, t as student

import calibration
from jblast.inference import posterior_of
from jblast.inference.answer import unconstrained
from jblast.inference.density import Density, density_of
from jblast.inference.fitting.solution import solve as solve_log
from jblast.inference.identify import echelon, estimable_forms
from jblast.inference.likelihood import exact_gain, log_likelihoods
from jblast.inference.posterior.fisher_information import (
    information_with_each,
    linearised,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.sample import solve
from jblast.observations import Observations, read, resolve_positions
from jblast.observations.grouping import located
from jblast.observations.scenes import for_log
from jblast.scene import (
    Free,
    LogNormal,
    Scene,
    UncertainScene,
    default_scene,
    freed,
    read_scene,
    with_laws,
)
from jblast.sensors import layout_of, record
from jblast.sensors.path_scatter import KERNELS, correlations
from jblast.sensors.simulated_readings import Noise
from tests.catalogue import AROUND
from tests.inference.logs import log
from tests.tools.slopes import check_slopes

SIGMA = {"air_arrival_s": 1e-3, "peak_overpressure_pa": 0.05}
LAWS = tuple((quantity, "shock_kinematics") for quantity in SIGMA)
RNG = np.random.default_rng


def made(scatter=True):
    """Return a log of five microphones about 15 kg at the origin, without errors."""
    rows = [
        (f"m{i}", quantity, 1.0, 1.0, (*place, 1.5))
        for i, place in enumerate(AROUND)
        for quantity in SIGMA
    ]
    scene = Scene(law=LAWS, scatter=scatter)
    blank = log(*rows)
    value = record(scene, layout_of(blank, scene), dict(LAWS)).value
    rows = [
        (*row[:2], float(x), SIGMA[row[1]] * (x if "peak" in row[1] else 1.0), row[4])
        for row, x in zip(rows, np.asarray(value), strict=True)
    ]
    return log(*rows), scene


@functools.cache
def density(free, noise: Noise = "student", scatter=True):
    observations, scene = made(scatter)
    return density_of(observations, freed(UncertainScene(scene), list(free)), noise)


@functools.cache
def solved():
    """Five microphones about a charge, four unknowns."""
    return solve(density(PLACED))


MASS = ("charge_mass_kg",)
TIMED = ("charge_mass_kg", "origin_time_s")
PLACED = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")


def test_the_density_of_all_numbers_has_that_of_the_coordinates():
    found = density(MASS, "gaussian")
    assert found.coordinates.linear == ()
    ln_mass = np.log([8.0, 15.0, 30.0])[:, None]
    expected = jax.jit(jax.vmap(found.log_density))(ln_mass)
    # the flat prior of a mass has a density in one, up to a constant in the other
    prior = found.coordinates.log_prior(ln_mass)
    np.testing.assert_allclose(found(ln_mass) - prior, expected, rtol=1e-8)


def test_a_linear_time_is_integrated_out():
    found = density(TIMED, "gaussian")
    names = found.coordinates.names
    assert [names[i] for i in found.coordinates.linear] == ["origin_time_s"]
    ln_mass = np.log([12.0, 15.0])[:, None]
    times = np.linspace(-0.03, 0.03, 2001)
    order = [names.index(name) for name in TIMED]
    each = jax.jit(jax.vmap(found.log_density))
    for z, own in zip(
        ln_mass, found(ln_mass) - found.coordinates.log_prior(ln_mass), strict=True
    ):
        at = np.empty((len(times), 2))
        at[:, order[0]], at[:, order[1]] = z[0], times
        # the trapezoidal rule is exact for a normal far inside its ends
        whole = logsumexp(np.asarray(each(at))) + np.log(times[1] - times[0])
        assert own == pytest.approx(whole, abs=1e-6)


@pytest.mark.parametrize("free", [MASS, PLACED])
def test_the_prior_of_all_numbers_is_that_of_the_coordinates(free):
    found = density(free)
    axes = found.coordinates
    u = axes.start(3)[:5]
    values = axes.values(u)
    # the Jacobian of the coordinates, by differences
    z = unconstrained(found, values)
    kept = [i for i in range(len(axes.names)) if i not in axes.linear]
    log_size = []
    for at in u:
        step = 1e-5 * np.eye(axes.size)
        ends = [unconstrained(found, axes.values(at + s[:, None].T)) for s in step]
        back = [unconstrained(found, axes.values(at - s[:, None].T)) for s in step]
        slopes = (np.concatenate(ends) - np.concatenate(back))[:, kept] / 2e-5
        log_size.append(np.linalg.slogdet(slopes)[1])
    by_values = np.array([float(axes.log_prior_of(np, one)) for one in values])
    off = axes.log_prior(u) - np.array(log_size) - by_values
    assert z.shape == values.shape
    np.testing.assert_allclose(off, off[0], atol=1e-4)


def test_coordinates_lead_back_to_themselves():
    axes = density(PLACED).coordinates
    u = axes.start(2)[:50]
    np.testing.assert_allclose(axes.of_values(axes.values(u)), u, atol=1e-9)


def test_student_errors_that_nobody_shares_are_those_of_their_formula():
    found = density(MASS, scatter=False)
    rows, u = found.rows, np.log([[13.0], [15.0], [16.0]])
    seen = found.seen(u)
    total, field = log_likelihoods(np, rows, seen)
    away = (rows.measured - seen.predicted) / rows.sigma
    exact = (student.logpdf(away, 4) - np.log(rows.sigma)).sum(1)
    # without shared errors the field is no approximation
    np.testing.assert_allclose(total[:, 0], exact, rtol=1e-9)
    kernel = np.zeros(len(u), int)
    gain, _ = exact_gain(rows, field, kernel, total[:, 0], 100, RNG(0))
    np.testing.assert_allclose(gain, 0.0, atol=1e-9)


def test_numpy_and_jax_agree():
    found = density(PLACED)
    assert len(found.rows.kernels) > 1
    u = found.coordinates.start(0)[:40]
    seen = found.seen(u)
    one, _ = log_likelihoods(np, found.rows, seen)
    other, _ = jax.jit(lambda seen: log_likelihoods(jnp, found.rows, seen))(seen)
    best = one > one.max() - 1e4
    np.testing.assert_allclose(one[best], np.asarray(other)[best], rtol=1e-8)


def test_slopes_are_those_of_differences():
    found = density(PLACED)
    # beside the answer, where the change of the errors themselves hardly counts
    at = solved()[1].modes.u[0] + np.array([2e-4, -3e-4, 0.02])
    slope = found.scored(at[None]).slope[0]
    step = 1e-5 * np.eye(3)
    ends = found(np.concatenate([at + step, at - step])).reshape(2, 3)
    differences = (ends[0] - ends[1]) / 2e-5
    np.testing.assert_allclose(slope, differences, rtol=0.1, atol=2.0)


def test_the_start_and_the_prior_are_densities():
    axes = density(PLACED).coordinates
    u = axes.start(1)
    assert np.isfinite(axes.log_start(u)).all()
    # the mean of prior over start is 1: both integrate to 1
    share = np.exp(axes.log_prior(u) - axes.log_start(u)).mean()
    assert share == pytest.approx(1.0, abs=0.1)


def test_draws_hold_the_truth_and_know_their_weights():
    found, draws = solved()
    assert draws.reliable
    assert draws.weights.sum() == pytest.approx(1.0)
    mean = draws.weights @ draws.values
    sd = np.sqrt(draws.weights @ (draws.values - mean) ** 2)
    truth = {"charge_mass_kg": 15.0}
    exact = np.array([truth.get(name, 0.0) for name in found.coordinates.names])
    assert (np.abs(mean - exact) < 2 * sd).all()


CASES = Path(__file__).parent / "arrays"
NEIGHBOURS = {"air_arrival_s": "kingery_bulmash"}
TRUE = {
    "charge_mass_kg": 1.0,
    "charge_east_m": 33.0,
    "charge_north_m": 22.0,
    "origin_time_s": 1.0,
}
NEAR = (
    TRUE
    | {"charge_mass_kg": 0.017, "charge_east_m": 4.1}
    | {"charge_north_m": 2.7, "origin_time_s": 1.1042}
)
"""What was answered while neighbouring paths were taken as independent."""


def ring(noise):
    uncertain, log = read_scene(CASES / "free.toml"), read(CASES / "ring_40m.csv")
    return density_of(log, with_laws(uncertain, NEIGHBOURS), noise)


def at(density, values):
    """Numbers of a place, its origin time moved so that rows agree on average."""
    names = density.coordinates.names
    found = np.array([values[name] for name in names])
    missed = density.rows.measured - density.seen_with(found[None]).predicted[0]
    found[names.index("origin_time_s")] += missed.mean()
    return found


def test_the_density_is_the_mean_of_normal_ones_over_the_correlations():
    density = ring("gaussian")
    values = at(density, TRUE)
    seen = density.seen_with(values[None])
    left = density.rows.measured - seen.predicted[0]
    sd, shot = seen.arrival["air_arrival_s"][0], seen.shot["air_arrival_s"][0]
    each = []
    for weights in jnp.eye(len(KERNELS)):
        place = jnp.asarray(seen.place[0])
        rho = np.array(correlations(place, place, weights))
        np.fill_diagonal(rho, 1.0)
        covariance = np.outer(sd, sd) * rho + np.outer(shot, shot)
        covariance += np.diag(np.square(density.rows.sigma))
        normal: Any = multivariate_normal
        each.append(normal.logpdf(left, cov=covariance))
    expected = np.logaddexp.reduce(each) - np.log(len(KERNELS))
    got = density.of_readings(values[None])[0]
    np.testing.assert_allclose(got, expected, atol=1e-3)  # the nugget


@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_a_small_array_does_not_pull_the_charge_towards_itself(noise):
    density = ring(noise)
    there, near = density.of_readings(np.stack([at(density, TRUE), at(density, NEAR)]))
    assert there > near + 0.5


@pytest.mark.slow
def test_the_density_has_the_slopes_of_its_differences():
    density = ring("gaussian")
    scale = jnp.array([1.0, 1.0, 1.0, 1e-3])
    z = jnp.asarray(unconstrained(density, at(density, TRUE)[None])[0])
    check_slopes(
        lambda w: density.log_density(z + scale * w), (jnp.zeros(4),), 2, rtol=1e-4
    )


LOG = log(
    ("a", "air_arrival_s", 0.1, 1e-3, 40.0),
    ("a", "peak_overpressure_pa", 2e4, 1e3, 40.0),
    ("b", "peak_overpressure_pa", 9e3, 5e2, 70.0),
    ("c", "positive_impulse_pa_s", 80.0, 5.0, 90.0),
    at_range=True,
)
CHOSEN = {
    "air_arrival_s": "kingery_bulmash",
    "peak_overpressure_pa": "kingery_bulmash",
    "positive_impulse_pa_s": "ford_2021",
}


def posterior(noise):
    beliefs = {
        "charge_mass_kg": Free(positive=True),
        "origin_time_s": Free(positive=False),
        "air_temperature_k": LogNormal(288.0, 1.02),
    }
    parameters = parameters_of(UncertainScene(Scene(), beliefs))
    layout = layout_of(LOG, parameters.scene)
    return posterior_of(parameters, layout, LOG, CHOSEN, noise)


Z = jnp.array([np.log(50.0), 0.01, 0.3])


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "weight"), [("gaussian", 1.0), ("student", 5 / 7)])
def test_information_is_that_of_the_whole_covariance(noise, weight):
    asked = posterior(noise)
    misfit = asked.misfit(Z)
    covariance = np.diag(np.asarray(misfit.sd) ** 2 / weight) + np.asarray(
        misfit.loading @ misfit.loading.T
    )
    slopes = np.asarray(jax.jacfwd(lambda z: asked.misfit(z).residual)(Z))
    expected = slopes.T @ np.linalg.solve(covariance, slopes) + np.diag([0, 0, 1])
    # routes through the same algebra: rounding only
    linear = linearised(asked, Z)
    (whole,) = information_with_each(asked, *linear, 4)
    np.testing.assert_allclose(whole, expected, rtol=1e-9)
    _, with_last = information_with_each(asked, *linear, 3)
    np.testing.assert_allclose(with_last, expected, rtol=1e-9)


def test_echelon_rows_lead_with_a_one_of_their_own():
    rows = np.array([[1.0, -0.2, 0.5], [2.0, -0.4, 3.0]])
    np.testing.assert_allclose(
        echelon(rows), [[1.0, -0.2, 0.0], [0.0, 0.0, 1.0]], atol=1e-12
    )


def test_told_combinations_stand_still_along_null_directions():
    null = np.array([[1.0, -0.2, 0.0, -0.02]])
    told = estimable_forms(null, (False, False, True, False))
    assert told.shape == (2, 4)
    np.testing.assert_allclose(told @ null.T, 0, atol=1e-12)
    np.testing.assert_allclose(told[:, 2], 0)
    for expected in ([0.2, 1, 0, 0], [0.02, 0, 0, 1]):
        assert any(np.allclose(row, expected) for row in told)


DATA = Path(calibration.__path__[0]) / "data"
LOGS = ("hta_1", "hri_2", "trinity", "five_microphones", "camera_and_bang", "six_clips")
FORD: dict[str, str] = {
    "positive_impulse_pa_s": "ford_2021",
    "positive_duration_s": "ford_2021",
}
REACH, STEP = 5.0, 0.0125
"""How far from the mode each coordinate goes, and in what steps. Both are less for a
coordinate, as a time, of which a tenth of a standard deviation is less than a step."""
DATES = {"six_clips": ("2024-05-17", "UTC")}
"""Date and zone of times of day."""


def kept_log(name: str) -> tuple[Observations, UncertainScene]:
    """Read a log of `calibration/data` and its scene, as `fit` takes them."""
    date, zone = DATES.get(name, (None, None))
    log = read(DATA / f"{name}.csv", date=date, zone=zone)
    scene = DATA / f"{name}.toml"
    uncertain = for_log(read_scene(scene) if scene.exists() else default_scene(), log)
    log = located(log, uncertain)
    return resolve_positions(log, uncertain.scene, uncertain.beliefs), uncertain


def ford_density(name: str, noise: Noise) -> Density:
    """Return the density of a log of impulses and durations."""
    log, uncertain = kept_log(name)
    return density_of(log, with_laws(uncertain, FORD), noise)


def assert_smooth(density: Density, places: np.ndarray, axis: int) -> None:
    """Assert that values follow slopes from place to place, and slopes differences.

    Args:
        density: The density.
        places: Coordinates in even steps along one axis.
        axis: Which.
    """
    both = jax.jit(jax.vmap(jax.value_and_grad(density.log_density)))
    value, slope = (np.asarray(x) for x in both(places))
    assert np.isfinite(value).all()
    slope, steps = slope[:, axis], np.diff(places[:, axis])
    by_slopes = 0.5 * (slope[1:] + slope[:-1]) * steps
    # where one maximum over the effects takes over from another the density has a kink:
    # there the mean slope is off by up to half of its change along a step
    bend = np.abs(np.diff(slope)) * steps
    np.testing.assert_array_less(
        np.abs(np.diff(value) - by_slopes), 0.02 + 0.51 * bend, err_msg=str(axis)
    )
    near = 1e-5 * np.eye(places.shape[1])[axis]
    change = np.asarray(both(places + near)[0]) - np.asarray(both(places - near)[0])
    difference = change / 2e-5
    rounding = 1e-14 * np.abs(value) / 1e-5
    off = np.abs(difference - slope) > 1e-2 * np.abs(difference) + 1e-3 + rounding
    assert not off.any(), (axis, places[off, axis], difference[off], slope[off])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hta_1", "hri_2"])
def test_student_errors_far_from_the_mode_leave_no_steps(name):
    density = ford_density(name, "student")
    assert_smooth(density, np.arange(-4.0, 12.0, STEP)[:, None], 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_each_kept_log_has_a_smooth_density_along_each_coordinate(name):
    solution = solve_log(*kept_log(name))
    mode = solution.answer.z
    # of each coordinate given the others: a ridge is steeper across than it is long
    steepness = np.abs(np.diag(jax.hessian(solution.density.log_density)(mode)))
    sd = np.minimum(solution.answer.sds, steepness**-0.5)
    offsets = np.arange(-REACH, REACH, STEP)
    scale = np.where(sd > 0, np.minimum(0.1 * sd / STEP, 1.0), 1.0)
    for noise in ("student", "gaussian"):
        rows = dataclasses.replace(solution.density.rows, noise=noise)
        density = dataclasses.replace(solution.density, rows=rows)
        for axis in range(mode.size):
            # a time known to 0.15 ms: 7 sd away it is that of a frame with a fireball,
            # and ln of its radius has no end
            if 0 < sd[axis] < 1e-3:
                continue
            away = scale[axis] * offsets
            places = mode[None, :] + away[:, None] * np.eye(mode.size)[axis]
            assert_smooth(density, places, axis)
