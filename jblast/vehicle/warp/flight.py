"""Flights of a batch by the Warp kernel: transfer of arguments, launch, results."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from jaxtyping import Array, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.errors import InputError
from jblast.scene.charge import BURSTS
from jblast.vehicle.control.allocation import allocation
from jblast.vehicle.controllers import kernel_of
from jblast.vehicle.loads.blast import BlastLoad
from jblast.vehicle.loads.blast_wave import FIRST, Blast
from jblast.vehicle.quadrotor import Vehicle, required_body
from jblast.vehicle.rollout import Each, Flight, Ticks, own
from jblast.vehicle.state import Trajectory
from jblast.vehicle.warp.blast import DRAG, FRONT, GAUSS, ROTORS, curve_table
from jblast.vehicle.warp.position_hold import hold_functions
from jblast.vehicle.warp.rollout import COLUMNS, FIELDS, KINDS, rollout_kernel
from jblast.waves.scaling import sachs_distance_factor, sachs_time_factor

THREADS = 128
"""Threads per block: four warps, so that several blocks share a multiprocessor."""


class KernelFlight:
    """Flights of a batch or of one vehicle on a device; `fly` can be repeated."""

    def __init__(
        self,
        flight: Flight,
        ticks: Ticks,
        time_s: Float[Array, " time"],
        period_s: float,
        *,
        batch: tuple[int, ...],
        store_every: int,
        device: str | None,
    ):
        """Transfer the arguments to the device.

        Args:
            flight: As for `rollout.fly`, with floats of one precision.
            ticks: The steps.
            time_s: Times of the stored rows.
            period_s: Period of the controller.
            batch: Axes of the batch.
            store_every: Steps between rows.
            device: Warp's name of the device; default: the first GPU, or the CPU.

        Raises:
            InputError: The device is unknown, or its memory is too small for the rows.
        """
        place = device_named(device)
        dtype = np.dtype(time_s.dtype)
        real: Any = {"float32": wp.float32, "float64": wp.float64}[dtype.name]
        control = own(flight.control)
        warp_control = None if control is None else kernel_of(control)
        functions = hold_functions if warp_control is None else warp_control.functions
        kernel = rollout_kernel(real, functions)
        send, count = Sender(place, real, batch), int(np.prod(batch))
        try:
            rows = wp.empty((time_s.size, COLUMNS, count), dtype=real, device=place)
        except RuntimeError:
            size = time_s.size * COLUMNS * count * dtype.itemsize / 1e9
            raise InputError(
                f"store_every: {time_s.size} rows of {count} vehicles take {size:.3g} "
                f"GB, more than {place} has; increase store_every"
            ) from None
        up = flight.ground_up_m
        state = jnp.concatenate(jax.tree.leaves(own(flight.state)), axis=-1)
        self.time_s, self.batch, self.device = time_s, batch, place
        self.kernel = kernel.kernel
        self.inputs = [
            send.vehicles(kernel.Vehicle, flight.vehicle),
            send.air(kernel.Air, flight),
            send.clock(kernel.Clock, ticks, store_every),
            send.pilot(kernel.Pilot, flight, period_s),
            send.columns(state),
            real(-np.inf if up is None else float(up)),
        ]
        self.rows, self.lost = rows, wp.zeros(count, dtype=wp.int32, device=place)

    def fly(self) -> None:
        """Run all flights to their end."""
        wp.launch(
            self.kernel,
            dim=self.lost.size,
            inputs=self.inputs,
            outputs=[self.rows, self.lost],
            device=self.device,
            block_dim=THREADS,
        )
        # A launch returns before the kernel ends, and JAX does not wait for Warp.
        wp.synchronize_device(self.device)

    def trajectory(self) -> Trajectory:
        """Return the trajectory as JAX arrays."""
        size = self.time_s.size
        rows = jnp.moveaxis(wp.to_jax(self.rows), 2, 0)
        x, v, q, w, speeds, force, moment = jnp.split(
            rows.reshape(*self.batch, size, COLUMNS),
            np.cumsum([3, 3, 4, 3, 4, 3]),
            axis=-1,
        )
        lost = (wp.to_jax(self.lost) != 0).reshape(self.batch)
        return Trajectory(self.time_s, x, v, q, w, speeds, force, moment, lost)


def device_named(name: str | None) -> Any:
    """Return a Warp device by name.

    Raises:
        InputError: The name is unknown.
    """
    try:
        return wp.get_device(name)
    except (RuntimeError, ValueError):
        known = ", ".join(str(device) for device in wp.get_devices())
        raise InputError(
            f"backend: expected a device of warp:DEVICE among {known}, got {name}"
        ) from None


class Sender:
    """Transfer of numbers to a device: one column per vehicle, or one for all."""

    def __init__(self, device: Any, real: Any, batch: tuple[int, ...]):
        """Store the common arguments.

        Args:
            device: Warp device.
            real: `wp.float32` or `wp.float64`.
            batch: Axes of the batch.
        """
        self.device, self.real, self.axes = device, real, len(batch)

    def array(self, value: Any, kind: Any = None) -> Any:
        """Return a Warp array; JAX arrays are not copied if they are on the device."""
        kind = kind or self.real
        if isinstance(value, jax.Array):
            # Shared without a copy, so it must be complete: Warp does not wait for JAX.
            there = wp.from_jax(jax.block_until_ready(value.astype(kind)))
            return there.to(self.device)
        scalar = getattr(kind, "_wp_scalar_type_", kind)  # scalar type of a vector type
        numbers = np.asarray(value, wp.dtype_to_numpy(scalar))
        return wp.array(numbers, dtype=kind, device=self.device)

    def columns(self, value: Any) -> Any:
        """Return (..., k) as (k, vehicles)."""
        # Vehicles in the last axis: neighbouring threads read neighbouring numbers.
        return self.array(jnp.asarray(value).reshape(-1, value.shape[-1]).T)

    def vehicles(self, struct: Any, vehicle: Vehicle | Each) -> Any:
        """Return one struct per vehicle, or a single one shared by all."""
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
        """Return the source of rotor commands."""
        pilot = Pilot()
        pilot.period = self.real(period_s)
        if flight.commands is not None:
            pilot.kind = 1
            rows = own(flight.commands)
            lanes = rows.reshape(-1, *rows.shape[-2:])
            pilot.table = self.array(jnp.moveaxis(lanes, 0, -1))
        if flight.control is not None:
            pilot.kind = 2
            control = own(flight.control)
            kernel = kernel_of(control)
            # `simulate.flies_on_warp` leaves controllers without a kernel to JAX.
            assert kernel is not None, "controller without Warp functions"
            pilot.orders = self.columns(kernel.orders(control))
        return pilot

    def air(self, Air: Any, flight: Flight) -> Any:
        """Return wind and blasts."""
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
    """Return the fields of a kernel's vehicles, with vehicles along the first axis."""
    allocated = allocation
    for _ in range(axes):
        allocated = jax.vmap(allocated)
    fields = {
        "mass": vehicle.mass_kg,
        "inertia": vehicle.inertia_kg_m2,
        # Inverses in float64 on the host: inverting in float32 on the device would cost
        # digits.
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
    arrays = {name: np.asarray(value, float) for name, value in fields.items()}
    return {name: x.reshape(-1, *x.shape[axes:]) for name, x in arrays.items()}


def _blast_columns(load: BlastLoad, blast: Blast) -> Float[Array, "*batch column"]:
    """Return the numbers of a blast in the order of `COLUMNS`."""
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
