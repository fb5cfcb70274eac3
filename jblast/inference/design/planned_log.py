"""The noise-free log of a planned layout: the readings that the laws predict.

Uncertain numbers have the given values, or the medians of their priors. Sensors on a
vehicle are placed where it hovers at its set point, level: the tilt against a wind is
neglected.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, argument, nearest
from jblast.inference.density import density_of
from jblast.inference.design.plan import Planned
from jblast.inference.posterior.fisher_information import linearised, silent_posterior
from jblast.inference.posterior.parameters import (
    GROWTH,
    as_seen,
    own_growth,
    parameters_of,
)
from jblast.observations import resolve_positions
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import TIMED
from jblast.scene import (
    Free,
    Scene,
    UncertainScene,
    parameter_named,
    with_values,
)
from jblast.scene.uncertain import Belief, names_in, value_of
from jblast.sensors import planned_layout, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import Noise, written


class Centred(Belief):
    """A prior shifted so that its centre is the assumed value.

    A layout is judged by its average information. Prior and log then agree, and only
    the width of the prior has an effect.

    Attributes:
        belief: The prior.
        centre: Its coordinate at the assumed value.
    """

    belief: Belief
    centre: Float[Array, ""]

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        return self.belief.constrain(z + self.centre)

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        return self.belief.unconstrain(value) - self.centre

    def log_density(self, z):
        """Return ln of the prior density per unit of $z$, about the centre."""
        return self.belief.log_density(z)


def planned(
    uncertain: UncertainScene, at: Mapping[str, float], noise: Noise
) -> Planned:
    """Return the log that a scene's sensors would write without errors.

    Mounted sensors have their positions on the hovering vehicle.

    Args:
        uncertain: The scene; its sensors have the quantities that they record.
        at: Assumed values; the default is the median of the prior, and for a fireball's
            growth time the value of its law.
        noise: Distribution of the independent errors.

    Raises:
        InputError: Nothing is uncertain, a free number has no value, a value is out of
            bounds, or the sensors cannot record what they should.
    """
    stated = uncertain
    # as a fit of the planned log would use the scene
    sensors = stated.scene.sensors
    quantity = [q for one in sensors for q, _ in one.records for _ in one.times_s]
    times = [time for one in sensors for _ in one.records for time in one.times_s]
    uncertain = as_seen(stated, quantity, np.array(times))
    # a growth time that only the fit frees has the value of its law
    if GROWTH in set(uncertain.beliefs) - set(stated.beliefs) - set(at):
        likely = with_values(stated.scene, values_at(stated, at))
        at = {**at, GROWTH: own_growth(likely)}
    values = values_at(uncertain, at)
    beliefs = {
        name: belief
        if isinstance(belief, Free)
        else Centred(belief, belief.unconstrain(jnp.asarray(values[name])))
        for name, belief in uncertain.beliefs.items()
    }
    scene = hovering(with_values(uncertain.scene, values))
    drawn, sigma, of_sensor = planned_layout(scene)
    z = jnp.stack([b.unconstrain(jnp.asarray(values[n])) for n, b in beliefs.items()])
    parameters = parameters_of(UncertainScene(scene, beliefs))
    laws = resolve_laws(scene, drawn, np.asarray(sigma))
    posterior = silent_posterior(parameters, drawn, sigma, law_names(laws), noise)
    misfit, slopes = jax.tree.map(np.asarray, linearised(posterior, z))
    value = misfit.predicted
    source = uncertain.source or "the planned layout"
    log = written(scene, drawn, value, np.asarray(sigma), of_sensor)
    log = replace(log, source=source)
    # the position has an assumed value here, so a sensor must not be at it
    kept = [name for name in beliefs if name.partition(".")[0] not in CHARGE_POSITION]
    # an overflow for a charge at a huge distance is rejected below
    with np.errstate(over="ignore"):
        log = resolve_positions(log, scene, kept)
    finite = np.isfinite(np.column_stack([value, slopes])).all(axis=1)
    for row in np.flatnonzero(~finite):
        shown = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        raise InputError(
            f"{source}: sensor {log.sensor[row]!r}: {log.quantity[row]} is "
            f"{value[row]:g} with slopes {slopes[row]} at {shown}; expected values "
            "that allow a reading"
        )
    named = replace(scene, law=posterior.laws)
    density = density_of(log, UncertainScene(named, beliefs), noise)
    return Planned(values, np.asarray(z), posterior, misfit, slopes, density, laws, log)


def values_at(uncertain: UncertainScene, at: Mapping[str, float]) -> dict[str, float]:
    """Return the uncertain numbers of a scene: given values, or medians of priors.

    Raises:
        InputError: As in `planned`.
    """
    beliefs, source = uncertain.beliefs, uncertain.source or "scene"
    if not beliefs:
        raise InputError(
            f"{source}: nothing to bound: every number of the scene is fixed; expected "
            'at least one that is "free", has a prior, or is named by '
            + argument("freed")
        )
    for name in at:
        if name not in beliefs:
            fixed = name in names_in(uncertain.scene)
            what = "fixed" if fixed else "no number"
            raise InputError(
                f"{argument('at')} {name}: {name} is {what} in the scene; "
                f"expected one of {', '.join(beliefs)}{nearest(name, beliefs)}"
                + (f", or {argument('freed')} {name} beside it" if fixed else "")
            )
    at = {**_shown_by_clocks(uncertain), **at}
    open_ = [n for n, b in beliefs.items() if isinstance(b, Free) and n not in at]
    if open_:
        expected = " ".join(f"{argument('at')} {name}=VALUE" for name in open_)
        raise InputError(
            f"{source}: {', '.join(open_)}: free and without a prior, so expected "
            f"{expected}; the information of a layout depends on it"
        )
    return {
        name: _checked(name, float(at[name]), belief)
        if name in at
        else float(belief.constrain(jnp.zeros(())))
        for name, belief in beliefs.items()
    }


def _shown_by_clocks(uncertain: UncertainScene) -> dict[str, float]:
    """Return the free numbers that only shift clock times, with values of the scene.

    The information of a layout does not depend on them, unless a sensor has readings at
    given times of its clock.
    """
    scene = uncertain.scene
    taken = {q for sensor in scene.sensors for q, _ in sensor.records}
    if taken & set(TIMED):
        return {}
    return {
        name: float(0.0 if value is None else value)
        for name, belief in uncertain.beliefs.items()
        if isinstance(belief, Free)
        and name.partition(".")[0] in ("origin_time_s", CLOCK_OFFSET)
        for value in [value_of(scene, name)]
    }


def _checked(name: str, value: float, belief: Belief) -> float:
    """Return a number within its bounds and its prior.

    Raises:
        InputError: It is outside.
    """
    bounds, where = parameter_named(name).bounds, f"{argument('at')} {name}"
    bounds.checked(value, where)
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {value:g}")
    if not math.isfinite(float(belief.unconstrain(jnp.asarray(value)))):
        raise InputError(f"{where}: expected a number within its prior, got {value:g}")
    return value


def hovering(scene: Scene) -> Scene:
    """Return a scene with mounted sensors at their positions on the level vehicle.

    The tilt against a wind is neglected: it moves a sensor by a part of its offset.

    Args:
        scene: Scene whose mounted sensors have no position; unchanged without a
            vehicle.
    """
    if scene.vehicle is None:
        return scene
    vehicle = scene.vehicle
    cos, sin = math.cos(vehicle.yaw), math.sin(vehicle.yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    sensors = tuple(
        replace(one, position_m=vehicle.held + turn @ one.offset_m)
        if one.mount and not np.isfinite(np.asarray(one.position_m)).all()
        else one
        for one in scene.sensors
    )
    return replace(scene, sensors=sensors)
