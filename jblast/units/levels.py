r"""Peak levels: decibels above 20 µPa.

$$L = 20 \log_{10}(p / p_0), \qquad p_0 = 20\,\mathrm{\mu Pa}$$

so $\ln p = \ln p_0 + L \ln 10 / 20$: the logarithm of the pressure is a straight line
in the level, and a symmetric error of $\sigma$ dB is, exactly and at any size, one of
$\sigma \ln 10 / 20$ in $\ln p$. That is how errors of pressures count in a fit (in ln,
as sigma/value), so the sigma of the pressure is $p\,\sigma \ln 10 / 20$: 1 dB is
11.5 %. In pascals such an error is lopsided (6 dB up is +100 %, 6 dB down -50 %), which
is why it is never taken to them as a symmetric one.

References:
    IEC 61672-1:2013, 3.2 (reference 20 µPa) and 3.3 (peak sound pressure level, of the
    largest magnitude of the pressure; here without frequency weighting, Z).
"""

import math

import numpy as np
from jaxtyping import Float

REFERENCE_PA = 20e-6
"""Pressure of a level of 0 dB [Pa]."""
LN_PER_DB = math.log(10.0) / 20.0
"""What a decibel is in the logarithm of a pressure."""


def overpressure(level_db: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the pressure of a peak level.

    Args:
        level_db: Peak level [dB re 20 µPa], of the waveform without weighting.

    Returns:
        Peak overpressure [Pa].
    """
    return REFERENCE_PA * 10.0 ** (level_db / 20.0)
