"""The likelihood of a curve and its scatter, given the recordings.

The model stands in `ford_2021.py`, how effects are integrated out in
`random_effects.py`. A bend b5 ln^2(Z/100) may be added to the curve of
`jblast/waves/laws/ford_2021.py`, to be compared; the package has none.
"""

import itertools
from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from calibration.ford_records import read_records
from calibration.random_effects import Marginal, marginal
from jblast.waves.laws.ford_2021 import log_curve, log_scaled_place
from jblast.waves.scaling import sachs_impulse_factor, sachs_time_factor

COEFFICIENTS = ("b1", "b2", "b3", "b4", "b5")
SCATTERS = ("site", "shot", "burial", "path", "record")
NAMES = COEFFICIENTS + SCATTERS
GUARDED = ("site", "shot")
EXPECTED_SD = 0.1
"""Mode of the prior on the guarded scatter [ln]: weather, wind and terrain."""

BEND_ABOUT = 100.0
"""Scaled range about which a bent curve bends [m/kg^(1/3)]: the middle one."""


class Form(NamedTuple):
    """What is held at a value instead of fitted, and how records err."""

    fixed: tuple[tuple[str, float], ...] = ()
    nu: float = 4.0


@cache
def objective(quantity: str, form: Form, restricted: bool):
    """Return minus the log-likelihood, the marginal and the gradient, compiled.

    It takes the values of `NAMES` and the weights of the records. Restricted
    likelihoods integrate the free coefficients too, from those values on.
    """
    records = read_records()
    place = log_scaled_place(
        records.slant_range,
        records.charge_mass,
        records.height_of_burst,
        records.ambient_pressure,
    )
    factor = (sachs_impulse_factor if "impulse" in quantity else sachs_time_factor)(
        records.charge_mass, records.ambient_pressure, records.sound_speed
    )
    value = jnp.log(records.value[quantity]) - jnp.log(factor)
    depth = jnp.maximum(-place[1], 0.0)
    bend = (place[0] - np.log(BEND_ABOUT)) ** 2
    site, shot, path = (
        np.unique(names, return_inverse=True)[1]
        for names in (records.site, records.shot, records.path)
    )
    held, n = dict(form.fixed), len(COEFFICIENTS)
    guarded = np.array([NAMES.index(name) for name in GUARDED if name not in held], int)
    sizes = [int(index.max()) + 1 for index in (site, shot, path)]
    inner = np.array(
        [i for i, name in enumerate(COEFFICIENTS) if restricted and name not in held],
        int,
    )

    def integrate(theta: jax.Array, weight: jax.Array) -> Marginal:
        def predict(theta: jax.Array, x: jax.Array) -> jax.Array:
            site_sd, shot_sd, burial_sd, path_sd, _ = theta[n:]
            spread = jnp.sqrt(shot_sd**2 + (burial_sd * depth) ** 2)
            coefficients = theta[:n].at[inner].set(x[: len(inner)])
            ends = np.cumsum([len(inner), *sizes])
            of_site, of_shot, of_path = (x[a:b] for a, b in itertools.pairwise(ends))
            shared = site_sd * of_site[site] + spread * of_shot[shot]
            curve = log_curve(coefficients[:4], *place) + coefficients[4] * bend
            return curve + shared + path_sd * of_path[path]

        start = jnp.concatenate([theta[inner], jnp.zeros(sum(sizes))])
        precision = jnp.concatenate([jnp.zeros(len(inner)), jnp.ones(sum(sizes))])
        return marginal(predict, theta, precision, start, value, weight, form.nu)

    def cost(theta: jax.Array, weight: jax.Array) -> tuple[jax.Array, Marginal]:
        integral = integrate(theta, weight)
        sds = theta[guarded]
        log_prior = jnp.sum(jnp.log(sds) - sds / EXPECTED_SD) if restricted else 0.0
        return -integral.log_likelihood - log_prior, integral

    return jax.jit(jax.value_and_grad(cost, has_aux=True))
