r"""Loss of level on the way through still, even air: spreading and absorption.

One frequency of linear sound. Wind and temperature gradients, which bend rays, soft
ground and barriers are not in it, nor is the steepening that feeds the high frequencies
of a strong blast.
"""

from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.propagation.absorption import DECIBELS_PER_NEPER, iso_9613_absorption
from jblast.waves.propagation.spreading import (
    hemispherical_spreading_loss,
    spherical_spreading_loss,
)


@checked
def transmission_loss(
    frequency: Float[ArrayLike, "..."],
    slant_range: Float[ArrayLike, "..."],
    reference_range: Float[ArrayLike, "..."],
    temperature: Float[ArrayLike, "..."],
    pressure: Float[ArrayLike, "..."],
    relative_humidity: Float[ArrayLike, "..."],
    burst: str = "surface",
) -> Float[Array, "..."]:
    r"""Return how far the level lies below the one at $R_0$ in free air [dB].

    $$L = 20 \lg (R/R_0) + 8.6859\,\alpha\,(R - R_0) \;[\, -\, 10 \lg 2\,]$$

    with $\alpha$ of ISO 9613-1 and the last term on the surface: the reference is the
    same source in free air for both bursts (see `spreading.py`).

    Args:
        frequency: $f$ [Hz], positive; $\alpha$ is good to 10 % from 50 Hz to 10 kHz.
        slant_range: Range $R$ [m], positive.
        reference_range: Range $R_0$ where the level in free air is known [m].
        temperature: $T$ [K].
        pressure: $P$ [Pa].
        relative_humidity: Fraction, 0 to 1.
        burst: "surface" (hemispherical) or "free-air" (spherical).

    References:
        ISO 9613-1:1993 for the absorption; conservation of energy.
    """
    slant_range, reference_range = as_float_arrays(slant_range, reference_range)
    spreading = (
        hemispherical_spreading_loss if burst == "surface" else spherical_spreading_loss
    )(slant_range, reference_range)
    absorption = iso_9613_absorption(
        frequency, temperature, pressure, relative_humidity
    )
    return spreading + DECIBELS_PER_NEPER * absorption * (slant_range - reference_range)
