"""Checks of the assumptions of an answer: air, flat ground, speed, ranges of laws.

Still air: an unknown wind, normal about 0 towards east and towards north, is integrated
out beside the fitted numbers. It is linearised about the answer (`Answer.covariance`):
nothing is fitted again, and the slopes are differences of what is already compiled.

Flat ground: the axes of the frame are straight. A wave along the ground follows the
arc, longer than the chord d by d^3 / 24 R^2 (8 mm at 20 km), and a charge fixed at
up = 0 at a distance s from the origin is s^2 / 2R above the ground (31 m at 20 km).

Speed: a shock runs at the speed of sound or faster. The excess of each air arrival over
the travel time of sound tau is fitted by b + e tau, weighted by the covariance of the
arrivals, with a constant b for each time of detonation and each clock that is fitted.
The log is slower than sound if e is significantly positive, at the level of a poor fit
(`POOR`).

Ranges of laws: a number is extrapolated if rows outside the range of their laws have
more than half of its information. Laws of buried charges are checked at the depth that
few draws exceed, not only at the optimum.

Independent paths: the scatter of more than `path_scatter.MAX_PATHS` paths is taken as
independent. Independent errors average out over neighbours, correlated ones do not, so
intervals are then too narrow. Where the charge lies farther from the middle of the
sensors than these are apart, all paths are neighbours, and the likelihood draws the
charge towards the sensors as well.
"""

import inspect
from collections.abc import Collection

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtri

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.answer import STEP, Answer
from jblast.inference.consensus import STRATOSPHERE_RANGE
from jblast.inference.density import WIND as WINDS
from jblast.inference.fitting.goodness_of_fit import POOR
from jblast.inference.fitting.solution import Solution
from jblast.inference.identify import requested
from jblast.inference.sanity import COLDEST_SOUND
from jblast.observations import Observations
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET, PARAMETERS
from jblast.quantities import TIMES, made_with
from jblast.registry import law_for
from jblast.results import Note, assumption, warning
from jblast.scene import Scene
from jblast.sensors.forward_model import clock_offsets
from jblast.sensors.layout import Layout, components
from jblast.sensors.path_scatter import MAX_PATHS
from jblast.waves.propagation import sound_speed_of

WIND = PARAMETERS["wind_east_m_s"].spread.amount
"""Standard deviation of an unmeasured wind, each component [m/s]."""
WIDER = 1.05
"""Smallest factor by which a wider interval is reported: 5 % is within the error of an
interval."""
SPEEDS = ("air_sound_speed_m_s", "air_temperature_k")
"""Numbers that set the speed of sound. A fitted one absorbs a wind along the ranges."""
BY_AIR = made_with("air_arrival_s")  # quantities that depend on the travel time
MAX_NAMED = 3
"""Largest number of assumptions that are named, those that widen intervals most
first.
"""
EARTH_RADIUS = 6_371_008.8
"""Mean radius [m]. Moritz (2000), Geodetic Reference System 1980, J. Geodesy 74."""
NOTICED = 0.1
"""Smallest reported error of flat ground, in sigmas of the reading: below, it adds less
than 1 % to the error."""
FAR_FIELD_POWER = 1.4
"""Largest power of the distance by which pressures and impulses fall in the far field,
where flat ground matters."""
DEEPER_SHARE = 0.05
"""Share of the posterior deeper than the depth at which laws are checked: the bound of
the 90 % interval."""
MAX_OUTSIDE = 0.5
"""Largest share of the information about a number from rows outside their laws.

Above one half, extrapolation decides: rows inside their laws would be outvoted. A few
uninformative rows inside their range (ground motion beside the sound of a deep charge)
do not make such an answer valid, and a few uninformative rows outside do not spoil one.
"""


def still_air(answer: Answer) -> list[Note]:
    """Return the effect of still air, if it is assumed and has an effect."""
    density = answer.density
    air, names = density.scene.air, density.coordinates.names
    known_wind = any(name.startswith("wind_") for name in names)
    if known_wind or float(air.wind_east) or float(air.wind_north):
        return []
    arrivals = bool(set(BY_AIR) & set(density.layout.quantities()))
    factors = wider_with_wind(answer)
    if factors is None:
        decides = SPEEDS if air.sound_speed is None else SPEEDS[:1]
        fitted = [name for name in decides if name in names]
        if not arrivals:
            return []
        kind = "wind_is_fitted" if fitted else "wind_needs_prior"
        return [assumption(kind, parameter=(fitted or SPEEDS)[0])]
    worst = sorted(
        (name for name, factor in factors.items() if factor >= WIDER),
        key=lambda name: -factors[name],
    )
    if worst:
        wider = {name: factors[name] for name in worst[:MAX_NAMED]}
        return [assumption("still_air", wind_sd=WIND, wider=wider)]
    if not np.isfinite(list(factors.values())).all():
        return [assumption("still_air_unknown", wind_sd=WIND)]
    return [assumption("still_air_matters_little", wind_sd=WIND)] if arrivals else []


