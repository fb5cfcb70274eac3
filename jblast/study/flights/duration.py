"""How long a flight through blasts is, and how many of its rows are stored."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.scene import Scene, VehicleSpec
from jblast.study.flights.encounter import FlightLoad, arrival_at, load_of
from jblast.study.flights.records import Options
from jblast.vehicle import hold_of, start_of

AFTER_S = 5.0
"""Seconds after the last arrival where nothing is said."""
MOST_STEPS = 4_000_000
"""Steps of a flight: half an hour at the default step."""

ROWS = 20_000
"""Stored of a single flight."""
BATCH_ROWS = 500
"""Stored of each flight of a batch."""
ROW_S = 0.02
"""Most time between two rows, however long the flight: peaks are of a tenth of a second
and more."""


def flight_seconds(
    scenes: Scene, vehicle: VehicleSpec, source: str, options: Options
) -> float:
    """Return how long each flight is: until 5 s after the last blast, in tenths.

    Args:
        scenes: One, or a batch.
        vehicle: Whose start and target the blasts come to.
        source: The scene's file, for the messages.
        options: How to fly.

    Raises:
        InputError: A time cannot be used, a blast comes before the flight begins, or
            no blast before it ends.
    """
    for name, value in (
        ("seconds", options.seconds),
        ("step", options.step_s),
        ("tolerance", options.tolerance_m),
    ):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive number, got {value:g}")
    turned = start_of(vehicle).quaternion
    target = hold_of(vehicle, integral=False).target_m
    places = jnp.stack([vehicle.position, target])

    def arrivals(scene: Scene):
        load = load_of(scene, options.profile)
        return _arrivals(load, places, turned)

    batch = scenes.air.wind_east.ndim > 0
    came = np.asarray((eqx.filter_vmap(arrivals) if batch else arrivals)(scenes))
    source = source or "scene"
    if np.isposinf(came).all(axis=-1).any():
        raise InputError(
            f"{source}: [charge] time_s: expected a blast that comes to the vehicle, "
            "got none: every charge's time is inf, which is never"
        )
    if not came.min() >= 0:
        raise InputError(
            f"{source}: [charge] time_s: expected blasts that come to the vehicle "
            f"after its flight begins, at 0 s, got one at {came.min():.4g} s"
        )
    seconds = options.seconds
    if seconds is None:
        last = came.max(where=came < np.inf, initial=0.0)
        seconds = math.ceil(10 * (last + AFTER_S)) / 10
    first = came.min(axis=-1).max()
    if seconds <= first:
        raise InputError(
            f"seconds: expected more than {first:.4g} s, when the"
            f"{' latest' if batch else ''} first blast comes to the vehicle, "
            f"got {seconds:g} s"
        )
    if seconds / options.step_s > MOST_STEPS:
        raise InputError(
            f"seconds: expected at most {MOST_STEPS * options.step_s:g} s in steps of "
            f"{options.step_s:g} s, got {seconds:g} s"
        )
    return seconds


@kept
def _arrivals(
    load: FlightLoad, places: Float[Array, "place 3"], turned: Float[Array, "4"]
) -> Float[Array, "place blast"]:
    return jax.vmap(lambda place: arrival_at(load, place, turned))(places)


def rows_stored(seconds: float, vehicles: int, options: Options | None = None) -> int:
    """Return how many rows of each flight are stored at most; an estimator's, all."""
    if options is not None and options.estimator:
        return math.ceil(seconds / options.step_s)
    return max(ROWS if vehicles == 1 else BATCH_ROWS, math.ceil(seconds / ROW_S))
