"""What a fit makes of each sample's readings: error, interval, truth inside or not.

The readings are those the sensors of the scene say that they record, with the errors
they say. The truth is what the study draws, or its axes set; the fit goes by what the
scene's own file says of its numbers, so an axis over the mass beside `mass_kg = "free"`
in the scene asks how well a mass of which nothing is known is weighed.

Logs are fitted in blocks of a fixed size, each on one device, so a fit does not depend
on how many there are.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError, nearest
from jblast.inference.many.fit_many import fit_many
from jblast.scene import Scene, UncertainScene, freed, parameter_named
from jblast.scene.parameters import names_in, value_of, with_values
from jblast.scene.priors import Prior
from jblast.sensors import planned_layout, record, resolve_laws
from jblast.sensors.bursts import settled
from jblast.sensors.law_choice import law_names
from jblast.sensors.observe import observe
from jblast.study.outcome.family import (
    Answers,
    Family,
    Outcome,
    Prepared,
    Setting,
    register,
    register_family,
)

DEFAULT = "charge_mass_kg"
OPTIONS = {
    "fit_number": f"number of the scene that is asked about (default: {DEFAULT})",
    "fit_free": "numbers that the fit frees, whatever the scene says of them",
    "fit_tries": "how often a doubtful fit starts again (default: 4)",
}
READINGS, TRUTH, EXACT = "_readings", "_truth", "_exact"
"""What blocks hand to the fit; no columns of the store."""
BOUND = "fit_bound_width"
HALF_WIDTH = 1.6448536269514722
"""Standard deviations from the middle to an end of a 90 % interval."""


def prepare(setting: Setting) -> Prepared:
    """Make fits ready for a scene.

    Raises:
        InputError: There is nothing to fit, or no reading to fit it to.
    """
    options = setting.options
    number = str(options.get("fit_number", DEFAULT))
    believed = _believed(setting, number)
    layout, sigma, _ = planned_layout(setting.uncertain.scene)
    scene, layout = settled(setting.uncertain.scene, layout)
    laws = law_names(resolve_laws(scene, layout, np.asarray(sigma)))
    tries = options.get("fit_tries", 4)
    if isinstance(tries, bool) or not isinstance(tries, int) or tries < 1:
        raise InputError(
            f"[options] fit_tries: expected a whole number from 1, got {tries!r}"
        )

    wanted = BOUND in setting.names

    def one(key, numbers) -> Answers:
        true = with_values(scene, numbers)
        truth = numbers.get(number)
        if truth is None:
            truth = _told(scene, number)
        exact = record(true, layout, laws).value if wanted else jnp.zeros(0)
        return {
            EXACT: exact,
            READINGS: observe(key, true, layout, laws, sigma),
            TRUTH: jnp.asarray(truth),
        }

    def host(answers: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        found = fit_many(
            believed,
            layout,
            answers[READINGS],
            np.asarray(sigma),
            laws,
            tries=tries,
            devices=1,
        )
        at = found.names.index(number)
        z, sd = np.asarray(found.z[:, at]), np.asarray(found.sd()[:, at])
        ends = [z, z - HALF_WIDTH * sd, z + HALF_WIDTH * sd]
        belief: Prior = believed.beliefs[number]  # pyright: ignore[reportAssignmentType]  or free, which has the same
        middle, low, high = (np.asarray(belief.constrain(jnp.asarray(e))) for e in ends)
        good = np.asarray(found.converged) & np.isfinite(high - low)
        told = _compared(number, answers[TRUTH], middle, low, high, good, found)
        if wanted:
            told[BOUND] = _bound(answers)
        return told

    def _bound(answers: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the width by Fisher information at readings without error."""
        found = fit_many(
            believed, layout, answers[EXACT], np.asarray(sigma), laws, devices=1
        )
        at = found.names.index(number)
        z, sd = found.z[:, at], found.sd()[:, at]
        belief: Prior = believed.beliefs[number]  # pyright: ignore[reportAssignmentType]  likewise
        ends = [
            np.asarray(belief.constrain(z + sign * HALF_WIDTH * sd)) for sign in (1, -1)
        ]
        if parameter_named(number).positive:
            ends = [np.log(end) for end in ends]
        good = np.asarray(found.converged) & np.isfinite(ends[0] - ends[1])
        return np.where(good, ends[0] - ends[1], np.nan)

    used = ", ".join(f"{quantity} by {law}" for quantity, law in laws.items())
    free = ", ".join(believed.beliefs)
    return Prepared(jax.vmap(one), host, notes=(f"fits of {free} to {used}",))


def _believed(setting: Setting, number: str) -> UncertainScene:
    """Return what the fit goes by."""
    free = setting.options.get("fit_free", [])
    if not isinstance(free, list) or not all(isinstance(name, str) for name in free):
        raise InputError(f"[options] fit_free: expected a list of names, got {free!r}")
    believed = freed(setting.believed, free) if free else setting.believed
    if number not in believed.beliefs:
        known = names_in(believed.scene)
        hint = "" if number in known else nearest(number, known)
        raise InputError(
            f"[options] fit_number: expected a number that the fit does not know, one "
            f"of {', '.join(believed.beliefs) or '(none)'}, got {number}{hint}"
        )
    scene = replace(believed.scene, law=setting.uncertain.scene.law)
    return replace(believed, scene=scene)


def _told(scene: Scene, number: str) -> Any:
    return value_of(scene, number)


def _compared(number, truth, middle, low, high, good, found) -> dict[str, np.ndarray]:
    """Return how far fits are off; of a positive number in ln."""
    positive = parameter_named(number).positive

    def scale(x: np.ndarray) -> np.ndarray:
        return np.log(np.where(x > 0, x, np.nan)) if positive else x

    inside = (low <= truth) & (truth <= high)
    converged = np.asarray(found.converged)
    return {
        "fit_value": np.where(good, middle, np.nan),
        "fit_error": np.where(good, scale(middle) - scale(truth), np.nan),
        "fit_interval_width": np.where(good, scale(high) - scale(low), np.nan),
        "fit_truth_inside": np.where(good, inside, -1).astype(np.int8),
        "fit_converged": np.where(np.asarray(found.bad), -1, converged).astype(np.int8),
    }


register_family(Family("fit", 3, prepare, block=2048, tile=1 << 16, options=OPTIONS))
for _name, _words, _yes in (
    ("fit_value", "fitted number, in its own unit", False),
    ("fit_error", "fit minus truth; of a positive number ln of their ratio", False),
    ("fit_interval_width", "of the fit's 90 % interval; likewise", False),
    (BOUND, "the same by the Cramer-Rao bound: of readings without error", False),
    ("fit_truth_inside", "whether the 90 % interval holds the truth", True),
    ("fit_converged", "whether the fit converged; else it has no other answer", True),
):
    register(
        Outcome(
            _name,
            "1",
            _words,
            "fit",
            kind="yes_no" if _yes else "number",
            needs="[[sensor]] with records",
        )
    )
