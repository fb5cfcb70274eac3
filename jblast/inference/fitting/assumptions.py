r"""Checks of the assumptions of an answer: air, flat ground, speed, ranges of laws.

Still air: with an unknown wind $w$ in addition to the fitted numbers $z$, normal about
0 with standard deviation $s$ towards east and towards north, the covariance of $z$,
which is $P$ in still air, becomes that of both with the wind integrated out,

$$P + A\,(F_{ww} + s^{-2} - F_{wz} A)^{-1} A^T, \quad A = P F_{zw}$$

with $F$ the Fisher information of $z$ and $w$ (the inverse of the block matrix, by its
Schur complement). It is linearised about the answer. Nothing is fitted again, and the
slopes are differences of what is already compiled.

Flat ground: the axes of the frame are straight. A wave along the ground follows the
arc, longer than the chord $d$ by $d^3 / 24 R^2$ (8 mm at 20 km), and a charge fixed at
up = 0 at a distance $s$ from the origin is $s^2 / 2R$ above the ground (31 m at 20 km).

Speed: a shock runs at the speed of sound or faster. The excess of each air arrival over
the travel time of sound $\tau$ is fitted by $b + \epsilon\tau$, weighted by the
covariance of the arrivals, with a constant $b$ for each time of detonation and each
clock that is fitted. The log is slower than sound if $\epsilon$ is positive and so many
standard deviations from zero that chance explains it less often than a poor fit.

Ranges of laws: a number is extrapolated if rows outside the range of their laws hold
more than half of its information. Laws of buried charges are checked at the depth that
few draws exceed, not only at the optimum.

Independent paths: the scatter of more than `path_scatter.MAX_PATHS` paths is taken as
independent. Independent errors average out over neighbours, correlated ones do not, so
intervals are then too narrow. Where the charge lies farther from the middle of the
sensors than these are apart, all paths are neighbours, and the likelihood draws the
charge towards the sensors as well.
"""

import inspect
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.special import ndtri

from jblast.constants import (
    AIR_HEAT_CAPACITY_RATIO,
    DRY_AIR_GAS_CONSTANT,
    STANDARD_SOUND_SPEED,
)
from jblast.inference.consensus import FAR
from jblast.inference.fitting.findings import (
    FlatGround,
    PathsTakenAsIndependent,
    SlowerThanSound,
)
from jblast.inference.fitting.goodness_of_fit import POOR
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.unidentified import requested
from jblast.inference.mode.starts import typical_step
from jblast.inference.posterior.fisher_information import (
    NULL,
    information_of_rows,
    unit_diagonal,
    whitened_rows,
)
from jblast.inference.posterior.parameters import Finding
from jblast.inference.posterior.posterior import Misfit, Posterior
from jblast.inference.sanity import COLDEST
from jblast.observations import Observations
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET, PARAMETERS
from jblast.quantities import TIMES, made_with
from jblast.registry import law_for
from jblast.scene import Scene
from jblast.sensors.layout import Layout, components
from jblast.sensors.path_scatter import MAX_PATHS
from jblast.sensors.record import clock_offsets, record
from jblast.sensors.simulated_readings import paths_of
from jblast.waves.propagation import sound_speed_of

WIND = PARAMETERS["wind_east_m_s"].spread.amount
"""Standard deviation of a wind that nobody measured, either way [m/s]."""
STEP = 1e-3
"""Of differences: that part of a standard deviation, or of a typical step."""
WIDER = 1.05
"""An interval that would be wider by less is not reported."""
SPEEDS = ("air_sound_speed_m_s", "air_temperature_k")
"""Of sound: one that is fitted stands for a wind along ranges."""
BY_AIR = made_with("air_arrival_s")
MAX_NAMED = 3
"""Largest number of assumptions that are named, those that widen intervals most
first.
"""
EARTH_RADIUS = 6_371_008.8
"""Mean radius [m]. Moritz (2000), Geodetic Reference System 1980, J. Geodesy 74."""
NOTICED = 0.1
"""An error of so many sigmas is reported."""
FALL = 1.4
"""Pressures and impulses fall no faster than by this power of the distance, far off."""
DEEP = 0.05
"""Share of the posterior that may lie deeper than where laws are judged."""
MOST_OUTSIDE = 0.5
"""Share of the information about a number that may come from rows outside their laws.

Above one half, extrapolation decides: rows inside their laws would be outvoted. A few
uninformative rows inside their range (ground motion beside the sound of a deep charge)
do not make such an answer valid, and a few uninformative rows outside do not spoil one.
"""


