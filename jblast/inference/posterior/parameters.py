"""The parameters of a fit, and the values reported for them.

The uncertain numbers of a scene are one vector of coordinates. Each number has its own
coordinate $z$ (see `scene.uncertain`): its logarithm where it is free and positive, the
number itself where it is free, a normal score where it has a prior.

The growth time of a fireball is free unless the scene states otherwise: no source gives
it to better than a factor of two.

An `Estimate` is the result for one number in its unit: most probable value, standard
deviation, 90 % interval.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.quantities import BY_CAMERA, FIREBALL_RADII
from jblast.scene import Free, Scene, UncertainScene, parameter_named, with_values
from jblast.scene.uncertain import Belief
from jblast.waves.fireballs import fireball_growth_time

GROWTH = "fireball_growth_s"
NORMAL_Q95 = 1.6448536269514722
"""95 % quantile of the standard normal."""


class Parameters(eqx.Module):
    """The uncertain numbers of a scene, in a fixed order.

    Attributes:
        names: Names as in `scene.PARAMETERS`.
        beliefs: Prior, or `Free`, of each name.
        scene: Scene with all fixed numbers.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    beliefs: tuple[Belief, ...]
    scene: Scene

    def values(self, z: Float[Array, " free"]) -> dict[str, Any]:
        """Return the numbers by name."""
        # outside of a trace by NumPy: JAX would compile a program for each shape
        at = z if isinstance(z, Tracer) else np.asarray(z)
        return {
            name: belief.constrain(at[i])
            for i, (name, belief) in enumerate(
                zip(self.names, self.beliefs, strict=True)
            )
        }

    def scene_at(self, z: Float[Array, " free"]) -> Scene:
        """Return the scene with the numbers at $z$."""
        return with_values(self.scene, self.values(z))

    def log_prior(self, z: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the prior density per unit of $z$."""
        # priors are independent of one another
        terms = [belief.log_density(z[i]) for i, belief in enumerate(self.beliefs)]
        return sum(terms, start=jnp.zeros((), z.dtype))

    def has_prior(self) -> Float[Array, " free"]:
        """Return 1 where a number has a distribution, 0 where it is free."""
        return jnp.array([0.0 if isinstance(b, Free) else 1.0 for b in self.beliefs])

    def space(self) -> tuple[str, ...]:
        """Return "ln" or "linear" for each number: the space of its errors."""
        return tuple(
            "ln" if parameter_named(n).positive else "linear" for n in self.names
        )


def parameters_of(uncertain: UncertainScene) -> Parameters:
    """Collect the uncertain numbers of a scene."""
    return Parameters(
        names=tuple(uncertain.beliefs),
        beliefs=tuple(uncertain.beliefs.values()),
        scene=uncertain.scene,
    )


def as_seen(
    uncertain: UncertainScene,
    quantity: Sequence[str],
    time: Float[np.ndarray, " row"],
) -> UncertainScene:
    """Return the scene for a log with fireball radii; without radii, unchanged.

    The growth time is free unless the scene states otherwise: no source gives it to
    better than a factor of two. It starts at a third of the time the radii span.

    The travel time of light is neglected if radii are measured in images. Their times
    have no delay either, so the origin time is that of the light at the camera, 3 us
    late per kilometre. A delay of the flash alone would act as a measurement of the
    range: readings with errors of a millisecond would place the charge 100 km away.

    Args:
        uncertain: The scene.
        quantity: Quantity of each row of the log.
        time: Time of each row on its clock [s]; NaN without one.
    """
    radii = time[np.isin(quantity, FIREBALL_RADII)]
    if radii.size == 0:
        return uncertain
    scene = replace(uncertain.scene, instant_light=bool(set(BY_CAMERA) & set(quantity)))
    beliefs = dict(uncertain.beliefs)
    # None: neither fixed nor with a prior, which would put its start into the scene
    if scene.fireball_growth is None:
        # a film usually covers the growth a few times; a single radius has no span
        start = np.ptp(radii) / 3 or own_growth(scene)
        scene = with_values(scene, {GROWTH: start})
        beliefs[GROWTH] = Free(positive=True)
    return replace(uncertain, scene=scene, beliefs=beliefs)


def own_growth(scene: Scene) -> float:
    """Return the growth time by the law for the first charge of a scene [s]."""
    return float(fireball_growth_time(scene.charge.tnt_mass("fireball_radius_m")))


@dataclass(frozen=True)
class Spread:
    """Standard deviations of a number; NaN where it is not identified.

    Attributes:
        sd: Standard deviation, in the number's unit.
        log_sd: Standard deviation of its ln; NaN for one that may be negative.
    """

    sd: float = math.nan
    log_sd: float = math.nan

    @property
    def is_known(self) -> bool:
        """True if one of the standard deviations is finite."""
        return not (math.isnan(self.sd) and math.isnan(self.log_sd))

    @property
    def width(self) -> float:
        """The sd in ln, or without one the sd; infinite without either."""
        if not math.isnan(self.log_sd):
            return self.log_sd
        return math.inf if math.isnan(self.sd) else self.sd


@dataclass(frozen=True)
class Estimate:
    """Estimate of one number, in its unit.

    A number that is not identified has no value and no standard deviation. The bounds
    of its 90 % interval are finite where they are known.

    Attributes:
        value: The most probable value; NaN where it is not identified.
        sd: Standard deviation.
        log_sd: Standard deviation of its ln; NaN for one that may be negative.
        q05: 5 % quantile: lower bound of the 90 % interval.
        q50: Median.
        q95: 95 % quantile: upper bound of the 90 % interval.
        identified: True if there is a value.
    """

    value: float = math.nan
    sd: float = math.nan
    log_sd: float = math.nan
    q05: float = math.nan
    q50: float = math.nan
    q95: float = math.nan
    identified: bool = field(init=False)

    def __post_init__(self) -> None:
        """Set `identified` from the value."""
        # a frozen dataclass sets its derived fields this way
        object.__setattr__(self, "identified", math.isfinite(self.value))

    def interval_alone(self) -> "Estimate":
        """Return the 90 % interval without a value: an unidentified number."""
        return Estimate(q05=self.q05, q95=self.q95)

    @property
    def spread(self) -> Spread:
        """Its standard deviations alone."""
        return Spread(self.sd, self.log_sd)

    def times(self, factor: float) -> "Estimate":
        """Return the estimate of a multiple of the number; its sd in ln is the same."""
        return Estimate(
            self.value * factor,
            self.sd * factor,
            self.log_sd,
            self.q05 * factor,
            self.q50 * factor,
            self.q95 * factor,
        )
