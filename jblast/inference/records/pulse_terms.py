r"""How far a record's samples are from a pulse that laws ask for.

Asked for are arrival, ln peak, ln duration and ln impulse, each as moved from the pick;
the decay follows from them: $k = (i/P - \tau/2)/(t_d - \tau)$ is the impulse behind the
rise over peak and duration. The rest of the pick's unknowns are nuisances.
"""

from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.inference.picks.fit.model import misfit
from jblast.inference.picks.ready.bins import bins_about_front
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.unknowns import natural_of
from jblast.waves.pulse import LEVEL
from jblast.waves.waveform import decay_of_fraction

ASKED = 4
"""Of a pick's unknowns the first; the last of them, the decay, is by the impulse."""
LEAST_FRACTION = 1e-4
"""Of the fractions that a pulse can have, one at either end is never reached."""

RISES = (1.0, 2.0, 4.0), (0.05, 0.15, 0.4)
"""Rises that searches may begin with [samples]: of fronts that samples resolve, and of
those that rise within one."""


class SampledCase(NamedTuple):
    """A record for the terms; times in samples, pressures in shares of the largest.

    Attributes:
        ready: Its samples, ready for a pick.
        unknowns: Of the pick.
        rate: Samples a second [Hz].
        rise: Middle and standard deviation of what is believed of ln of the rise.
        widened: Standard deviations of the noise are as many times those before the
            front: what the pulse leaves of the record says so.
    """

    ready: Case
    unknowns: Float[Array, " unknown"]
    rate: Float[Array, ""]
    rise: Float[Array, "2"]
    widened: Float[Array, ""]


@dataclass(frozen=True)
class PulseTerms:
    """Terms of which half the square is minus ln of the probability of samples.

    Attributes:
        samples: That a record is filled up to.
    """

    samples: int

    def __call__(
        self,
        moved: Float[Array, " asked"],
        nuisance: Float[Array, " nuisance"],
        case: SampledCase,
    ) -> Float[Array, " term"]:
        """Return what is left of the samples, then how unlikely nuisances are.

        Args:
            moved: Arrival [s], ln peak, ln duration and ln impulse, less the pick's.
            nuisance: The other unknowns.
            case: The record.
        """
        bins = bins_about_front(self.samples)
        apart = misfit(bins, unknowns_at(moved, nuisance, case), case.ready)
        last = bins.first.size
        believed = (
            apart[last + ASKED :].at[0].set((nuisance[0] - case.rise[0]) / case.rise[1])
        )
        return jnp.concatenate([apart[:last] / case.widened, believed])


def unknowns_at(
    moved: Float[Array, " asked"],
    nuisance: Float[Array, " nuisance"],
    case: SampledCase,
) -> Float[Array, " unknown"]:
    """Return the unknowns of a pulse moved from the pick; see `PulseTerms`."""
    arrival = case.unknowns[0] + moved[0] * case.rate
    picked = natural_of(case.unknowns)
    blank = jnp.zeros(1, nuisance.dtype)
    most = jnp.stack(
        [arrival, case.unknowns[1] + moved[1], case.unknowns[2] + moved[2]]
    )
    pulse = natural_of(jnp.concatenate([most, blank, nuisance]))
    impulse = picked.impulse * jnp.exp(moved[3])
    behind = impulse / pulse.peak - 0.5 * pulse.rise
    fraction = behind / (pulse.duration - pulse.rise)
    fraction = jnp.clip(fraction, LEAST_FRACTION, LEVEL - LEAST_FRACTION)
    decay = jnp.log1p(decay_of_fraction(fraction))
    return jnp.concatenate([most, decay[None], nuisance])


def trial_nuisances(
    moved: Float[Array, " asked"],
    nuisance: Float[Array, " nuisance"],
    case: SampledCase,
) -> Float[Array, "search trial nuisance"]:
    """Return nuisances to begin searches with: of some rises, all else as picked.

    Samples tell where the middle of a front is, so one that arrives later rises faster:
    beside `RISES`, and the pick's in the first search, stands the one that keeps it.

    Args:
        moved: As of `PulseTerms`.
        nuisance: The pick's.
        case: The record.
    """
    picked = jnp.exp(nuisance[0])
    kept = picked - 2.0 * moved[0] * case.rate
    slow, sharp = (jnp.asarray(rises, picked.dtype) for rises in RISES)
    first = jnp.stack([picked, jnp.maximum(kept, slow[0]), *slow])
    within = jnp.clip(kept, sharp[0], sharp[-1])
    second = jnp.stack([jnp.minimum(picked, sharp[-1]), within, *sharp])
    rises = jnp.log(jnp.stack([first, second]))
    return jnp.tile(nuisance, (*rises.shape, 1)).at[:, :, 0].set(rises)