def wider_with_wind(answer: Answer, sd: float = WIND) -> dict[str, float] | None:
    """Return the factor by which an unknown wind would widen each interval.

    None if no prediction depends on the wind; NaN where predictions have no slopes.

    Args:
        answer: Answer in still air.
        sd: Standard deviation of each wind component [m/s].
    """
    to_wind = answer.slopes_by(dict.fromkeys(WINDS, STEP * WIND))
    if not to_wind.any():
        return None
    alone, beside = (
        np.sqrt(np.diag(answer.covariance(columns, sd=sd)))
        for columns in (None, to_wind)
    )
    return {
        name: float(wider / one)
        for name, wider, one in zip(answer.names, beside, alone, strict=True)
        if one > 0
    }


def slower_than_sound(observations: Observations, answer: Answer) -> list[Note]:
    """Return the arrivals that imply a speed below that of sound, if scatter does not.

    If air temperature or sound speed are fitted, the speed is at least that of the
    coldest air. Arrivals from beyond `consensus.STRATOSPHERE_RANGE` may come through
    the thermosphere, which is slower. Lower bounds are no arrivals. Both are left out.
    """
    distance = answer.slant_range
    quantity = np.array(observations.quantity)
    used = (
        (quantity == "air_arrival_s")
        & (distance > 0.0)
        & (distance <= STRATOSPHERE_RANGE)
    )
    used &= ~answer.rows.is_bound
    scene, layout = answer.scene, answer.density.layout
    shot, names = np.array(layout.shot), answer.names
    # a free origin time or clock offset shifts all of its arrivals alike: each is
    # fitted with a constant
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
        return []
    sound = _sound_speeds(scene, layout, distance, names)
    origin = np.array([float(charge.time_s) for charge in scene.charges])[shot]
    took = observations.value - origin - np.asarray(clock_offsets(scene, layout))
    tau = np.where(used, distance / sound, 0.0)
    excess = np.where(used, took - tau, 0.0)
    design = np.stack([*constants, tau], axis=1).astype(float)
    # generalised least squares
    weighted = answer.weigh(design)
    known = design.T @ weighted
    if not np.isfinite(known).all() or np.linalg.matrix_rank(known) < len(known):
        return []
    found = np.linalg.solve(known, weighted.T @ excess)
    sd = float(np.sqrt(np.linalg.inv(known)[-1, -1]))
    if not found[-1] > -ndtri(POOR) * sd:
        return []
    # named are arrivals that are late by more than their scatter, or by half of the
    # latest
    own = excess - sum(b * c for b, c in zip(found[:-1], constants, strict=True))
    scatter = answer.scatter
    slowness = np.where(used, 1.0 + own / np.where(used, tau, 1.0), -np.inf)
    slowest = int(np.argmax(slowness))
    late_rows = np.flatnonzero(used & (own > np.minimum(scatter, own[slowest] / 2)))
    order = late_rows[np.argsort(-slowness[late_rows])]
    sensors = dict.fromkeys([observations.sensor[row] for row in (slowest, *order)])
    return [
        warning(
            "slower_than_sound",
            sensors=tuple(sensors),
            speed_m_s=float(sound[slowest] / slowness[slowest]),
            sound_m_s=float(sound[slowest]),
        )
    ]


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
        speed = max(speed, COLDEST_SOUND)
    charges = np.array([np.asarray(charge.position_m) for charge in scene.charges])
    away = np.asarray(layout.position) - charges[np.array(layout.shot)]
    wind = np.array([float(air.wind_east), float(air.wind_north), 0.0])
    along = np.nan_to_num(away) @ wind / np.where(distance > 0.0, distance, 1.0)
    return speed + along


def flat_ground(
    observations: Observations,
    charge: Float[np.ndarray, "row 3"],
    slant_range: Float[np.ndarray, " row"],
) -> list[Note]:
    """Return the reading with the largest error by flat ground, if not negligible.

    Args:
        observations: The log; without a frame on the Earth there is none.
        charge: East, north, up of each row's charge [m].
        slant_range: Distance of each row from its charge [m].
    """
    if observations.frame is None:
        return []
    arc = slant_range**3 / (24.0 * EARTH_RADIUS**2)
    drop = np.sum(charge[:, :2] ** 2, axis=1) / (2.0 * EARTH_RADIUS)
    level = observations.position - charge
    lower = level + drop[:, None] * np.array([0.0, 0.0, 1.0])
    tilt = np.abs(np.linalg.norm(lower, axis=1) - np.linalg.norm(level, axis=1))
    error = arc + tilt
    timed = np.isin(observations.quantity, TIMES)
    share = FAR_FIELD_POWER * error / np.maximum(slant_range, 1.0)
    shift = np.where(timed, error / STANDARD_SOUND_SPEED, share)
    sigmas = np.nan_to_num(shift / observations.error_scale())
    worst = int(np.argmax(sigmas))
    if not sigmas[worst] > NOTICED:
        return []
    return [
        warning(
            "flat_ground",
            sensor=observations.sensor[worst],
            quantity=observations.quantity[worst],
            range_m=float(slant_range[worst]),
            error_m=float(error[worst]),
            sigmas=float(sigmas[worst]),
        )
    ]


