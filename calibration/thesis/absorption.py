"""Absorption of sound in the thesis; importing it registers no law."""

import math

from jblast.waves.arguments import Number
from jblast.waves.tables import Numbers


def stokes_absorption(
    frequency: Number, air_density: Number, sound_speed: Number, temperature: Number
) -> Numbers:
    r"""Return the absorption by shear viscosity alone [Np/m].

    $$\alpha = \frac{2\,\eta\,\omega^2}{3\,\rho_0 c_0^3}, \qquad
      \eta = 2.791\times10^{-7}\,T^{0.7355}\ \mathrm{Pa\,s}$$

    One or two orders of magnitude too low at audible frequencies.

    Args:
        frequency: $f = \omega/2\pi$ [Hz], positive.
        air_density: $\rho_0$ [kg/m3].
        sound_speed: $c_0$ [m/s].
        temperature: $T$ [K].

    References:
        Parab's thesis, eq. 3.1; its viscosity is read from the public plugin.
    """
    viscosity = 2.791e-7 * temperature**0.7355
    omega = 2.0 * math.pi * frequency
    return 2.0 / 3.0 * viscosity * omega**2 / (air_density * sound_speed**3)
