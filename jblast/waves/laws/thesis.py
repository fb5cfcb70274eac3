r"""How loud the thesis lets a blast be: as one file is played, at any distance.

Its sound is one recording for every charge, without pascals. It is absorbed by Stokes'
law at 500 rad/s and spreads nowhere (Parab's thesis, eqs. 3.1 and 3.2), so that it is
as loud far away as near by. What stands for the file here is declared: the pulse of
eq. 3.5 (Friedlander, b = 1), with the peak and the duration that Kingery and Bulmash
give for the charge of its table 4.1, 15 kg, at the nearest distance of its worlds,
10 m.

Laws that no list offers and `auto` never takes; `jblast world --preset` names them.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.registry import Law, declared_scatter, reserve
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
)
from jblast.waves.laws.wu_hao import wu_hao_air_valid
from jblast.waves.propagation import stokes_absorption

MASS, RANGE = 15.0, 10.0
"""Of the charge and the distance that the file is taken for, declared [kg], [m]."""
OMEGA, DENSITY, SOUND_SPEED, KELVIN = 500.0, 1.2, 340.0, 313.0
"""Of Stokes' law in the public plugin gazebo_blast3d (`e6dd04c`) [rad/s], [kg/m3],
[m/s], [K]."""
SILENCE = 1e-12
"""Of the peak, in place of nothing: a law's logarithm is a number."""


def _alike(like: Float[Array, "..."], *numbers: float) -> tuple[Float[Array, ""], ...]:
    """Return numbers in the precision of an array."""
    return tuple(jnp.asarray(number, like.dtype) for number in numbers)


@checked
def thesis_sound_pressure(
    slant_range: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the peak of the thesis's sound, as good as the same everywhere [Pa].

    $$p = p_{10}\,e^{-\alpha (R - 10\,\mathrm{m})}, \quad
      \alpha = 6.75\times10^{-8}\ \mathrm{m^{-1}}$$

    Args:
        slant_range: Range $R$ [m].
    """
    away = as_float_array(slant_range) - RANGE
    of_air = (OMEGA / (2 * math.pi), DENSITY, SOUND_SPEED, KELVIN)
    alpha = stokes_absorption(*_alike(away, *of_air))
    near, mass = _alike(away, RANGE, MASS)
    peak = kingery_bulmash_pressure(near, mass)
    return peak * jnp.exp(-alpha * away)


@checked
def coded_sound_pressure(
    slant_range: Float[ArrayLike, "..."], charge_mass: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    r"""Return the same, and silence where the plugin drops the blast [Pa].

    Where the air shock by eq. 3.4 is slower than sound on average, past
    $R = 14.8\sqrt{Q}$ m, the plugin plays no air blast, and says nothing.

    Args:
        slant_range: Range $R$ [m].
        charge_mass: TNT-equivalent mass $Q$ [kg].
    """
    slant_range, charge_mass = as_float_arrays(slant_range, charge_mass)
    played = wu_hao_air_valid(slant_range, charge_mass)
    return thesis_sound_pressure(slant_range) * jnp.where(played, 1.0, SILENCE)


@checked
def thesis_sound_duration(
    slant_range: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return the positive duration of the thesis's sound, the same everywhere [s].

    Args:
        slant_range: Range [m].
    """
    nothing = 0.0 * as_float_array(slant_range)
    near, mass = _alike(nothing, RANGE, MASS)
    return kingery_bulmash_duration(near, mass) + nothing


@checked
def thesis_sound_impulse(
    slant_range: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the positive impulse of the thesis's sound: $p\,t_d/e$ [Pa s].

    That of $p (1 - t/t_d) e^{-t/t_d}$, its eq. 3.5.

    Args:
        slant_range: Range [m].
    """
    peak = thesis_sound_pressure(slant_range)
    return peak * thesis_sound_duration(slant_range) / math.e


@checked
def coded_sound_impulse(
    slant_range: Float[ArrayLike, "..."], charge_mass: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the same, and as good as nothing where the plugin plays nothing [Pa s].

    Args:
        slant_range: Range [m].
        charge_mass: TNT-equivalent mass [kg].
    """
    peak = coded_sound_pressure(slant_range, charge_mass)
    return peak * thesis_sound_duration(slant_range) / math.e


def thesis_sound_valid(
    slant_range: Float[ArrayLike, "..."],
) -> Bool[Array, "..."]:
    """Return True: nothing of nature is claimed, and no absorption is to be added."""
    return as_float_array(slant_range) >= 0


for _quantity, _name, _function in (
    ("peak_overpressure_pa", "thesis_as_printed", thesis_sound_pressure),
    ("peak_overpressure_pa", "thesis_as_coded", coded_sound_pressure),
    ("positive_duration_s", "thesis_as_printed", thesis_sound_duration),
    ("positive_duration_s", "thesis_as_coded", thesis_sound_duration),
    ("positive_impulse_pa_s", "thesis_as_printed", thesis_sound_impulse),
    ("positive_impulse_pa_s", "thesis_as_coded", coded_sound_impulse),
):
    reserve(
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
