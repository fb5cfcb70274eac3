r"""Sound level of a blast in the thesis: one file, played at every distance.

The sound is one recording for all charges, without a calibration in pascals. It is
absorbed by Stokes' law at 500 rad/s and has no spreading (Parab's thesis, eqs. 3.1 and
3.2), so that it is equally loud at all distances. The pulse that represents the file
here is declared: eq. 3.5 (Friedlander, b = 1), with the peak and the duration by
Kingery and Bulmash for the charge of table 4.1, 15 kg, at the nearest distance in the
thesis, 10 m.

`auto` never chooses these laws; a scene names them.
"""

import math
from typing import Any

from calibration.thesis.absorption import stokes_absorption
from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
)
from jblast.waves.laws.wu_hao import wu_hao_air_valid
from jblast.waves.tables import Numbers

# Charge of table 4.1, and the nearest distance in the worlds of the thesis; declared.
MASS, RANGE = 15.0, 10.0
"""Mass [kg] and distance [m] that the file represents."""
OMEGA, DENSITY, SOUND_SPEED, KELVIN = 500.0, 1.2, 340.0, 313.0
"""Constants of Stokes' law in the public plugin gazebo_blast3d (`e6dd04c`): frequency
[rad/s], density [kg/m3], sound speed [m/s] and temperature [K]."""
# Not zero, so that the logarithm of a law is finite.
SILENCE = 1e-12
"""Share of the peak that represents silence [-]."""


ALPHA = stokes_absorption(OMEGA / (2 * math.pi), DENSITY, SOUND_SPEED, KELVIN)
"""Absorption of the sound [Np/m]: 6.75e-8."""
PEAK = float(kingery_bulmash_pressure(RANGE, MASS))
DURATION = float(kingery_bulmash_duration(RANGE, MASS))


@checked
def thesis_sound_pressure(slant_range: Number) -> Numbers:
    r"""Return the peak of the sound of the thesis, nearly the same everywhere [Pa].

    $$p = p_{10}\,e^{-\alpha (R - 10\,\mathrm{m})}, \quad
      \alpha = 6.75\times10^{-8}\ \mathrm{m^{-1}}$$

    Args:
        slant_range: Range $R$ [m].
    """
    return PEAK * namespace(slant_range).exp(-ALPHA * (slant_range - RANGE))


@checked
def coded_sound_pressure(slant_range: Number, charge_mass: Number) -> Numbers:
    r"""Return the peak of the plugin's sound, with silence where it plays none [Pa].

    The plugin plays no air blast, without a warning, where the air shock by eq. 3.4 is
    slower than sound on average, that is beyond $R = 14.8\sqrt{Q}$ m.

    Args:
        slant_range: Range $R$ [m].
        charge_mass: TNT-equivalent mass $Q$ [kg].
    """
    played = wu_hao_air_valid(slant_range, charge_mass)
    share = namespace(slant_range, charge_mass).where(played, 1.0, SILENCE)
    return thesis_sound_pressure(slant_range) * share


@checked
def thesis_sound_duration(slant_range: Number) -> Numbers:
    """Return the positive duration of the sound of the thesis, a constant [s].

    Args:
        slant_range: Range [m].
    """
    # Adding it gives the constant the shape and the precision of the ranges.
    return DURATION + 0.0 * slant_range


@checked
def thesis_sound_impulse(slant_range: Number) -> Numbers:
    r"""Return the positive impulse of the sound of the thesis: $p\,t_d/e$ [Pa s].

    It is the impulse of $p (1 - t/t_d) e^{-t/t_d}$, eq. 3.5.

    Args:
        slant_range: Range [m].
    """
    return thesis_sound_pressure(slant_range) * (DURATION / math.e)


@checked
def coded_sound_impulse(slant_range: Number, charge_mass: Number) -> Numbers:
    """Return the impulse of the plugin's sound, nearly zero where it is silent [Pa s].

    Args:
        slant_range: Range [m].
        charge_mass: TNT-equivalent mass [kg].
    """
    return coded_sound_pressure(slant_range, charge_mass) * (DURATION / math.e)


def thesis_sound_valid(slant_range: Number) -> Any:
    """Return True everywhere: the law is not physical, and needs no absorption."""
    return slant_range >= 0


for _quantity, _name, _function in (
    ("peak_overpressure_pa", "thesis_as_printed", thesis_sound_pressure),
    ("peak_overpressure_pa", "thesis_as_coded", coded_sound_pressure),
    ("positive_duration_s", "thesis_as_printed", thesis_sound_duration),
    ("positive_duration_s", "thesis_as_coded", thesis_sound_duration),
    ("positive_impulse_pa_s", "thesis_as_printed", thesis_sound_impulse),
    ("positive_impulse_pa_s", "thesis_as_coded", coded_sound_impulse),
):
    register(
        Law(
            quantity=_quantity,
            name=_name,
            function=_function,
            range="of the thesis alone; true nowhere",
            source="Parab's thesis, eqs. 3.1, 3.2 and 3.5; size declared",
            valid=thesis_sound_valid,
            scatter=declared_scatter(shot=0.0, record=0.0),
            scatter_source="declared",
        )
    )
