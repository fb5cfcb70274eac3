r"""Weight of the free-air curves for a charge above the ground.

The free-air curves hold until the reflection from the ground arrives. It comes from the
image of the charge below the ground, at a distance of

$$R' = \sqrt{R^2 + 4 h h_s}$$

for a charge $h$ and a sensor $h_s$ above the ground. Where it arrives after the
positive phase has ended, peak, impulse and duration are those of free air. This agrees
with UFC 3-340-02 (from memory), whose free-air burst reaches a position before any
reflection does. On the ground both waves arrive simultaneously: the surface curves.

With the delay $\tau$ of the reflection behind the front and the duration $t_d$, both by
the free-air curves, the weight of the free-air curves is

$$w = s\!\left(\frac{\ln(2\tau/t_d)}{\ln 2}\right), \qquad
  s(x) = 6x^5 - 15x^4 + 10x^3 \text{ from 0 to 1}$$

so it is 1 from $\tau = t_d$ on, 0 up to $\tau = t_d/2$, and smooth between, where a fit
has to move a height through it. Laws are not valid there: the reflection arrives within
the positive phase, which neither curve contains. The reflection travels through air
that is heated and moved by the incident wave, so it arrives slightly earlier than
computed.
"""

import math
from collections.abc import Container
from dataclasses import replace
from typing import Any

import numpy as np

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.scene import Charge, Scene
from jblast.types import Float, is_traced, namespace
from jblast.waves.arguments import Number
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_duration
from jblast.waves.laws.shock_kinematics import shock_kinematics_arrival_time
from jblast.waves.propagation import ambient
from jblast.waves.scaling import sachs_distance_factor
from jblast.waves.tables import Numbers, smooth_step

# A choice: the contract marks these rows, and a fit needs a slope over a factor of two.
FIRST_DELAY = 0.5
"""Delay of the reflection over the duration at which the weight leaves zero [-]."""


def image_range(
    slant_range: Number, height_of_burst: Number, sensor_height: Number
) -> Numbers:
    r"""Return the distance from the image of the charge, $\sqrt{R^2 + 4 h h_s}$ [m].

    Args:
        slant_range: $R$ [m].
        height_of_burst: $h$ [m]; negative heights count as zero.
        sensor_height: $h_s$ [m]; negative heights count as zero.
    """
    xp = namespace(slant_range, height_of_burst, sensor_height)
    # The image is at -h: R'^2 - R^2 = (h + h_s)^2 - (h - h_s)^2.
    lifted = 4.0 * xp.maximum(height_of_burst, 0.0) * xp.maximum(sensor_height, 0.0)
    above = lifted > 0.0
    # R itself on the ground: the root of a square would lose its last digits, and its
    # slope at zero is NaN
    image = xp.sqrt(xp.where(above, slant_range**2 + lifted, 1.0))
    return xp.where(above, image, slant_range)


def free_air_weight(
    slant_range: Number,
    charge_mass: Number,
    height_of_burst: Number,
    sensor_height: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
    sound_speed: Number = STANDARD_SOUND_SPEED,
) -> Numbers:
    """Return the weight of the free-air curves, 0 to 1.

    Args:
        slant_range: Distance from the charge [m].
        charge_mass: TNT-equivalent mass [kg].
        height_of_burst: Height of the charge above the ground [m].
        sensor_height: Height of the sensor above the ground [m].
        ambient_pressure: $P_0$ [Pa].
        sound_speed: $c_0$ [m/s].
    """
    xp = namespace(slant_range, charge_mass, height_of_burst, sensor_height)
    far = image_range(slant_range, height_of_burst, sensor_height)
    good = (slant_range > 0.0) & (charge_mass > 0.0) & (far > slant_range)
    # harmless arguments elsewhere, so that gradients stay finite
    near, mass = xp.where(good, slant_range, 1.0), xp.where(good, charge_mass, 1.0)
    far = xp.where(good, far, 2.0)
    air = (mass, ambient_pressure, sound_speed, "free-air")
    delay = shock_kinematics_arrival_time(far, *air)
    delay = delay - shock_kinematics_arrival_time(near, *air)
    share = delay / kingery_bulmash_duration(near, *air)
    weight = smooth_step(xp.log(share), math.log(FIRST_DELAY), 0.0)
    return xp.where(good, weight, 0.0)


def grounded(scene: Scene, free: Container[str] = ()) -> Scene:
    """Return the scene with surface curves for charges that stay on the ground.

    The weight of their free-air curves is zero. Programs have half the size without
    them, so this is called outside jit, where heights are known.

    Args:
        scene: The scene.
        free: Names of numbers that will change.
    """

    def stays(charge: Charge) -> bool:
        fixed = f"charge_up_m{scene.label(charge)}" not in free
        known = charge.burst is None and not is_traced(charge.up)
        return fixed and known and bool(np.all(np.asarray(charge.up) <= 0.0))

    charges = (
        replace(one, burst="surface") if stays(one) else one for one in scene.charges
    )
    return replace(scene, charges=tuple(charges))


def burst_notes(
    charge: Charge,
    heights: tuple[float, float],
    weight: Float[Any, " place"],
    what: str,
) -> list[str]:
    """Return a note on the curves used for a charge above the ground.

    Args:
        charge: The charge; its `burst` is None if the height selects the curves.
        heights: Smallest and largest height of burst [m/kg^(1/3)].
        weight: Weight of the free-air curves by the height, for each position.
        what: Name of a position, for example "sensor".
    """
    low, high = heights
    contradicts = charge.burst == "free-air" and charge.range_m is None
    if not weight.size or (high <= 0.0 and not contradicts):
        return []
    kinds = (
        ("free-air curves", weight >= 1.0),
        ("surface curves", weight <= 0.0),
        ("a mean of both sets (not valid)", (weight > 0.0) & (weight < 1.0)),
    )
    parts = [f"{words} at {of.sum()}" for words, of in kinds if of.any()]
    which = f"the charge {charge.name}" if charge.name else "the charge"
    height = f"{low:.2g}" if low == high else f"{low:.2g} to {high:.2g}"
    note = f"{which} has a scaled height of {height} m/kg^(1/3), which gives "
    note += f"{', '.join(parts)} of {weight.size} {what}s"
    differs = weight < 1.0 if charge.burst == "free-air" else weight > 0.0
    if charge.burst is not None and differs.any():
        note += f'; burst = "{charge.burst}" contradicts the height'
    return [note]


def scaled_height(scene: Scene, charge: Charge) -> Numbers:
    """Return the height of burst [m/kg^(1/3)]."""
    _, pressure = ambient(scene.air)
    mass = charge.tnt_mass("peak_overpressure_pa")
    return charge.up / sachs_distance_factor(mass, pressure)
