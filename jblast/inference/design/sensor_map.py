"""The benefit of one more sensor: the sd of mass and position over the plane.

The new sensor records the quantities of the first one, at the same height and with the
same errors, on a clock that is right. At each position of a grid the Cramer-Rao bound
of layout and new sensor is computed, at the assumed values of the parameters.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference.design.covariance import information_of_layout, worst
from jblast.inference.design.cramer_rao import Bound
from jblast.inference.posterior.fisher_information import known_covariance
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.posterior.starts import typical_step
from jblast.kept_programs import kept
from jblast.sensors import Layout, record

# points along each side: 3 % of the layout apart, finer than contours need
POINTS = 60
WIDER = 2.0
"""Width of the map relative to the layout. Farther away a sensor adds little."""
BATCH = 256
"""Positions computed together: more need memory in proportion, and gain little."""


@dataclass(frozen=True)
class BoundMap:
    """Standard deviations with one more sensor, over its position.

    Attributes:
        east: Coordinates of the grid, increasing [m].
        north: Coordinates of the grid, increasing [m].
        up: Height of the new sensor [m].
        log_sd_mass: sd of ln mass; infinite where not identified, None if fixed.
        place_sd: Root of the trace of the covariance of the charge's east and north
            [m]; infinite where not identified, None for a fixed position.
        mass: Name of the least certain mass.
        place: Free coordinates of the first charge that has any.
        now: sd of ln mass and of the position without a new sensor ("mass", "place").
        valid: True where the new sensor is within the range of the laws.
        like: Name of the sensor whose quantities it records.
        records: Quantities it records.
        sensors: Positions of the other sensors by name: east, north [m].
        charges: Positions of the charges: east, north [m].
    """

    east: Float[np.ndarray, " east"]
    north: Float[np.ndarray, " north"]
    up: float
    log_sd_mass: Float[np.ndarray, "north east"] | None
    place_sd: Float[np.ndarray, "north east"] | None
    mass: str
    place: tuple[str, ...]
    now: dict[str, float]
    valid: Bool[np.ndarray, "north east"]
    like: str
    records: tuple[str, ...]
    sensors: dict[str, tuple[float, float]]
    charges: Float[np.ndarray, "charge 2"]


def bound_map(bound: Bound, points: int = POINTS) -> BoundMap:
    """Return the bound with one more sensor like the first, over its position.

    Its clock is assumed to be synchronised.

    Args:
        bound: Bound of the layout without it.
        points: Number of points along each side.

    Raises:
        InputError: The scene has no positions, or neither mass nor position is free.
    """
    posterior, log, z = bound.posterior, bound.log, jnp.asarray(bound.z)
    parameters, layout = posterior.parameters, posterior.layout
    scene = parameters.scene_at(z)
    mass, place = _wanted(bound)
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"{log.source}: a map needs positions: expected [charge] position_m, got a "
            "range only"
        )
    if mass is None and not place:
        raise InputError(
            f"{log.source}: a map shows the uncertainty of the mass or position of a "
            "charge: expected one of these to be free, got "
            f"{', '.join(parameters.names)} only"
        )
    rows = np.array([i for i, s in enumerate(log.sensor) if s == log.sensor[0]])
    new = Layout(
        quantity=tuple(layout.quantity[i] for i in rows),
        position=layout.position[rows],
        slant_range=layout.slant_range[rows],
        time=layout.time[rows],
        # a new path for each shot: its scatter is independent of that of the other
        # sensors
        group=tuple(max(layout.group) + 1 + layout.shot[i] for i in rows),
        shot=tuple(layout.shot[i] for i in rows),
        clock=("",) * len(rows),
    )
    # the instrument of the first sensor, at the new position
    sigma = jnp.concatenate([posterior.sigma, posterior.sigma[rows]])
    charges = np.array([[float(c.east), float(c.north)] for c in scene.charges])
    east, north = _grid(np.asarray(layout.position)[:, :2], charges, points)
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    covariance, unknown, valid = map(
        np.asarray, _over(posterior, new, sigma, z, jnp.asarray(places))
    )
    before = known_covariance(
        jnp.asarray(bound.information), parameters.has_prior(), typical_step(posterior)
    )
    # all coordinates in one direction: each number depends on its own coordinate alone,
    # so this gives the derivative of every number
    values, slopes = jax.jvp(
        lambda step: parameters.values(z + step), (0 * z,), (jnp.ones_like(z),)
    )
    shape = (points, points)
    drawn: dict[str, np.ndarray] = {}
    now: dict[str, float] = {}
    for what, names in (("mass", (mass,) if mass else ()), ("place", place)):
        if not names:
            continue
        index = [parameters.names.index(name) for name in names]
        unit = np.array([float(slopes[name]) for name in names])
        if what == "mass":
            unit = unit / np.array([float(values[name]) for name in names])
        drawn[what] = _sd(covariance, unknown, index, unit).reshape(shape)
        alone, hidden = (np.asarray(part)[None] for part in before)
        now[what] = float(_sd(alone, hidden, index, unit)[0])
    return BoundMap(
        east=east,
        north=north,
        up=float(layout.position[0, 2]),
        log_sd_mass=drawn.get("mass"),
        place_sd=drawn.get("place"),
        mass=mass or "",
        place=place,
        now=now,
        valid=valid.reshape(shape),
        like=log.sensor[0],
        records=tuple(dict.fromkeys(new.quantity)),
        sensors={
            name: (float(at[0]), float(at[1]))
            for name, at in zip(log.sensor, np.asarray(layout.position), strict=True)
        },
        charges=charges,
    )


def _wanted(bound: Bound) -> tuple[str | None, tuple[str, ...]]:
    """Return the least certain mass, and the free coordinates of the first charge."""
    names = bound.posterior.parameters.names
    mass = names[worst(bound.posterior, bound.z)]
    is_mass = mass.partition(".")[0] == "charge_mass_kg"
    horizontal = [n for n in names if n.startswith(("charge_east_m", "charge_north_m"))]
    first = horizontal[0].partition(".")[2] if horizontal else ""
    place = tuple(n for n in horizontal if n.partition(".")[2] == first)
    return mass if is_mass else None, place


def _grid(sensors, charges, points: int):
    """Return the coordinates of a square about a layout, wider by `WIDER`."""
    seen = np.concatenate([sensors, charges])
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    # sensors and charge at one position still have a map of 2 m
    half = max(WIDER * float(np.ptp(seen, axis=0).max()) / 2, 1.0)
    line = np.linspace(-half, half, points)
    return middle[0] + line, middle[1] + line


@kept
def _over(
    posterior: Posterior,
    new: Layout,
    sigma: Float[Array, " row"],
    z: Float[Array, " free"],
    places: Float[Array, "place 2"],
):
    """Return covariance, unidentified numbers and validity for each position."""
    parameters, noise = posterior.parameters, posterior.noise
    laws = dict(posterior.laws)
    has_prior, scale = parameters.has_prior(), typical_step(posterior)

    def one(place: Float[Array, "2"]):
        there = eqx.tree_at(
            lambda n: n.position, new, new.position.at[:, :2].set(place[None, :])
        )
        layout = posterior.layout.beside(there)
        known = information_of_layout(parameters, layout, sigma, laws, z, noise)
        holds = record(parameters.scene_at(z), there, laws).valid.all()
        return *known_covariance(known, has_prior, scale), holds

    # one program for all positions: only the position of the new sensor changes
    return jax.lax.map(one, places, batch_size=BATCH)


def _sd(covariance, unknown, index, unit) -> np.ndarray:
    """Return the root of a sum of variances; infinite if one is unidentified."""
    variance = np.diagonal(covariance, axis1=1, axis2=2)[:, index] * unit**2
    return np.where(
        unknown[:, index].any(axis=1), np.inf, np.sqrt(variance.sum(axis=1))
    )
