"""What the reader of an ensemble's answer has to be told."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jblast.inference.mcmc.convergence import ALIKE, LONG_ENOUGH, Convergence
from jblast.inference.mcmc.modes import Mode, Ridge
from jblast.inference.posterior.parameters import Parameters


def doubts(judged: Convergence, names: Sequence[str], precision: float) -> list[str]:
    """Say in what a walk falls short of what was wanted."""
    told = []
    worst = int(np.argmax(judged.error))
    if not judged.error[worst] <= precision:
        told.append(
            f"the quantiles of {names[worst]} are known to {judged.error[worst]:.2g} "
            f"of its standard deviation, wanted {precision:g}"
        )
    worst = int(np.argmax(judged.tau))
    if not judged.steps >= LONG_ENOUGH * judged.tau[worst]:
        told.append(
            f"{judged.steps} steps are {judged.steps / judged.tau[worst]:.0f} "
            f"autocorrelation times of {names[worst]}, wanted {LONG_ENOUGH:.0f}"
        )
    worst = int(np.argmax(judged.r_hat))
    if not judged.r_hat[worst] < ALIKE:
        told.append(
            f"R-hat of {names[worst]} is {judged.r_hat[worst]:.3g}, wanted {ALIKE:g}"
        )
    return told


def about_modes(modes: Sequence[Mode], parameters: Parameters) -> list[str]:
    """Name the modes by the numbers in which they differ."""
    if len(modes) < 2:
        return []
    first = modes[0]
    differ = np.zeros(len(parameters.names), bool)
    for mode in modes[1:]:  # in what the 90 % intervals do not meet
        differ |= (mode.low > first.high) | (mode.high < first.low)
    if not differ.any():
        differ[:] = True
    places = _values(parameters, np.array([mode.peak for mode in modes]), differ)
    parts = [
        f"{100 * mode.share:.0f} % about {place}"
        for mode, place in zip(modes, places, strict=True)
    ]
    return [f"the posterior has {len(modes)} modes: {'; '.join(parts)}"]


def about_ridge(ridge: Ridge | None, parameters: Parameters) -> list[str]:
    """Name the ends of a ridge."""
    if ridge is None:
        return []
    values = parameters.values_of_each(jnp.asarray(ridge.ends))
    differ = np.array(
        [
            abs(np.diff(np.asarray(values[name]))[0])
            > 0.01 * np.abs(np.asarray(values[name])).max()
            for name in parameters.names
        ]
    )
    if not differ.any():
        differ[:] = True
    low, high = _values(parameters, ridge.ends, differ)
    text = (
        f"the posterior is a ridge {ridge.longer:.0f} times as long as its normal "
        f"approximation, from {low} to {high}"
    )
    if ridge.endless:
        text += (
            "; the density does not fall beyond it, so the posterior is improper: "
            "expected a prior for one of these"
        )
    return [text]


def _values(parameters: Parameters, z, which) -> list[str]:
    values = parameters.values_of_each(jnp.asarray(z))
    return [
        ", ".join(
            f"{name} {float(values[name][i]):.4g}"
            for name, told in zip(parameters.names, which, strict=True)
            if told
        )
        for i in range(len(z))
    ]
