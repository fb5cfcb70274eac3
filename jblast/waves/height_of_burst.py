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

import numpy as np
from jaxtyping import Bool

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.scene import Charge, Scene
from jblast.types import namespace
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


def burst_notes(
    charge: Charge,
    heights: tuple[float, float],
    free: Bool[np.ndarray, " place"],
    what: str,
) -> list[str]:
    """Describe the curves used for a charge above the ground, and their deficiencies.

    Args:
        charge: Charge with its curve set; None if the set depends on the position.
        heights: Smallest and largest height of burst [m/kg^(1/3)].
        free: True where the reflection follows the positive phase.
        what: Name of a position, for example "sensor".
    """
    low, high = heights
    height = f"{low:.2g}" if low == high else f"{low:.2g} to {high:.2g}"
    which = f"the charge {charge.name}" if charge.name else "the charge"
    at = f"at {free.sum()} of {free.size} {what}s"
    at = f"at every {what}" if free.all() else at
    late = "the reflection from the ground comes after the positive phase"
    stood = f"{which} was {height} m/kg^(1/3) above the ground"
    against = f'burst = "{charge.burst}" contradicts the height: '
    reason = "as requested"
    if charge.by_height:  # selected by another height than the final one
        against, reason = "", "chosen before the height was known"
    if not free.size:
        return []
    if high <= 0.0:
        if charge.burst == "free-air" and charge.range_m is None:
            return [
                f"{against}{which} was on the ground or below it; the free-air curves "
                f"were used, {reason}"
            ]
        return []
    if charge.burst == "surface" and (free.all() if charge.by_height else free.any()):
        return [
            f"{against}{stood}, and {at} {late}; the surface curves, of up to twice "
            f"the impulse, were used, {reason}"
        ]
    if charge.burst == "free-air" and not free.all():
        early = f"at {(~free).sum()} of {free.size} {what}s"
        return [
            f"{against}{stood}, and {early} the reflection from the ground comes "
            "within the positive phase, which the free-air curves do not contain; "
            f"they were used, {reason}"
        ]
    if free.all():
        return [f"{stood}; {at} {late}: the free-air curves were used"]
    between = f"{stood}, but not so high that {late}: between the limits of the curves"
    if free.any() and charge.burst is not None:
        return [f"{between}; {at} it does; the {charge.burst} curves were used for all"]
    if free.any():
        return [
            f"{between}; {at} it does, and the free-air curves were used; elsewhere "
            "neither set is valid, and the surface curves were used"
        ]
    return [f"{between}, of which the surface ones were used"]


def scaled_height(scene: Scene, charge: Charge) -> Numbers:
    """Return the height of burst [m/kg^(1/3)]."""
    _, pressure = ambient(scene.air)
    mass = charge.tnt_mass("peak_overpressure_pa")
    return charge.up / sachs_distance_factor(mass, pressure)
