"""What tuned gains make least, and what they keep, as functions of nine factors."""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.study.flights.fly import GROUND_UP_M
from jblast.study.gains.flights import DrawnFlights, flown_with, smooth_peaks
from jblast.vehicle import Gains, flight_metrics
from jblast.vehicle.control.stability import hold_margins

FACTORS = 9
POWER, TAIL = 24.0, 8.0
"""Of the norms over a flight's rows, and over the flights."""
RIDGE, WAY_BACK = 1e-3, 0.5
"""Of the squares of the factors, and of the path error over time."""
WORSE = 64.0
"""Of the mean square of what ln of a peak is more than with the scene's gains."""
ENOUGH = 3.0
"""Margins beyond so many times what is asked do not guide the search."""


def scaled(gains: Gains, factors: Float[Array, "9"]) -> Gains:
    """Return gains times factors.

    Args:
        gains: The gains.
        factors: In ln: of position, velocity and integral gain, sideways and then
            upwards, of attitude, of body rate, and of the motors' lead if there is one.
    """
    by = jnp.exp(factors)

    def along(n: int) -> Array:
        return jnp.stack([by[n], by[n], by[n + 1]])

    return replace(
        gains,
        position=gains.position * along(0),
        velocity=gains.velocity * along(2),
        integral=gains.integral * along(4),
        attitude=gains.attitude * by[6],
        body_rate=gains.body_rate * by[7],
        motor_lead=None if gains.motor_lead is None else gains.motor_lead * by[8],
    )


def mean_ln_peak(
    factors: Float[Array, "9"],
    gains: Gains,
    flights: DrawnFlights,
    ln_before: Float[Array, " flight"],
) -> tuple[Float[Array, ""], tuple[Float[Array, " flight"], Bool[Array, " flight"]]]:
    """Return what is made least; of each flight ln of its peak, and whether it crashes.

    Args:
        factors: As in `scaled`.
        gains: The scene's.
        flights: Those to tune by.
        ln_before: Of each ln of its peak with the scene's gains.
    """
    trajectory = flown_with(scaled(gains, factors), flights)
    peaks = smooth_peaks(trajectory, flights, POWER)
    metrics = flight_metrics(
        jax.lax.stop_gradient(trajectory),
        flights.target_m,
        flights.arrival_s,
        ground_up_m=GROUND_UP_M,
    )
    strongest = jax.nn.logsumexp(TAIL * peaks) - jnp.log(peaks.size)
    middle = (jnp.mean(peaks) + strongest / TAIL) / 2
    back = WAY_BACK * jnp.mean(smooth_peaks(trajectory, flights, 2.0))
    more = jnp.maximum(peaks - ln_before, 0)
    worse = WORSE * jnp.mean(more * more)
    least = middle + back + worse + RIDGE * jnp.sum(factors**2)
    return least, (peaks, metrics.crashed)


def margins_to_spare(
    factors: Float[Array, "9"],
    gains: Gains,
    motor_lag_s: float,
    dead_time_s: float,
    asked: Float[Array, "2"],
) -> Float[Array, " loop_margin"]:
    """Return by what share margins are more than is asked: gain [dB], phase [deg]."""
    margins = hold_margins(scaled(gains, factors), motor_lag_s, dead_time_s)
    shares = [
        margins.up_db / asked[0],
        margins.down_db / asked[0],
        margins.phase_deg / asked[1],
    ]
    return jnp.minimum(jnp.concatenate(shares), ENOUGH) - 1.0