def paths_taken_as_independent(solution: Solution) -> list[Note]:
    """Return the number of paths taken as independent, if there are any.

    It is a warning where a fitted position is farther from the middle of the sensors
    than their extent, else an assumption.
    """
    answer, layout = solution.answer, solution.density.layout
    position, given = np.asarray(layout.position), np.asarray(layout.slant_range) > 0
    most, beyond = 0, False
    for name in {*answer.seen.path, *answer.seen.arrival}:
        first = answer.rows.paths[name].first
        # paths without a direction are independent of all others
        near = first[~given[first]]
        if len(first) <= MAX_PATHS or len(near) < 2:
            continue
        charge = answer.scene.charges[layout.shot[first[0]]]
        if charge.range_m is not None:
            continue
        most = max(most, len(near))
        place = {f"{n}{answer.scene.label(charge)}" for n in CHARGE_POSITION[:2]}
        if place & {*answer.names}:
            level = position[near, :2]
            away = np.asarray(charge.position_m)[:2] - level.mean(axis=0)
            # the diagonal of the bounding box: pairs of a million sensors are too many
            beyond |= bool(np.hypot(*away) > np.hypot(*np.ptp(level, axis=0)))
    if beyond:
        return [warning("paths_beyond_array", paths=most, limit=MAX_PATHS)]
    if most:
        return [assumption("paths_independent", paths=most, limit=MAX_PATHS)]
    return []


def valid_at_depth(solution: Solution) -> Bool[np.ndarray, " row"]:
    """Return the validity of depth-dependent laws at a depth that few draws exceed.

    Depths are scaled by the cube root of the mass, so an overestimated mass moves a
    buried charge towards the surface. The answer may lie within the range of a law that
    its 90 % interval leaves. Only depth and mass are changed from the answer. Charges
    that are not buried, and laws without a depth, count as valid.
    """
    answer, draws = solution.answer, solution.draws
    names, layout = answer.names, solution.density.layout
    drawn = dict(zip(names, draws.values.T, strict=True))
    valid = np.ones(len(layout.quantity), bool)
    by_depth = [
        any(
            "height_of_burst" in inspect.signature(law.valid).parameters
            for part, _ in components(quantity)
            for law in [law_for(part, solution.laws[part].name)]
        )
        for quantity in layout.quantity
    ]
    for shot, charge in enumerate(answer.scene.charges):
        if not float(charge.up) < 0:
            continue
        label = answer.scene.label(charge)
        known = {
            f"charge_up_m{label}": float(charge.up),
            f"charge_mass_kg{label}": float(charge.mass_kg),
        }
        up, mass = (
            np.broadcast_to(drawn.get(name, np.array(fixed)), len(draws.u))
            for name, fixed in known.items()
        )
        order = np.argsort(depth := up / np.cbrt(mass))
        at = np.searchsorted(np.cumsum(draws.weights[order]), DEEPER_SHARE)
        deepest = draws.values[order[min(at, len(depth) - 1)]]
        moved = np.array([name in known for name in names])
        deep = np.where(moved, deepest, answer.values)
        holds = solution.density.seen_with(deep[None]).valid[0]
        judged = by_depth & (np.array(layout.shot) == shot)
        valid &= holds | ~judged
    return valid


def extrapolated(
    solution: Solution, valid: Bool[np.ndarray, " row"]
) -> tuple[str, ...]:
    r"""Return the requested numbers that depend on rows outside their laws.

    Let $1/I$ be the marginal variance of a number, and $I_{in}$ the same information
    from the rows inside and the priors alone. The share of the rows outside is
    $1 - I_{in}/I$. Numbers that are not identified are not named.

    Args:
        solution: Result of the inference.
        valid: True for rows within the range of their law at the answer.
    """
    if valid.all():
        return ()
    everything, inside = (
        1 / np.diag(solution.answer.covariance(used=used)) for used in (None, valid)
    )
    names = solution.identified.names
    wanted = requested(names)
    return tuple(
        name
        for name, is_determined, all_rows, some in zip(
            names, solution.identified.determined, everything, inside, strict=True
        )
        if name in wanted and is_determined and some < (1 - MAX_OUTSIDE) * all_rows
    )
