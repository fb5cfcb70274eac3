"""Fit to each sample's readings: error, interval, and coverage of the truth.

The readings are the records that the scene's sensors specify, with the standard errors
specified there. The truth is the sampled value, or that of an axis. The fit uses the
priors of the scene's own file: with `mass_kg = "free"` in the scene and an axis over
the mass, the study measures how well an unknown mass is estimated.

Logs are fitted in blocks of a fixed size, each on one device, so a fit does not depend
on the number of logs.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jblast.errors import nearest, require
from jblast.inference.many.fit_many import fit_many
from jblast.inference.many.lanes import ManyFits
from jblast.scene import UncertainScene, freed, parameter_named
from jblast.scene.uncertain import Prior, names_in, value_of, with_values
from jblast.sensors import planned_layout, record, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import STUDENT_FREEDOM, observe, student_errors
from jblast.study.outcome.family import (
    YES_NO,
    Answers,
    Prepared,
    Setting,
    family,
    yes_no,
)

DEFAULT = "charge_mass_kg"
OPTIONS = {
    "fit_number": f"parameter of the outcomes (default: {DEFAULT})",
    "fit_free": "parameters without a prior in the fit, in place of the scene's priors",
    "fit_tries": "starts of a fit with a large misfit (default: 4)",
}
READINGS, TRUTH, EXACT = "_readings", "_truth", "_exact"
"""Results of a block for the fit, which are no columns of the store."""
BOUND = "fit_bound_width"
AGAIN_Z = 3.0
"""Standard deviations by which the cost of a fit exceeds its mean before it starts
again.

