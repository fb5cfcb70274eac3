"""What an episode draws, and the flight that follows: vehicle, wind, blasts."""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.environments.params import EnvironmentParams, Number
from jblast.environments.state import EnvironmentState, Episode
from jblast.scene import Charge, Scene
from jblast.scene.priors import Prior, draw
from jblast.scene.random.spec import ByCount
from jblast.vehicle import BlastLoad, Vehicle, blast_load
from jblast.vehicle.dynamics.components import Vector, rows, three
from jblast.vehicle.rollout.flight import Flight
from jblast.vehicle.rollout.step import OneStep
from jblast.vehicle.rollout.timetable import INWARD, Ticks
from jblast.world import Blasts, blast_sequence

OF_BLASTS, OF_VEHICLE, OF_IMU, OF_TASK, OF_READINGS = range(5)
"""Folded into an episode's key: what each draw is for."""


def draw_episode(key: PRNGKeyArray, params: EnvironmentParams) -> Episode:
    """Draw what an episode needs.

    Args:
        key: Of the episode.
        params: With priors, and numbers that stay.
    """
    one = params.randomisation
    keys = iter(jax.random.split(jax.random.fold_in(key, OF_VEHICLE), 6))
    dtype = params.step_s.dtype

    def number(value: Number) -> Float[Array, ""]:
        own = next(keys)
        return (draw(own, value) if isinstance(value, Prior) else value).astype(dtype)

    mass, inertia, gain = map(
        number, (one.mass_factor, one.inertia_factor, one.gain_factor)
    )
    east, north = number(one.wind_east_m_s), number(one.wind_north_m_s)
    late = jnp.round(number(one.delay_s) / params.step_s).astype(jnp.int32)
    occurrence = params.world.occurrence
    assert isinstance(occurrence, ByCount), "environment_params asks for it"
    blasts = blast_sequence(
        jax.random.fold_in(key, OF_BLASTS),
        params.world,
        about(params),
        occurrence.count,
    )
    none = jnp.zeros((), dtype)
    force = rate = (none, none, none)
    if params.imu is not None:
        drawn = jax.random.normal(jax.random.fold_in(key, OF_IMU), (2, 3), dtype)
        force = three(params.imu.force_bias_m_s2 * drawn[0])
        rate = three(params.imu.rate_bias_rad_s * drawn[1])
    return Episode(
        mass_factor=mass,
        inertia_factor=inertia,
        gain_factor=gain,
        wind_m_s=(east, north, none),
        delay_steps=jnp.clip(late, 0, params.most_delay),
        blasts=jax.tree.map(lambda x: x.astype(dtype), blasts),
        force_bias_m_s2=force,
        rate_bias_rad_s=rate,
    )


def about(params: EnvironmentParams) -> Float[Array, "3"]:
    """Return what the region of the blasts is about, on the ground for a ring."""
    if params.world.about == "world":
        return jnp.zeros_like(params.target_m)
    return params.target_m


def vehicle_in(params: EnvironmentParams, episode: Episode) -> Vehicle:
    """Return the vehicle of an episode."""
    vehicle = params.vehicle
    # number by number: a step of many lanes has no arrays but theirs
    inertia = [
        [(part * episode.inertia_factor)[None, None] for part in row]
        for row in rows(vehicle.inertia_kg_m2)
    ]
    return replace(
        vehicle,
        mass_kg=vehicle.mass_kg * episode.mass_factor,
        inertia_kg_m2=jnp.block(inertia),
    )


def load_of(params: EnvironmentParams, wind: Vector, blast: Blasts) -> BlastLoad:
    """Return the load of one blast of an episode.

    Args:
        params: Of the environment.
        wind: Of the episode.
        blast: Its numbers alone.
    """
    east, north, _ = wind
    charge = Charge(
        blast.mass_kg, three(blast.position_m), blast.time_s, burst="surface"
    )
    air = replace(params.air, wind_east=east, wind_north=north)
    return blast_load(Scene(charge, air=air))


def one_step(params: EnvironmentParams, episode: Episode) -> OneStep:
    """Return the step of a flight of an episode, blasts left out."""
    wind = episode.wind_m_s

    def steady(time_s: Array, position_m: Array) -> Array:
        return jnp.stack(wind)

    flight = Flight(
        vehicle=vehicle_in(params, episode),
        state=None,  # pyright: ignore[reportArgumentType] (not asked for its start)
        commands=None,
        control=None,
        wind=steady,
        loads=(),
        ground_up_m=params.ground_up_m,
    )
    return OneStep(flight, params.step_s, "rk4", control_held=False, axis=None)


def tick_of(params: EnvironmentParams, state: EnvironmentState) -> Ticks:
    """Return the times of a lane's next step, as `timetable` has them."""
    step = params.step_s
    start = state.steps.astype(step.dtype) * step
    inward = jnp.maximum(INWARD * step, 2 * jnp.finfo(step.dtype).eps * (start + step))
    return Ticks(
        stages=jnp.stack([start + inward, start + step / 2, start + step - inward]),
        start=start,
        step=step,
        command=jnp.zeros(3, jnp.int32),
        sample=jnp.asarray(True),
    )
