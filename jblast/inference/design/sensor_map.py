"""The benefit of one more sensor: the sd of mass and position over the plane.

The new sensor records the quantities of the first one, at the same height and with the
same errors, on a clock that is right. At each position of a grid the Cramer-Rao bound
of layout and new sensor is computed, at the assumed values of the parameters.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference.design.cramer_rao import Bound
from jblast.inference.posterior.fisher_information import information_of_layout
from jblast.inference.posterior.posterior import Posterior
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
    plan, log = bound.plan, bound.log
    layout, z = plan.posterior.layout, jnp.asarray(plan.z)
    names, scene = plan.parameters.names, plan.parameters.scene_at(z)
    target = names[plan.target]
    mass = target if target.partition(".")[0] == "charge_mass_kg" else ""
    level = [n for n in names if n.startswith(("charge_east_m", "charge_north_m"))]
    place = tuple(n for n in level if n.partition(".")[2] == level[0].partition(".")[2])
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"{log.source}: a map needs positions: expected [charge] position_m, got a "
            "range only"
        )
    if not mass and not place:
        raise InputError(
            f"{log.source}: a map shows the uncertainty of the mass or position of a "
            "charge: expected one of these to be free, got "
            f"{', '.join(names)} only"
        )
    rows = np.array([i for i, s in enumerate(log.sensor) if s == log.sensor[0]])
    like = layout.only(rows)
    # a path of its own: its scatter is independent of that of the other sensors
    group = tuple(max(layout.group) + 1 + shot for shot in like.shot)
    new = replace(like, group=group, clock=("",) * len(rows))
    charges = np.array([[float(c.east), float(c.north)] for c in scene.charges])
    east, north = _grid(np.asarray(layout.position)[:, :2], charges, points)
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    over = _over(
        plan.posterior, new, plan.posterior.sigma[rows], z, jnp.asarray(places)
    )
    known, valid = map(np.asarray, over)
    # the last one without a new sensor
    known = np.concatenate([known, plan.information[None]])
    drawn: dict[str, np.ndarray] = {}
    now: dict[str, float] = {}
    for what, numbers in {"mass": (mass,) if mass else (), "place": place}.items():
        each = [[s.width for s in plan.left(names.index(n), known)] for n in numbers]
        if each:
            *sds, now[what] = np.linalg.norm(each, axis=0).tolist()
            drawn[what] = np.reshape(sds, (points, points))
    return BoundMap(
        east=east,
        north=north,
        up=float(layout.position[0, 2]),
        log_sd_mass=drawn.get("mass"),
        place_sd=drawn.get("place"),
        mass=mass,
        place=place,
        now=now,
        valid=valid.reshape(points, points),
        like=log.sensor[0],
        records=tuple(dict.fromkeys(new.quantity)),
        sensors={
            name: (float(at[0]), float(at[1]))
            for name, at in zip(log.sensor, np.asarray(layout.position), strict=True)
        },
        charges=charges,
    )


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
    """Return information and validity with new rows at each position."""
    parameters, laws = posterior.parameters, dict(posterior.laws)
    both = jnp.concatenate([posterior.sigma, sigma])

    def one(place: Float[Array, "2"]):
        there = replace(new, position=new.position.at[:, :2].set(place[None, :]))
        layout, noise = posterior.layout.beside(there), posterior.noise
        known = information_of_layout(parameters, layout, both, laws, z, noise)
        return known, record(parameters.scene_at(z), there, laws).valid.all()

    # one program for all positions: only the position of the new sensor changes
    return jax.lax.map(one, places, batch_size=BATCH)
