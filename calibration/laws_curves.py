"""Every law of every quantity over scaled distance, both curve sets, ready to draw."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import GRANITE_P_SPEED, STANDARD_SOUND_SPEED
from jblast.registry import LAWS, Law, call
from jblast.report.calculator.figures import NOT_DRAWN
from jblast.report.words import split_name
from jblast.scene import Air, Charge, Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator import scene_path, with_rows
from jblast.waves.laws.weak_shock import HUMIDITY
from jblast.waves.paths import Path

MASS = 15.0
"""Of the charge [kg]: scaled by its cube root, few laws depend on it."""
UNSCALED = ("weak_shock_iso", "wu_hao")
"""Those that do."""
SCALED_DISTANCE = np.geomspace(0.05, 1e4, 600)
SCALED_TIME = np.geomspace(1e-6, 1e-2, 600)
BURSTS: tuple[Burst, Burst] = ("surface", "free-air")
ON_THE_GROUND = ("ford_2021",)
"""Laws whose range asks for no burst, found with charges on or near the ground."""
SPEEDS = {
    "air_arrival_s": STANDARD_SOUND_SPEED,
    "ground_arrival_s": GRANITE_P_SPEED,
}
"""Arrivals are drawn over range/speed [m/s]: over decades of range they hide all."""


@dataclass(frozen=True)
class Curve:
    """One law along the x axis.

    Attributes:
        value: Scaled by the cube root of the mass where it grows with it, in SI.
        valid: Where the law holds.
    """

    value: Float[np.ndarray, " point"]
    valid: Bool[np.ndarray, " point"]


Curves = Mapping[str, Curve]
"""By law name."""


def drawn_laws(quantity: str = "") -> tuple[Law, ...]:
    """Return the laws that a figure shows.

    Args:
        quantity: Of this one alone; "" for all.
    """
    return tuple(
        law
        for law in LAWS.values()
        if law.quantity not in NOT_DRAWN and quantity in ("", law.quantity)
    )


def panels(quantity: str) -> dict[str, Curves]:
    """Return the curves of a quantity by burst, without laws that hold nowhere there.

    Radii at a time stand under "free-air" alone, over `SCALED_TIME`.
    """
    if quantity == "shock_radius_m":
        arrivals = _curves("air_arrival_s", "free-air")
        return {"free-air": {**_curves(quantity, "free-air"), **_turned(arrivals)}}
    by_burst = {burst: _curves(quantity, burst) for burst in BURSTS}
    return {burst: curves for burst, curves in by_burst.items() if curves}


def _curves(quantity: str, burst: Burst) -> Curves:
    path, factor = _path(burst), _factor(quantity)
    found = {}
    for law in sorted(drawn_laws(quantity), key=lambda law: law.name):
        if burst == "free-air" and law.name in ON_THE_GROUND:
            continue
        value = factor * np.asarray(call(law.function, path))
        valid = np.broadcast_to(np.asarray(call(law.valid, path)), value.shape)
        if valid.any():
            found[law.name] = Curve(value, valid)
    return found


def _size() -> float:
    return float(np.cbrt(MASS))


def _path(burst: Burst) -> Path:
    """Return the ways from a charge of TNT in dry standard air, on granite.

    Air without any vapour absorbs much more than any outdoors: absorption is that at
    `HUMIDITY`.
    """
    scene = Scene(charge=Charge(burst=burst), air=Air(relative_humidity=0.0))
    ranges, times = (jnp.asarray(_size() * x) for x in (SCALED_DISTANCE, SCALED_TIME))
    path = with_rows(scene_path(scene), ranges, jnp.full_like(ranges, MASS))
    humidity = jnp.asarray(HUMIDITY)
    return dataclasses.replace(
        path, time_since_detonation=times, relative_humidity=humidity
    )


def _factor(quantity: str) -> float | Float[np.ndarray, " point"]:
    """Return what turns a value at the charge into the one that is drawn."""
    if quantity in SPEEDS:
        return SPEEDS[quantity] / (_size() * SCALED_DISTANCE)
    grows = split_name(quantity)[1] in ("_s", "_pa_s", "_m")
    return 1.0 / _size() if grows else 1.0


def _turned(arrivals: Curves) -> Curves:
    """Return arrivals read the other way round: how far the shock is at a time."""
    found = {}
    for name, arrival in arrivals.items():
        time = arrival.value * SCALED_DISTANCE / STANDARD_SOUND_SPEED
        along = np.log(SCALED_TIME), np.log(time)
        radius = np.exp(np.interp(*along, np.log(SCALED_DISTANCE)))
        valid = np.interp(*along, arrival.valid.astype(float)) == 1.0
        reached = (time.min() <= SCALED_TIME) & (time.max() >= SCALED_TIME)
        valid &= reached
        if valid.any():
            found[name] = Curve(np.where(reached, radius, np.nan), valid)
    return found