@dataclass(frozen=True)
class WindPassesForSoundSpeed(Finding):
    """Still air was taken, and a wind along the ranges would not be noticed.

    Attributes:
        parameter: What stands for it.
        is_fitted: Whether that is fitted; else a prior on it would do.
    """

    parameter: str
    is_fitted: bool


@dataclass(frozen=True)
class StillAir(Finding):
    """Still air was taken.

    Attributes:
        wind_sd: Of a wind towards east and north, were it unknown [m/s].
        wider: How many times wider the 90 % intervals would be then, those that widen
            most; empty where none would by much, None where that cannot be computed.
    """

    wind_sd: float
    wider: Mapping[str, float] | None


def still_air(solution: Solution) -> Finding | None:
    """Return what still air did to an answer; None where not taken, or not felt."""
    posterior = solution.posterior
    air = posterior.parameters.scene.air
    known_wind = any(name.startswith("wind_") for name in posterior.parameters.names)
    if known_wind or float(air.wind_east) or float(air.wind_north):
        return None
    arrivals = bool(set(BY_AIR) & set(posterior.layout.quantities()))
    factors = wider_with_wind(solution)
    if factors is None:
        decides = SPEEDS if air.sound_speed is None else SPEEDS[:1]
        fitted = [name for name in decides if name in posterior.parameters.names]
        if not arrivals:
            return None
        return WindPassesForSoundSpeed((fitted or SPEEDS)[0], bool(fitted))
    worst = sorted(
        (name for name, factor in factors.items() if factor >= WIDER),
        key=lambda name: -factors[name],
    )
    if worst:
        return StillAir(WIND, {name: factors[name] for name in worst[:MAX_NAMED]})
    if not np.isfinite(list(factors.values())).all():
        return StillAir(WIND, None)
    return StillAir(WIND, {}) if arrivals else None


def wider_with_wind(solution: Solution, sd: float = WIND) -> dict[str, float] | None:
    """Return by what factor each interval would widen; None if no row feels a wind.

    NaN where predictions have no slopes.

    Args:
        solution: What was found in still air.
        sd: Of the wind's components [m/s].
    """
    posterior, normal = solution.posterior, solution.laplace
    here = posterior.misfit(jnp.asarray(normal.z))
    to_wind = _slopes_to_wind(posterior, normal.z)
    if not to_wind.any():
        return None
    sds = np.sqrt(np.diag(normal.covariance))
    typical = np.asarray(typical_step(posterior))
    steps = STEP * np.where(sds > 0, np.minimum(sds, typical), typical)
    to_fitted = np.stack(
        [
            _slope(*(posterior.misfit(jnp.asarray(normal.z + s)) for s in (-d, d)))
            / step
            for step, d in zip(steps, np.diag(steps), strict=True)
        ],
        axis=1,
    )
    weighted = _weighted(here, information_of_rows(posterior, here), to_wind)
    gain = normal.covariance @ to_fitted.T @ weighted
    left = to_wind.T @ weighted + np.eye(2) / sd**2 - weighted.T @ to_fitted @ gain
    if np.isfinite(left).all():
        left = np.linalg.pinv(left, hermitian=True)
    added = np.diag(gain @ left @ gain.T)
    return {
        name: float(np.sqrt(1 + max(more, 0.0) / one**2))
        for name, one, more in zip(posterior.parameters.names, sds, added, strict=True)
        if one > 0
    }


