r"""The radius of a fireball as a law that a log is read by: in metres, or in an image.

A row may stand before the explosion while a fit searches its origin time; there the
radius would be zero, and its logarithm no number. So before $t_e = 10^{-7}\,W^{1/3}$ s
(when the fireball would be smaller than the charge) the law goes on as
$R(t_e)\,t_e/(2t_e - t)$: positive, rising, marked invalid, and small whatever the time
constant. With time itself continued, as in `sedov_taylor`, a fit would find a growth
before the explosion in time constants below $t_e$.
"""

from typing import Any

import numpy as np

from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.fireballs import (
    fireball_duration,
    fireball_growth_time,
    fireball_radius,
)
from jblast.waves.laws.sedov_taylor import EARLIEST_TIME
from jblast.waves.tables import Numbers

# The outline is then 64 degrees off the centre; a camera inside the ball has none.
NEAREST_RATIO = 0.9
"""Largest ratio of radius to distance; above it the outline is extrapolated."""


@checked
def fireball_law_radius(
    time_since_detonation: Number,
    charge_mass: Number,
    fireball_growth: Number,
) -> Numbers:
    """Return the radius of a fireball [m], positive at all times.

    A missing time (NaN) gives NaN and a gradient of zero.

    Args:
        time_since_detonation: Time [s].
        charge_mass: TNT-equivalent mass [kg].
        fireball_growth: Time constant of the expansion [s]; NaN for that of the law.
    """
    time, mass, growth = time_since_detonation, charge_mass, fireball_growth
    xp = namespace(time, mass, growth)
    absent, missing = xp.isnan(growth), xp.isnan(time)
    # the inner guard keeps the NaN out of the gradient
    growth = xp.where(absent, fireball_growth_time(mass), xp.where(absent, 1.0, growth))
    time, earliest = xp.where(missing, 1.0, time), EARLIEST_TIME * xp.cbrt(mass)
    early = time < earliest
    radius = fireball_radius(mass, xp.where(early, earliest, time), growth)
    # the divisor must not be zero in the branch that is not used either
    share = xp.where(early, earliest / xp.where(early, 2 * earliest - time, 1.0), 1.0)
    return xp.where(missing, np.nan, radius * share)


@checked
def fireball_law_radius_in_image(
    time_since_detonation: Number,
    charge_mass: Number,
    fireball_growth: Number,
    slant_range: Number,
    camera_focal: Number,
) -> Numbers:
    r"""Return the radius of a fireball in an image without distortion [px].

    $$R_{px} = f \tan\alpha = \frac{f R}{\sqrt{d^2 - R^2}}, \qquad \sin\alpha = R/d$$

    with $\alpha$ the half-angle of the cone that touches the sphere. It is the radius
    of the circle in the centre of the image. Elsewhere the image of a sphere is an
    ellipse, whose size must be converted to $\alpha$ first. Above $R/d$ =
    `NEAREST_RATIO` the law is a power of $R/d$ with its slope there.

    Args:
        time_since_detonation: Time [s].
        charge_mass: TNT-equivalent mass [kg].
        fireball_growth: Time constant of the expansion [s]; NaN for that of the law.
        slant_range: Distance $d$ from the camera to the charge [m].
        camera_focal: Focal length $f$ [px].
    """
    radius = fireball_law_radius(time_since_detonation, charge_mass, fireball_growth)
    distance, xp = slant_range, namespace(radius, slant_range, camera_focal)
    apart = ~(distance <= 0)  # NaN stays NaN
    sine = xp.where(apart, radius / xp.where(apart, distance, 1.0), 1.0)
    inside = xp.minimum(sine, NEAREST_RATIO)
    tangent = inside / xp.sqrt(1.0 - xp.square(inside))
    beyond = (xp.maximum(sine, NEAREST_RATIO) / NEAREST_RATIO) ** (
        1.0 / (1.0 - NEAREST_RATIO**2)
    )
    return camera_focal * tangent * beyond


def fireball_law_valid(
    time_since_detonation: Number,
    charge_mass: Number,
) -> Any:
    """Return True from the begin to the end of the visible glow."""
    earliest = EARLIEST_TIME * namespace(charge_mass).cbrt(charge_mass)
    begun = time_since_detonation >= earliest
    return begun & (time_since_detonation < fireball_duration(charge_mass))


def fireball_law_valid_in_image(
    time_since_detonation: Number,
    charge_mass: Number,
    fireball_growth: Number,
    slant_range: Number,
) -> Any:
    """Return True during the glow, for a camera well outside the fireball."""
    radius = fireball_law_radius(time_since_detonation, charge_mass, fireball_growth)
    valid = fireball_law_valid(time_since_detonation, charge_mass)
    return valid & (radius <= NEAREST_RATIO * slant_range)


_SCATTER = declared_scatter(shot=0.20, record=0.05)
# Rakaczky's and High's fits differ by 6 %, shots by more: how a charge burns on after
# the detonation depends on its case and the ground. The edge of a fireball is rough.

for _quantity, _function, _valid, _range in (
    (
        "fireball_radius_m",
        fireball_law_radius,
        fireball_law_valid,
        "while it glows: 0 < t < 0.258 W^0.349 s",
    ),
    (
        "fireball_radius_px",
        fireball_law_radius_in_image,
        fireball_law_valid_in_image,
        "while it glows: 0 < t < 0.258 W^0.349 s; camera outside: R < 0.9 d",
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="fireball",
            function=_function,
            range=_range,
            source="Rakaczky 1975, second-hand; growth declared",
            valid=_valid,
            scatter=_SCATTER,
            scatter_source="declared",
        )
    )
