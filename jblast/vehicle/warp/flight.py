"""Fly vehicles by the kernel: what JAX holds goes over as arrays, and comes back so."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.vehicle.dynamics.state import Trajectory
from jblast.vehicle.rollout.batching import own
from jblast.vehicle.rollout.flight import Flight
from jblast.vehicle.rollout.timetable import Ticks
from jblast.vehicle.warp.arrays import Sender
from jblast.vehicle.warp.kernels.rollout import COLUMNS, rollout_kernel

THREADS = 128
"""Of a block of threads."""


class KernelFlight:
    """Flights of a batch, or of one vehicle, on a device; `fly` may be called again."""

    def __init__(
        self,
        flight: Flight,
        ticks: Ticks,
        time_s: Float[Array, " time"],
        period_s: float,
        *,
        batch: tuple[int, ...],
        integrator: str,
        store_every: int,
        device: str | None,
    ):
        """Put everything on the device.

        Args:
            flight: As for `rollout.fly`, all its floats of one precision.
            ticks: The steps.
            time_s: Of the rows that are stored.
            period_s: Time between two turns of the controller.
            batch: Axes of the batch.
            integrator: "rk4" or "euler".
            store_every: Steps between rows.
            device: Warp's name of it; by default the first GPU, or the CPU.

        Raises:
            InputError: There is no such device, or the rows do not fit on it.
        """
        place = device_named(device)
        dtype = np.dtype(time_s.dtype)
        real: Any = {"float32": wp.float32, "float64": wp.float64}[dtype.name]
        kernel = rollout_kernel(real, integrator)
        send, count = Sender(place, real, batch), int(np.prod(batch))
        try:
            rows = wp.empty((time_s.size, COLUMNS, count), dtype=real, device=place)
        except RuntimeError:
            size = time_s.size * COLUMNS * count * dtype.itemsize / 1e9
            raise InputError(
                f"store_every: {time_s.size} rows of {count} vehicles take {size:.3g} "
                f"GB, more than {place} has; store fewer"
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
        """Fly them all, to the end."""
        wp.launch(
            self.kernel,
            dim=self.lost.size,
            inputs=self.inputs,
            outputs=[self.rows, self.lost],
            device=self.device,
            block_dim=THREADS,
        )
        wp.synchronize_device(self.device)

    def trajectory(self) -> Trajectory:
        """Return the rows as JAX has them."""
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
    """Return a device of Warp's.

    Raises:
        InputError: There is none of that name.
    """
    try:
        return wp.get_device(name)
    except (RuntimeError, ValueError):
        known = ", ".join(str(device) for device in wp.get_devices())
        raise InputError(
            f"backend: expected a device of warp:DEVICE among {known}, got {name}"
        ) from None
