"""What a flight is made of, as the arrays and structs of the kernel."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from jaxtyping import Array, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.vehicle.control.allocation import allocation
from jblast.vehicle.loads.blast.load import BlastLoad
from jblast.vehicle.loads.blast.passage import Blast
from jblast.vehicle.loads.blast.wave import FIRST
from jblast.vehicle.quadrotor.body import required_body
from jblast.vehicle.quadrotor.parameters import Vehicle
from jblast.vehicle.rollout.batching import Each, own
from jblast.vehicle.rollout.flight import Flight
from jblast.vehicle.rollout.timetable import Ticks
from jblast.vehicle.warp.kernels.drag import DRAG, FRONT, GAUSS, ROTORS
from jblast.vehicle.warp.kernels.gusts import FIELDS, KINDS
from jblast.vehicle.warp.kernels.wave import BURSTS, curve_table
from jblast.waves.scaling import sachs_distance_factor, sachs_time_factor


class Sender:
    """Puts numbers on a device: a column for each vehicle, or one for all."""

    def __init__(self, device: Any, real: Any, batch: tuple[int, ...]):
        """Take what is the same for all.

        Args:
            device: Of Warp's.
            real: `wp.float32` or `wp.float64`.
            batch: Axes of the batch.
        """
        self.device, self.real, self.axes = device, real, len(batch)

    def array(self, value: Any, kind: Any = None) -> Any:
        """Return an array as it is; one of JAX from where it lies."""
        kind = kind or self.real
        if isinstance(value, jax.Array):
            there = wp.from_jax(jax.block_until_ready(value.astype(kind)))
            return there.to(self.device)
        scalar = getattr(kind, "_wp_scalar_type_", kind)  # of a vector, its numbers'
        numbers = np.asarray(value, wp.dtype_to_numpy(scalar))
        return wp.array(numbers, dtype=kind, device=self.device)

    def columns(self, value: Any) -> Any:
        """Return (..., k) as (k, vehicles)."""
        return self.array(jnp.asarray(value).reshape(-1, value.shape[-1]).T)

    def vehicles(self, struct: Any, vehicle: Vehicle | Each) -> Any:
        """Return the numbers of each vehicle, or of the one that all are."""
        each = isinstance(vehicle, Each)
        fields = _craft_fields(own(vehicle), self.axes if each else 0)
        table: Any = np.zeros(len(fields["mass"]), struct.numpy_dtype())
        for name, value in fields.items():
            table[name] = value
        return wp.array(table, dtype=struct, device=self.device)

    def clock(self, Clock: Any, ticks: Ticks, store_every: int) -> Any:
        """Return the steps."""
        clock = Clock()
        clock.stages, clock.start, clock.step = (
            self.array(x) for x in (ticks.stages, ticks.start, ticks.step)
        )
        clock.row, clock.sample = (
            self.array(x, wp.int32) for x in (ticks.command, ticks.sample)
        )
        clock.store_every = store_every
        return clock

    def pilot(self, Pilot: Any, flight: Flight, period_s: float) -> Any:
        """Return what commands the rotors."""
        pilot = Pilot()
        pilot.period = self.real(period_s)
        if flight.commands is not None:
            pilot.kind = 1
            rows = own(flight.commands)
            lanes = rows.reshape(-1, *rows.shape[-2:])
            pilot.table = self.array(jnp.moveaxis(lanes, 0, -1))
        if flight.control is not None:
            pilot.kind = 2
            hold = own(flight.control)
            yaw, k = hold.yaw_rad[..., None], hold.gains
            order = [hold.target_m, jnp.cos(yaw), jnp.sin(yaw), 0 * yaw]
            order += [k.position, k.velocity, k.integral]
            order += [x[..., None] for x in (k.attitude, k.body_rate, k.integral_limit)]
            pilot.orders = self.columns(jnp.concatenate(order, axis=-1))
        return pilot

    def air(self, Air: Any, flight: Flight) -> Any:
        """Return what blows and pushes."""
        air, wind = Air(), own(flight.wind)
        air.wind.kind = KINDS[type(wind)]
        if wind is not None:
            other = [getattr(wind, name, 1 + 0 * wind.start_s) for name in FIELDS]
            numbers = jnp.broadcast_arrays(
                *jnp.moveaxis(wind.velocity_m_s, -1, 0), *other
            )
            air.wind.rows = self.columns(jnp.stack(numbers, -1))
        pairs = [(load, b) for load in map(own, flight.loads) for b in load.waves]
        air.blasts.count = len(pairs)
        if not pairs:
            return air
        required_body(own(flight.vehicle).body)
        columns = [_blast_columns(load, b) for load, b in pairs]
        flat = [x.reshape(-1, x.shape[-1]) for x in columns]
        lanes = max(map(len, flat))
        table = [jnp.broadcast_to(x, (lanes, x.shape[-1])).T for x in flat]
        air.blasts.rows = self.array(jnp.stack(table))
        bursts = [BURSTS.index(b.burst) for _, b in pairs]
        parts = [x.drag * DRAG + x.front * FRONT + x.rotors * ROTORS for x, _ in pairs]
        air.blasts.burst = self.array(bursts, wp.int32)
        air.blasts.parts = self.array(parts, wp.int32)
        air.blasts.curves = self.array(curve_table(), wp.types.vector(4, self.real))
        air.blasts.gauss = self.array(GAUSS)
        return air


def _craft_fields(vehicle: Vehicle, axes: int) -> dict[str, np.ndarray]:
    """Return the numbers of a kernel's vehicle."""
    allocated = allocation
    for _ in range(axes):
        allocated = jax.vmap(allocated)
    fields = {
        "mass": vehicle.mass_kg,
        "inertia": vehicle.inertia_kg_m2,
        "inverse_inertia": np.linalg.inv(np.asarray(vehicle.inertia_kg_m2, float)),
        "inverse_allocation": np.linalg.inv(np.asarray(allocated(vehicle), float)),
        "rotor_position": vehicle.rotor_position_m,
        "rotor_direction": vehicle.rotor_direction,
        "thrust_coefficient": vehicle.thrust_coefficient,
        "moment_coefficient": vehicle.moment_coefficient,
        "rotor_drag": vehicle.rotor_drag,
        "translational_lift": vehicle.translational_lift,
        "frame_drag": vehicle.frame_drag,
        "motor_rate": 1 / vehicle.motor_lag_s,
        "speed_min": vehicle.rotor_speed_min_rad_s,
        "speed_max": vehicle.rotor_speed_max_rad_s,
    }
    body = vehicle.body
    if body is not None:
        fields |= {
            "area": body.area_m2,
            "drag_coefficient": body.drag_coefficient,
            "volume": body.volume_m3,
            "added_mass": body.added_mass_coefficient,
            "pressure_centre": body.pressure_centre_m,
        }
    return _flat(fields, axes)


def _flat(fields: dict[str, Any], axes: int) -> dict[str, np.ndarray]:
    """Return arrays whose first axis is that of the vehicles."""
    arrays = {name: np.asarray(value, float) for name, value in fields.items()}
    return {name: x.reshape(-1, *x.shape[axes:]) for name, x in arrays.items()}


def _blast_columns(load: BlastLoad, blast: Blast) -> Float[Array, "*batch column"]:
    """Return the numbers of a blast, in the order of `wave.COLUMNS`."""
    pressure, speed = load.pressure_pa, load.sound_speed_m_s
    scale = sachs_distance_factor(blast.mass_kg, pressure)
    pushing = sachs_distance_factor(blast.impulse_mass_kg, pressure)
    parts = [
        *jnp.moveaxis(blast.position_m, -1, 0),
        blast.time_s,
        FIRST * scale,
        jnp.log(scale),
        jnp.log(pushing),
        sachs_time_factor(blast.impulse_mass_kg, pressure, speed),
        speed,
        *jnp.moveaxis(load.wind_m_s, -1, 0),
        AIR_HEAT_CAPACITY_RATIO * pressure / jnp.square(speed),
    ]
    return jnp.stack(jnp.broadcast_arrays(*parts), axis=-1)
