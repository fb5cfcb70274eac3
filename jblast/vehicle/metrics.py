r"""Effects of a blast on a flight, from stored rows, and damage thresholds.

The path error of a row is the distance from the target, $e(t) = |x(t) - x_0|$: for a
position controller its set point, otherwise any path given row by row. With $t_0$ the
time of the blast (its arrival at the vehicle) and a tolerance $\epsilon$:

- before, after: the root mean square of $e$ over the rows before and from $t_0$;
- peak deviation: the largest $e$ from $t_0$ on, and its time after $t_0$;
- recovery time: from $t_0$ to the time after which $e$ stays within $\epsilon$ until
  the end of the flight, with $e$ linear between two rows. 0 if it never exceeds
  $\epsilon$, infinite if it exceeds $\epsilon$ at the end;
- settled: path error within the tolerance and speed below a limit over a final interval
  of given length;
- crashed: reached the ground from above, diverged, or overturned (body z below the
  horizon); a vehicle that starts on the ground counts as flying once it is higher than
  the tolerance;
- flies on: not crashed; damage by the blast is not included.

A vehicle that diverged has rows of NaN: its peak is that of the finite rows, and it
never recovers. Without contributing rows a number is NaN. The resolution of a recovery
time is that of the rows, and a wave that arrives after the end is not included.

No published measurement was found of the blast that a Crazyflie, a Hummingbird or an
Iris withstands. The damage thresholds are therefore declared, each with its origin;
None means unknown. A vehicle below all of them may be damaged, and one above a
threshold may be intact.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.kept_programs import kept
from jblast.types import as_numbers
from jblast.vehicle.state import Trajectory


class FlightMetrics(eqx.Module):
    """Effects of a blast on flights; definitions above.

    Attributes:
        error_before_m: Root mean square of the path error before the blast.
        error_after_m: Root mean square of the path error after the blast.
        peak_deviation_m: Maximum path error after the blast.
        peak_time_s: Time of the maximum, after the blast.
        recovery_time_s: Time after the blast; infinite: not within this flight.
        settled: True if the vehicle is at rest at the target at the end.
        crashed: True if it hit the ground, overturned or diverged.
    """

    error_before_m: Float[Array, "*batch"]
    error_after_m: Float[Array, "*batch"]
    peak_deviation_m: Float[Array, "*batch"]
    peak_time_s: Float[Array, "*batch"]
    recovery_time_s: Float[Array, "*batch"]
    settled: Bool[Array, "*batch"]
    crashed: Bool[Array, "*batch"]


def path_error(
    trajectory: Trajectory, target_m: Float[ArrayLike, "..."]
) -> Float[Array, "*batch time"]:
    """Return the distance from the target at each row [m]; NaN where it diverged.

    Args:
        trajectory: The flights.
        target_m: East, north, up: (3,), or what broadcasts to the rows.
    """
    away = trajectory.position_m - jnp.broadcast_to(
        as_numbers(target_m), trajectory.position_m.shape
    )
    return jnp.linalg.norm(away, axis=-1)


@kept
def flight_metrics(
    trajectory: Trajectory,
    target_m: Float[ArrayLike, "..."],
    blast_time_s: Float[ArrayLike, "..."],
    *,
    tolerance_m: float = 0.05,
    rest_m_s: float = 0.05,
    rest_s: float = 0.5,
    ground_up_m: float | None = None,
) -> FlightMetrics:
    """Return the effects of a blast on flights.

    Args:
        trajectory: The flights.
        target_m: Target position: shape (3,), or broadcastable to the rows.
        blast_time_s: Arrival time of the blast, per flight or for all [s].
        tolerance_m: Tolerance of the path error.
        rest_m_s: Speed below which a vehicle is at rest.
        rest_s: Length of the final interval at rest for a settled vehicle.
        ground_up_m: Height of the ground; None: no ground.
    """
    time, error = trajectory.time_s, path_error(trajectory, target_m)
    known = jnp.isfinite(error)
    blast = jnp.broadcast_to(
        as_numbers(blast_time_s).astype(time.dtype), error.shape[:-1]
    )[..., None]
    times = jnp.broadcast_to(time, error.shape)
    after = times >= blast
    seen = known & after
    # -1 is below every distance, so rows that do not count never have the maximum.
    peak_row = jnp.argmax(jnp.where(seen, error, -1.0), axis=-1, keepdims=True)
    some = jnp.any(seen, axis=-1)

    def of_peak(rows: Float[Array, "*batch time"]) -> Float[Array, "*batch"]:
        value = jnp.take_along_axis(rows, peak_row, axis=-1)[..., 0]
        return jnp.where(some, value, jnp.nan)

    late = times >= time[-1] - rest_s
    speed = jnp.linalg.norm(trajectory.velocity_m_s, axis=-1)
    still = (error <= tolerance_m) & (speed <= rest_m_s)
    return FlightMetrics(
        error_before_m=_rms(error, known & ~after),
        error_after_m=_rms(error, seen),
        peak_deviation_m=of_peak(error),
        peak_time_s=of_peak(times - blast),
        recovery_time_s=_recovery(times, error, blast, after, tolerance_m),
        settled=jnp.all(still | ~late, axis=-1),
        crashed=_crashed(trajectory, ground_up_m, tolerance_m),
    )


def _rms(
    error: Float[Array, "*batch time"], rows: Bool[Array, "*batch time"]
) -> Float[Array, "*batch"]:
    """Root mean square over selected rows; NaN without rows."""
    count = jnp.sum(rows.astype(error.dtype), axis=-1)
    # Masked before the square: the NaN of a diverged row would pass a product with 0.
    total = jnp.sum(jnp.square(jnp.where(rows, error, 0.0)), axis=-1)
    return jnp.where(count > 0, jnp.sqrt(total / jnp.maximum(count, 1)), jnp.nan)


def _recovery(
    times: Float[Array, "*batch time"],
    error: Float[Array, "*batch time"],
    blast: Float[Array, "*batch 1"],
    after: Bool[Array, "*batch time"],
    tolerance: float,
) -> Float[Array, "*batch"]:
    """Time from the blast until the error stays within its tolerance."""
    # A comparison with NaN is false, so diverged rows count as outside.
    outside = after & ~(error <= tolerance)
    rows = error.shape[-1]
    last = rows - 1 - jnp.argmax(outside[..., ::-1], axis=-1, keepdims=True)
    ever = jnp.any(outside, axis=-1, keepdims=True)
    following = jnp.minimum(last + 1, rows - 1)

    def pick(values: Float[Array, "*batch time"], row: Array) -> Array:
        return jnp.take_along_axis(values, row, axis=-1)

    high, low = pick(error, last), pick(error, following)
    falls = high > low
    # An interval that does not fall has no crossing; 1 keeps its quotient finite.
    share = (high - tolerance) / jnp.where(falls, high - low, 1.0)
    start = pick(times, last)
    at = start + jnp.where(falls, share, 1.0) * (pick(times, following) - start)
    back = jnp.where(last == rows - 1, jnp.inf, at - blast)
    none = jnp.where(jnp.any(after, axis=-1, keepdims=True), 0.0, jnp.nan)
    return jnp.where(ever, back, none)[..., 0]


def _crashed(
    trajectory: Trajectory, ground_up_m: float | None, tolerance: float
) -> Bool[Array, "*batch"]:
    """Return whether a flight hit the ground, overturned or diverged."""
    i, j, _, _ = jnp.moveaxis(trajectory.quaternion, -1, 0)
    # The z component of body z, from a quaternion of length 1.
    over = 1 - 2 * (jnp.square(i) + jnp.square(j)) < 0
    crashed = trajectory.lost | jnp.any(over, axis=-1)
    if ground_up_m is None:
        return crashed
    height = trajectory.position_m[..., 2] - ground_up_m
    # A gust rocks a vehicle on the ground by less than the tolerance.
    free = jnp.where(height[..., :1] > 0, 0.0, tolerance)
    flew = jnp.cumsum(height > free, axis=-1) > 0
    return crashed | jnp.any((height <= 0) & flew, axis=-1)


class Threshold(NamedTuple):
    """A damage threshold of an exposure.

    Attributes:
        value: In the unit of the exposure; null: unknown.
        source: Source of the number, or a note that none was found.
    """

    value: float | None
    source: str


PARKED = Threshold(
    55e3,
    "damage to parked aircraft beyond repair, 8 psi (DoD 6055.9-STD, C2.3, quoted from "
    "memory); there is no published value for this vehicle",
)
FIRE = Threshold(0.0, "no exposure to the fireball (about 2000 K) is accepted")
FRAME = (
    "above which the attitude estimate fails; there is no published value for the frame"
)
ACCELERATION = {
    "crazyflie": Threshold(
        24 * 9.81,
        f"range of the accelerometer, 24 g (BMI088, Crazyflie 2.1), {FRAME}",
    ),
    "hummingbird": Threshold(
        None, "unknown: there is no published value for frame or accelerometer"
    ),
    "iris": Threshold(
        16 * 9.81,
        "range of the accelerometer, 16 g (MPU-6000, Pixhawk, quoted from memory), "
        f"{FRAME}",
    ),
}
THRESHOLDS = {
    name: {
        "peak_overpressure_pa": PARKED,
        "peak_acceleration_m_s2": acceleration,
        "fireball_time_s": FIRE,
    }
    for name, acceleration in ACCELERATION.items()
}
"""Damage thresholds of the named vehicles, by exposure."""