def _slopes_to_wind(posterior: Posterior, z) -> Float[np.ndarray, "row 2"]:
    """Return how predictions move with the wind towards east and north."""
    where = (
        lambda p: p.parameters.scene.air.wind_east,
        lambda p: p.parameters.scene.air.wind_north,
    )
    step = STEP * WIND
    columns = []
    for component in where:
        ends = (
            eqx.tree_at(component, posterior, component(posterior) + side * step)
            for side in (-1, 1)
        )
        columns.append(_slope(*(end.misfit(jnp.asarray(z)) for end in ends)) / step)
    return np.stack(columns, axis=1)


def _slope(before: Misfit, after: Misfit) -> Float[np.ndarray, " row"]:
    """Return half of what predictions rose by from one place to another."""
    return 0.5 * (np.asarray(before.residual) - np.asarray(after.residual))


def _weighted(here: Misfit, of_rows, columns: Float[np.ndarray, "row column"]):
    """Return columns times the inverse covariance of the rows, shared effects and all.

    By the Woodbury identity: no matrix of rows by rows.
    """
    weight = np.reshape(of_rows, (-1, 1)) / np.asarray(here.sd)[:, None] ** 2
    loading = np.asarray(here.loading)
    known = np.eye(loading.shape[1]) + loading.T @ (weight * loading)
    shared = np.linalg.solve(known, loading.T @ (weight * columns))
    return weight * (columns - loading @ shared)


def slower_than_sound(
    observations: Observations, solution: Solution
) -> SlowerThanSound | None:
    """Return the arrivals that imply a speed below that of sound, if scatter does not.

    If air temperature or sound speed are fitted, sound is that of the coldest air at
    least. Arrivals from beyond `consensus.FAR` may come through the thermosphere, which
    is slower, and lower bounds are no arrivals: both are left out.
    """
    posterior, z = solution.posterior, jnp.asarray(solution.laplace.z)
    misfit = posterior.misfit(z)
    distance = np.asarray(misfit.slant_range)
    quantity = np.array(observations.quantity)
    used = (quantity == "air_arrival_s") & (distance > 0.0) & (distance <= FAR)
    if posterior.lower_bound is not None:
        used &= ~np.asarray(posterior.lower_bound)
    scene, layout = posterior.parameters.scene_at(z), posterior.layout
    shot, names = np.array(layout.shot), posterior.parameters.names
    constants = [
        shot == n
        for n, charge in enumerate(scene.charges)
        if f"origin_time_s{scene.label(charge)}" in names
    ]
    clocks = np.array(layout.clock)
    constants += [
        clocks == name.removeprefix(f"{CLOCK_OFFSET}.")
        for name in names
        if name.startswith(f"{CLOCK_OFFSET}.")
    ]
    constants = [used & rows for rows in constants if (used & rows).any()]
    if used.sum() <= len(constants):
        return None
    sound = _sound_speeds(scene, layout, distance, names)
    origin = np.array([float(charge.time_s) for charge in scene.charges])[shot]
    took = observations.value - origin - np.asarray(clock_offsets(scene, layout))
    tau = np.where(used, distance / sound, 0.0)
    excess = np.where(used, took - tau, 0.0)
    columns = jnp.asarray(np.stack([*constants, tau, excess], axis=1))
    *known, late = np.asarray(whitened_rows(posterior, misfit, columns)).T
    design = np.stack(known, axis=1)
    found, _, rank, _ = np.linalg.lstsq(design, late)
    if rank < design.shape[1] or not np.isfinite(found).all():
        return None
    sd = float(np.sqrt(np.linalg.inv(design.T @ design)[-1, -1]))
    if not found[-1] > -ndtri(POOR) * sd:
        return None
    own = excess - sum(b * c for b, c in zip(found[:-1], constants, strict=True))
    scatter = np.hypot(misfit.sd, np.linalg.norm(np.asarray(misfit.loading), axis=1))
    slowness = np.where(used, 1.0 + own / np.where(used, tau, 1.0), -np.inf)
    slowest = int(np.argmax(slowness))
    late_rows = np.flatnonzero(used & (own > np.minimum(scatter, own[slowest] / 2)))
    order = late_rows[np.argsort(-slowness[late_rows])]
    sensors = dict.fromkeys([observations.sensor[row] for row in (slowest, *order)])
    return SlowerThanSound(
        sensors=tuple(sensors),
        speed_m_s=float(sound[slowest] / slowness[slowest]),
        sound_m_s=float(sound[slowest]),
    )


