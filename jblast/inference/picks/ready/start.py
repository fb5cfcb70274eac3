"""Where a fit begins: the best of a bank of pulses about the front.

Each member is a pulse of unit peak with the suction of the priors' middle, less the
line that fits it best over its own stretch; so one product of a matrix with the record
gives, for each, the peak and by how much it lowers the sum of squares.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.unknowns import CENTRE

SHORTEST = 3.0
"""Duration of the shortest member [samples]."""

STEP = 1.3
"""From one duration to the next."""

DECAYS = (0.3, 2.5)
RISES = (0.0, 0.25)
"""Shares of the duration."""

CONTINUED_DECAYS = (0.2, 0.5, 1.2, 3.0)
"""Of members that continue below zero: the smaller, the more of them is there."""

BEFORE, BEHIND = 1.5, 4.0
"""How far a member reaches, in durations."""


class Bank(NamedTuple):
    """Pulses to begin with.

    Attributes:
        duration: Of each [samples].
        decay: Of each.
        rise: Of each [samples].
        continued: 1 of those whose decay continues below zero, 0 of the others.
        filters: Times the record's means over bins: the peak of each.
        energy: By peak squared: how much it lowers the weighted sum of squares.
    """

    duration: Float[np.ndarray, " member"]
    decay: Float[np.ndarray, " member"]
    rise: Float[np.ndarray, " member"]
    continued: Float[np.ndarray, " member"]
    filters: Float[np.ndarray, "member bin"]
    energy: Float[np.ndarray, " member"]


def bank_of(bins: Bins, samples: int) -> Bank:
    """Return pulses of all durations that a record may hold.

    Args:
        bins: Where they are looked at.
        samples: Of the record.
    """
    count = int(np.ceil(np.log(max(samples, 8) / SHORTEST) / np.log(STEP)))
    durations = SHORTEST * STEP ** np.arange(count)
    members = [(d, b, r * d, 0.0) for d in durations for b in DECAYS for r in RISES]
    members += [(d, b, 0.0, 1.0) for d in durations for b in CONTINUED_DECAYS]
    x, weight = bins.middle.astype(float), bins.width.astype(float)
    filters, energy = [], []
    for duration, decay, rise, continued in members:
        shape = _shape(x, duration, decay, rise, continued=continued > 0)
        inside = (x > -max(BEFORE * duration, 16.0)) & (x < BEHIND * duration)
        w = weight * inside
        basis = np.stack([np.ones_like(x), x / duration])
        line = np.linalg.solve((basis * w) @ basis.T, (basis * w) @ shape)
        left = shape - line @ basis
        size = float(np.sum(w * left * left))
        filters.append(w * left / size)
        energy.append(size)
    columns = np.array(members).T
    duration, decay, rise, continued = columns
    return Bank(duration, decay, rise, continued, np.array(filters), np.array(energy))


def start_of(
    bank: Bank,
    means: Float[Array, " bin"],
    longest: Float[ArrayLike, ""] = np.inf,
    *,
    continued: bool = False,
) -> tuple[Float[Array, " unknown"], Float[Array, ""]]:
    """Return the unknowns to begin with, and the duration [samples].

    Args:
        bank: Pulses.
        means: Of the record over the bins, as shares of its largest sample.
        longest: Members may be so long [samples]; the shortest may always be.
        continued: Whether to begin with a pulse that continues below zero.
    """
    kind = means.dtype
    peak = jnp.asarray(bank.filters, kind) @ means
    lowered = jnp.square(jnp.maximum(peak, 0.0)) * jnp.asarray(bank.energy, kind)
    short = jnp.asarray(bank.duration, kind) <= jnp.maximum(longest, SHORTEST)
    some = short & (bank.continued == float(continued))
    best = jnp.argmax(jnp.where(some, lowered, -1.0))
    duration = jnp.asarray(bank.duration, kind)[best]
    rise = jnp.asarray(bank.rise, kind)[best]
    y = jnp.asarray(CENTRE, kind)
    y = y.at[0].set(-0.5 - 0.5 * rise)
    y = y.at[1].set(jnp.log(jnp.maximum(peak[best], 0.05)))
    y = y.at[2].set(jnp.log(duration))
    y = y.at[3].set(jnp.log1p(jnp.asarray(bank.decay, kind)[best]))
    return y.at[4].set(jnp.log(jnp.maximum(rise, 1.0))), duration


def _shape(x, duration, decay, rise, *, continued):
    """Return a pulse of unit peak, its rise a line about zero, with suction."""
    middle = x + 0.5 + 0.5 * rise
    up = np.clip((x + 0.5) / max(rise, 1e-9) + 0.5, 0.0, 1.0)
    s = middle / duration
    last = np.inf if continued else 1.0
    inside = np.clip(s, 0.0, last)
    shape = (1.0 - inside) * np.exp(-decay * inside)
    depth, length = CENTRE[5], np.exp(CENTRE[6])
    q = 1.0 if continued else np.clip((s - 1.0) / length, 0.0, 1.0)
    return np.where(s >= 0, up * shape - 6.75 * depth * q * (1.0 - q) ** 2, 0.0)