With Student-t errors some logs have two optima. Of 384 logs of a charge of 100 kg with
sensors in a line, one fit ended in the worse one (1/8 of the mass), at 4.6.
"""
HALF_WIDTH = 1.6448536269514722
"""Half width of a 90 % interval of a normal distribution [standard deviations]."""


@family(
    "fit",
    3,
    {
        "fit_value": ("1", "fitted number, in its own unit"),
        "fit_error": ("1", "fit minus truth; for a positive number ln of their ratio"),
        "fit_interval_width": ("1", "width of the 90 % interval, in the same unit"),
        BOUND: ("1", "the same by the Cramer-Rao bound, at readings without error"),
        "fit_truth_inside": (YES_NO, "whether the 90 % interval contains the truth"),
        "fit_converged": (
            YES_NO,
            "whether the fit converged; if not, the other outcomes have no answer",
        ),
    },
    needs="[[sensor]] with records",
    block=1 << 14,
    # a GPU fits so many at 7e6 a second, a quarter of them at half this rate
    together=1 << 21,
    options=OPTIONS,
)
def prepare(setting: Setting) -> Prepared:
    """Return the prepared fits of a scene.

    Raises:
        InputError: The parameter is not fitted, or there are no readings.
    """
    options = setting.options
    number = str(options.get("fit_number", DEFAULT))
    believed = _believed(setting, number)
    layout, sigma, _ = planned_layout(setting.uncertain.scene)
    scene = setting.uncertain.scene
    laws = law_names(resolve_laws(scene, layout, np.asarray(sigma)))
    tries = options.get("fit_tries", 4)
    whole = type(tries) is int and tries > 0
    require(whole, "[options] fit_tries", "a whole number from 1", repr(tries))

    with_bound = BOUND in setting.names
    sigmas = np.asarray(sigma)

    def one(key, numbers) -> Answers:
        true = with_values(scene, numbers)
        truth = numbers.get(number)
        if truth is None:
            truth = value_of(scene, number)
        # computed for the bound only: a second fit of each sample
        exact = record(true, layout, laws).value if with_bound else jnp.zeros(0)
        key, of_rows = jax.random.split(key)
        own = student_errors(of_rows, STUDENT_FREEDOM, sigma.size)
        return {
            EXACT: exact,
            READINGS: observe(key, true, layout, laws, sigma, own=own),
            TRUTH: jnp.asarray(truth),
        }

    def finish(answers: Mapping[str, Array | np.ndarray]) -> Answers:
        found = _fit(answers[READINGS], tries)
        answered = dict(compared(*_marginal(found), found.bad, answers[TRUTH]))
        if with_bound:
            # the Fisher information at readings without error
            answered[BOUND] = width(*_marginal(_fit(answers[EXACT], 4)))
        return answered

    def _fit(readings: Array | np.ndarray, tries: int) -> ManyFits:
        return fit_many(
            believed,
            layout,
            readings,
            sigmas,
            laws,
            tries=tries,
            devices=1,
            again_z=AGAIN_Z,
        )

    def _marginal(found: ManyFits) -> tuple[Array, Array, Array]:
        at = found.names.index(number)
        return found.z[:, at], found.covariance[:, at, at], found.converged

    belief: Prior = believed.beliefs[number]  # type: ignore  or free, which has the same
    positive = parameter_named(number).positive
    # compiled once for a scene, as `finish` runs from Python block by block
    compared = jax.jit(functools.partial(_compared, belief.constrain, positive))
    width = jax.jit(functools.partial(_width, belief.constrain, positive))
    used = ", ".join(f"{quantity} by {law}" for quantity, law in laws.items())
    free = ", ".join(believed.beliefs)
    return Prepared(jax.vmap(one), finish, notes=(f"fits of {free} to {used}",))


def _believed(setting: Setting, number: str) -> UncertainScene:
    """Return the scene with the priors of the fit."""
    free = setting.options.get("fit_free", [])
    names = isinstance(free, list) and all(isinstance(name, str) for name in free)
    require(names, "[options] fit_free", "a list of names", repr(free))
    believed = freed(setting.believed, free) if free else setting.believed
    known = names_in(believed.scene)
    hint = "" if number in known else nearest(number, known)
    words = f"a fitted parameter, one of {', '.join(believed.beliefs) or '(none)'}"
    fitted = number in believed.beliefs
    require(fitted, "[options] fit_number", words, f"{number}{hint}")
    scene = replace(believed.scene, law=setting.uncertain.scene.law)
    return replace(believed, scene=scene)


Constrain = Callable[[Array], Array]


def _interval(
    constrain: Constrain, positive: bool, z: Array, variance: Array
) -> tuple[Array, Array, Array]:
    """Return middle and bounds of 90 % intervals; ln of them for a positive number."""
    sd = jnp.sqrt(variance)
    parts = (constrain(z + n * HALF_WIDTH * sd) for n in (0.0, -1.0, 1.0))
    middle, low, high = (_scaled(positive, x) for x in parts)
    return middle, low, high


def _scaled(positive: bool, x: Array) -> Array:
    return jnp.log(jnp.where(x > 0, x, jnp.nan)) if positive else x


def _width(
    constrain: Constrain, positive: bool, z: Array, variance: Array, converged: Array
) -> Array:
    """Return the widths of intervals; NaN for a fit that did not converge."""
    _, low, high = _interval(constrain, positive, z, variance)
    return jnp.where(converged & jnp.isfinite(high - low), high - low, jnp.nan)


def _compared(
    constrain: Constrain,
    positive: bool,
    z: Array,
    variance: Array,
    converged: Array,
    bad: Array,
    truth: Array,
) -> dict[str, Array]:
    """Return the outcomes of fits; errors of a positive number are in ln."""
    middle, low, high = _interval(constrain, positive, z, variance)
    # a fit without a finite interval has no answer
    good, true = converged & jnp.isfinite(high - low), _scaled(positive, truth)
    inside = (low <= true) & (true <= high)
    return {
        "fit_value": jnp.where(good, constrain(z), jnp.nan),
        "fit_error": jnp.where(good, middle - true, jnp.nan),
        "fit_interval_width": jnp.where(good, high - low, jnp.nan),
        "fit_truth_inside": yes_no(inside, good),
        "fit_converged": yes_no(converged, ~bad),
    }