def _sound_speeds(
    scene: Scene,
    layout: Layout,
    distance: Float[np.ndarray, " row"],
    names: Collection[str],
) -> Float[np.ndarray, " row"]:
    """Return the speed of sound from the charge to each row, with the wind [m/s]."""
    air = scene.air
    speed = float(sound_speed_of(air))
    if not {"air_sound_speed_m_s", "air_temperature_k"}.isdisjoint(names):
        coldest = AIR_HEAT_CAPACITY_RATIO * DRY_AIR_GAS_CONSTANT * COLDEST
        speed = max(speed, float(np.sqrt(coldest)))
    charges = np.array([np.asarray(charge.position_m) for charge in scene.charges])
    away = np.asarray(layout.position) - charges[np.array(layout.shot)]
    wind = np.array([float(air.wind_east), float(air.wind_north), 0.0])
    along = np.nan_to_num(away) @ wind / np.where(distance > 0.0, distance, 1.0)
    return speed + along


def flat_ground(
    observations: Observations,
    charge: Float[np.ndarray, "row 3"],
    slant_range: Float[np.ndarray, " row"],
) -> FlatGround | None:
    """Return the reading that the flat ground is furthest off for, if it is noticed.

    Args:
        observations: The log; None is returned of one without a place on the Earth.
        charge: East, north, up of each row's charge [m].
        slant_range: Distance of each row from it [m].
    """
    if observations.frame is None or not len(observations):
        return None
    arc = slant_range**3 / (24.0 * EARTH_RADIUS**2)
    drop = np.sum(charge[:, :2] ** 2, axis=1) / (2.0 * EARTH_RADIUS)
    level = observations.position - charge
    lower = level + drop[:, None] * np.array([0.0, 0.0, 1.0])
    tilt = np.abs(np.linalg.norm(lower, axis=1) - np.linalg.norm(level, axis=1))
    error = arc + tilt
    timed = np.isin(observations.quantity, TIMES)
    share = FALL * error / np.maximum(slant_range, 1.0)
    shift = np.where(timed, error / STANDARD_SOUND_SPEED, share)
    sigmas = np.nan_to_num(shift / observations.error_scale())
    worst = int(np.argmax(sigmas))
    if not sigmas[worst] > NOTICED:
        return None
    return FlatGround(
        observations.sensor[worst],
        observations.quantity[worst],
        float(slant_range[worst]),
        float(error[worst]),
        float(sigmas[worst]),
    )


def paths_taken_as_independent(solution: Solution) -> PathsTakenAsIndependent | None:
    """Return how many neighbouring paths were taken as independent, if any were."""
    posterior, parameters = solution.posterior, solution.posterior.parameters
    layout = posterior.layout
    if len(layout.quantity) <= MAX_PATHS:
        return None
    scene = parameters.scene_at(jnp.asarray(solution.laplace.z))
    # traced alone, as only the names of what scatters from path to path are needed
    recording = eqx.filter_eval_shape(record, scene, layout, dict(posterior.laws))
    position, given = np.asarray(layout.position), np.asarray(layout.slant_range) > 0
    most, beyond = 0, False
    for _, quantity, shot in recording.fields:
        rows, first, _ = paths_of(layout, quantity, shot)
        one_each = rows[first]
        # paths without a direction are independent of all others
        near = one_each[~given[one_each]]
        is_ranged = scene.charges[shot].range_m is not None
        if is_ranged or len(one_each) <= MAX_PATHS or len(near) < 2:
            continue
        most = max(most, len(near))
        charge = scene.charges[shot]
        place = {f"{name}{scene.label(charge)}" for name in CHARGE_POSITION[:2]}
        if place & {*parameters.names}:
            level = position[near, :2]
            away = np.asarray(charge.position_m)[:2] - level.mean(axis=0)
            # the diagonal of the box, as pairs of a million sensors are too many
            beyond |= bool(np.hypot(*away) > np.hypot(*np.ptp(level, axis=0)))
    return PathsTakenAsIndependent(most, MAX_PATHS, beyond) if most else None


