"""Vehicles that fly by what their instruments say, one or a batch."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, UInt

from jblast.autopilot.estimator import (
    EstimatedControl,
    Followed,
    Thrown,
    followed,
    thrown,
)
from jblast.autopilot.lockstep import suite_of
from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.scene import Place, Scene
from jblast.sensors.flight_sensors import Barometer
from jblast.study.flights.encounter import FlightLoad
from jblast.vehicle import Controller, State, Trajectory


class Instruments(NamedTuple):
    """What vehicles fly by.

    Attributes:
        place: Where the origin lies, whose field they feel; None: PX4's home.
        seeds: Of each vehicle's draws.
    """

    place: Place | None
    seeds: UInt[Array, "*batch"]


def instruments_of(
    place: Place | None,
    seed: int,
    lanes: Int[np.ndarray, "*batch"] | np.integer,
    step_s: float,
) -> Instruments:
    """Return what vehicles fly by.

    Args:
        place: Where the origin lies, if the scene says.
        seed: Of all draws.
        lanes: Numbers of the vehicles.
        step_s: Between two samples of the inertial unit.

    Raises:
        InputError: That is longer than between two of the barometer.
    """
    longest = 1 / Barometer().rate
    if step_s > longest * (1 + 1e-9):
        raise InputError(
            f"step: expected at most {longest:g} s where a vehicle flies by its "
            f"instruments, the time between two samples of its barometer, got "
            f"{step_s:g} s"
        )
    # a prime past the vehicles of any batch that is looked at one by one
    seeds = (seed * 1_000_003 + np.asarray(lanes, np.int64)) % 2**32
    return Instruments(place, jnp.asarray(seeds, jnp.uint32))


def by_instruments(
    control: Controller,
    scenes: Scene,
    start: State,
    load: FlightLoad,
    instruments: Instruments,
    rate: float,
) -> EstimatedControl:
    """Return who flies by an estimate, for one vehicle or each of a batch.

    Args:
        control: Who flies.
        scenes: One, or several with a leading axis in every array.
        start: Of each vehicle.
        load: Of the blasts; with the scenes' axis.
        instruments: Of the vehicles.
        rate: Of the controller's turns [Hz].
    """

    def one(scene: Scene, load: FlightLoad, seed: Array) -> EstimatedControl:
        suite = suite_of(scene, instruments.place, load, rate)
        return EstimatedControl(control, suite, start, seed)

    seeds = instruments.seeds
    if not seeds.ndim:
        return one(scenes, load, seeds)
    return eqx.filter_vmap(one)(scenes, load, seeds)


def thrown_by_blasts(
    control: EstimatedControl, trajectory: Trajectory, arrival_s: Array, step_s: float
) -> tuple[Thrown, Followed | None]:
    """Return what blasts did to the estimates, and the estimate of one flight.

    Args:
        control: Of the flights.
        trajectory: All their rows.
        arrival_s: Of the blasts at each vehicle.
        step_s: Between two rows.
    """
    period = jnp.asarray(step_s, float)
    if arrival_s.ndim == 1:
        estimate = followed_along(control, trajectory, period)
        return thrown_of(estimate, trajectory.time_s, arrival_s), estimate
    rows = eqx.tree_at(
        lambda flight: flight.time_s, jax.tree.map(lambda x: 0, trajectory), None
    )
    several = eqx.filter_jit(
        eqx.filter_vmap(_thrown_of, in_axes=(eqx.if_array(0), rows, 0, None))
    )
    return several(control, trajectory, arrival_s, period), None


def _thrown_of(
    control: EstimatedControl, flight: Trajectory, arrival_s: Array, period_s: Array
) -> Thrown:
    return thrown(followed(control, flight, period_s), flight.time_s, arrival_s)


followed_along = kept(followed)
thrown_of = kept(thrown)
