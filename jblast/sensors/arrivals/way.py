"""By which ways waves come to a place, and what their laws are asked there."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.scene import Charge, Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to, record

Way = Literal["air", "reflected", "ground"]


class Heard(NamedTuple):
    """One wave that comes to a place.

    Attributes:
        pulse: Its pressure over time, on the common clock: a `Pulse`.
        kind: "air" from the charge itself, "reflected" by the ground, or "ground": of
            the moving ground, a `GroundPulse` in pascals (its displacement is then the
            integral of the pressure [Pa s]).
        shot: Which of the scene's charges it is of.
        distance: That it came [m].
        absorbed: Whether the air's absorption acts on it, which its law does not know:
            where the law of the peak does not hold, or the scene says so. Never on
            that of the ground.
    """

    pulse: Any  # Pulse, or GroundPulse: a union would ask every reader which
    kind: Way
    shot: int
    distance: Float[Array, ""]
    absorbed: Bool[Array, ""]


def ways(
    scene: Scene, reflection: float | Float[Array, ""], ground: bool
) -> tuple[tuple[int, Way], ...]:
    """Return by which ways waves of which charge may come to a place.

    Args:
        scene: What is there.
        reflection: Coefficient of the ground; a plain 0 leaves reflections out.
        ground: Whether the moving ground is heard, too.
    """
    off = not isinstance(reflection, Tracer) and not np.any(reflection)
    found: list[tuple[int, Way]] = []
    for shot, charge in enumerate(scene.charges):
        found.append((shot, "air"))
        if not off and _may_be_high(charge):
            found.append((shot, "reflected"))
        if ground:
            found.append((shot, "ground"))
    return tuple(found)


def arrival_time(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
) -> Float[Array, ""]:
    """Return when one wave comes to a place, on the common clock [s].

    Of a charge that never happens, as if it did at time 0.
    """
    seen, place = as_seen(scene, position, shot, way)
    quantity = "ground_arrival_s" if way == "ground" else "air_arrival_s"
    return record(seen, rows_of_place(place, (quantity,)), laws).value[0]


def _may_be_high(charge: Charge) -> bool:
    """Whether a charge may stand above the ground and be taken by free-air curves."""
    if charge.range_m is not None or charge.burst == "surface":
        return False
    return not _stands_low(charge)


def _stands_low(charge: Charge) -> bool:
    """Whether a charge is known to stand on the ground or in it."""
    return not isinstance(charge.up, Tracer) and bool(
        np.all(np.asarray(charge.up) <= 0)
    )


def low_charges_settled(scene: Scene) -> Scene:
    """Return the scene with surface curves where a height on the ground leaves them.

    Outside jit, where heights are known: half of the program.
    """
    charges = [
        replace(charge, burst="surface", by_height=True)
        if charge.burst is None and _stands_low(charge)
        else charge
        for charge in scene.charges
    ]
    return replace(scene, charge=charges[0], others=tuple(charges[1:]))


def alone(scene: Scene, shot: int) -> Scene:
    """Return a scene with one of its charges, and with nobody: one program for all.

    A program is compiled anew for another count, name or order of what a scene holds.
    """
    return replace(
        scene,
        charge=replace(scene.charges[shot], name=""),
        others=(),
        sensors=(),
        camera=None,
        vehicle=None,
        ambient=None,
        clocks=(),
    )


def as_seen(
    scene: Scene, position: Float[Array, "3"], shot: int, way: Way
) -> tuple[Scene, Float[Array, "3"]]:
    """Return the scene with one charge, and the place as the wave of a way sees it.

    Mirrored at the ground it is as far from the charge as the place from the image, and
    as far upwind.
    """
    charge = scene.charges[shot].as_if_at_zero()
    if way != "reflected":
        return replace(scene, charge=charge, others=()), position
    charge = replace(charge, burst="free-air")
    mirror = jnp.array([1.0, 1.0, -1.0], position.dtype)
    return replace(scene, charge=charge, others=()), position * mirror


def is_there(
    scene: Scene, position: Float[Array, "3"], shot: int, way: Way
) -> Bool[Array, ""]:
    """Return whether there is a wave of a way at a place."""
    charge = scene.charges[shot]
    if way != "reflected":
        return ~charge.never
    above = (charge.up > 0) & (position[2] > 0)
    if charge.burst is None:
        seen, _ = as_seen(scene, position, shot, "air")
        path = path_to(seen, rows_of_place(position, ("peak_overpressure_pa",)))
        above = above & jnp.asarray(path.free_air)[0]
    return above & ~charge.never


def rows_of_place(place: Float[Array, "3"], quantities: tuple[str, ...]) -> Layout:
    """Return the rows of a place, one a quantity, on the common clock."""
    n = len(quantities)
    return Layout(
        quantity=quantities,
        position=jnp.broadcast_to(place, (n, 3)),
        slant_range=jnp.full(n, jnp.nan),
        time=jnp.full(n, jnp.nan),
        group=(0,) * n,
        shot=(0,) * n,
        clock=("",) * n,
    )