def valid_at_depth(
    solution: Solution, draws: Float[np.ndarray, "draw free"]
) -> Bool[np.ndarray, " row"]:
    """Return whether laws that depend on depth hold at a depth that few draws exceed.

    An overestimated mass brings a buried charge nearer to the surface, over the cube
    root by which depths are scaled; so an answer may lie in a law's range that its own
    90 % interval leaves. Depth and mass alone are put in the place of the answer's; a
    charge that is not buried is not judged, nor a row by a law that asks for no depth.

    Args:
        solution: What was found.
        draws: Coordinates drawn from the posterior.
    """
    posterior, parameters = solution.posterior, solution.posterior.parameters
    at = parameters.scene_at(jnp.asarray(solution.laplace.z))
    drawn = parameters.values_of_each(jnp.asarray(draws))
    valid = np.ones(len(posterior.measured), bool)
    by_depth = [
        any(
            "height_of_burst" in inspect.signature(law.valid).parameters
            for part, _ in components(quantity)
            for law in [law_for(part, solution.laws[part].name)]
        )
        for quantity in posterior.layout.quantity
    ]
    for shot, charge in enumerate(at.charges):
        if not float(charge.up) < 0:
            continue
        label = at.label(charge)
        known = {
            f"charge_up_m{label}": charge.up,
            f"charge_mass_kg{label}": charge.mass_kg,
        }
        up, mass = (
            np.asarray(drawn.get(name, np.full(len(draws), float(fixed))))
            for name, fixed in known.items()
        )
        deepest = np.argsort(up / np.cbrt(mass))[int(DEEP * len(draws))]
        moved = [name in known for name in parameters.names]
        deep = np.where(moved, draws[deepest], solution.laplace.z)
        holds = np.asarray(posterior.misfit(jnp.asarray(deep)).valid)
        judged = by_depth & (np.array(posterior.layout.shot) == shot)
        valid &= holds | ~judged
    return valid


def extrapolated(
    solution: Solution, valid: Bool[np.ndarray, " row"]
) -> tuple[str, ...]:
    r"""Return the requested numbers that rest on rows outside the range of their laws.

    Of a number with variance $1/I$, all other numbers fitted too, the share of the
    information that rows outside hold is $1 - I_{in}/I$. $I_{in}$ is of the rows
    inside and of the priors alone. Numbers that nothing identifies are not named.

    Args:
        solution: Result of the inference.
        valid: Whether the law of each row holds at the answer.
    """
    if valid.all():
        return ()
    everything = _information(solution, jnp.ones(len(valid), bool))
    inside = _information(solution, jnp.asarray(valid))
    names = solution.posterior.parameters.names
    asked = requested(names)
    return tuple(
        name
        for name, is_determined, all_rows, some in zip(
            names,
            solution.identifiability.determined,
            everything,
            inside,
            strict=True,
        )
        if name in asked and is_determined and some < (1 - MOST_OUTSIDE) * all_rows
    )


def _information(
    solution: Solution, used: Bool[Array, " row"]
) -> Float[np.ndarray, " free"]:
    """Return one over the variance of each number, of some rows and the priors."""
    posterior, z = solution.posterior, jnp.asarray(solution.laplace.z)
    misfit = posterior.misfit(z)
    misfit = eqx.tree_at(lambda m: m.sd, misfit, jnp.where(used, misfit.sd, jnp.inf))
    slopes = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    rows = whitened_rows(posterior, misfit, slopes)
    rows = jnp.concatenate([rows, jnp.diag(posterior.parameters.has_prior())])
    matrix = rows.T @ rows
    if not bool(jnp.isfinite(matrix).all()):
        return np.full(len(z), np.nan)
    size, values, vectors = map(
        np.asarray, unit_diagonal(matrix, jnp.asarray(typical_step(posterior)))
    )
    variance = (vectors**2 / np.maximum(values, NULL)).sum(axis=1) / size**2
    return 1 / variance
