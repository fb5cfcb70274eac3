"""The flights that gains are tuned by: few of many drawn, the strongest among them."""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.errors import InputError
from jblast.scene import UncertainScene, VehicleSpec
from jblast.study.flights.records import Options
from jblast.study.gains.flights import DrawnFlights, drawn_flights
from jblast.study.gains.objective import FACTORS, mean_ln_peak
from jblast.vehicle import Gains

DRAWN, STRONGEST = 8, 4
"""Flights drawn for each that is tuned by, of which one in so many is of the highest
peaks; the rest stand for all of them, at even ranks."""
STEP_S, AFTER_S = 1e-3, -2.0
"""Longest step; how much shorter a flight is than `jblast fly` makes it."""


class TuningFlights(NamedTuple):
    """Flights to tune by, and those to choose by.

    Attributes:
        few: Flown with slopes at each step of the search.
        ln_few: Of each ln of its peak deviation with the scene's gains.
        many: Flown once with each gains among which is chosen.
        ln_many: Likewise.
    """

    few: DrawnFlights
    ln_few: Float[Array, " few"]
    many: DrawnFlights
    ln_many: Float[Array, " many"]


def tuning_flights(
    uncertain: UncertainScene,
    spec: VehicleSpec,
    gains: Gains,
    count: int,
    seed: int,
    motor_lag_s: float,
) -> TuningFlights:
    """Draw flights and choose those to tune by.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        spec: Its vehicle.
        gains: The scene's; flights that crash with them are left out.
        count: How many to tune by.
        seed: Of the draws.
        motor_lag_s: Of the motors [s].

    Raises:
        InputError: All crash.
    """
    step = min(STEP_S, motor_lag_s / 5)
    options = Options(step_s=step, integrator="euler")
    drawn, _ = drawn_flights(uncertain, spec, DRAWN * count, seed, options)
    drawn = replace(drawn, seconds=drawn.seconds + AFTER_S)
    none = jnp.zeros(drawn.count)
    _, (peaks, crashed) = FLOWN(jnp.zeros(FACTORS), gains, drawn, none)
    kept = np.flatnonzero(~np.asarray(crashed))
    if not kept.size:
        raise InputError(
            f"expected flights that stay up to tune gains by, got {crashed.size} that "
            "all crash with the scene's own gains"
        )
    ranks = kept[np.argsort(np.asarray(peaks)[kept])]
    lanes = ranks[chosen_ranks(ranks.size, count)]
    every = np.resize(kept, drawn.count)
    return TuningFlights(
        _of(drawn, lanes), peaks[lanes], _of(drawn, every), peaks[every]
    )


def chosen_ranks(drawn: int, count: int) -> Int[np.ndarray, " few"]:
    """Return which ranks are tuned by, of flights in the order of their peaks.

    Args:
        drawn: How many there are; the same stand more than once where they are few.
        count: How many to return.
    """
    top = count // STRONGEST if drawn >= count else 0
    rest = drawn - top
    even = np.floor((np.arange(count - top) + 0.5) * rest / (count - top))
    return np.append(even, np.arange(rest, drawn)).astype(int)


FLOWN = eqx.filter_jit(mean_ln_peak)
"""What is made least, without its slopes."""


def _of(flights: DrawnFlights, lanes: Int[np.ndarray, " flight"]) -> DrawnFlights:
    each = (flights.load, flights.wind, flights.arrival_s)
    load, wind, arrival = jax.tree.map(lambda x: x[lanes], each)
    return replace(flights, load=load, wind=wind, arrival_s=arrival)
