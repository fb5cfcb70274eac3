r"""Arrival of the ground wave and the air shock of a charge on rock.

Wu and Hao (2005), Int. J. Impact Eng. 31:699, read as quoted in Parab's thesis,
eqs. 3.3 and 3.4. Their constants hold for metres and kilograms only, and the laws are
not Hopkinson-scaled: $t/Q^{1/3}$ is no function of $R/Q^{1/3}$ alone.
"""

from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked

SOURCE = "Wu & Hao 2005, as quoted in Parab's thesis, eqs. 3.3-3.4"


@checked
def wu_hao_air_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    sound_speed: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the travel time of the air shock of a charge on rock [s].

    $$t_a = 0.34\,R^{1.4}\,Q^{-0.2} / c_a$$

    Past $R = 14.8\sqrt{Q}$ m it is slower than sound on average, so stay inside that.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $Q$ [kg], positive.
        sound_speed: Ambient sound speed $c_a$ [m/s].
    """
    slant_range, charge_mass, sound_speed = as_float_arrays(
        slant_range, charge_mass, sound_speed
    )
    return 0.34 * slant_range**1.4 * charge_mass**-0.2 / sound_speed


def wu_hao_air_valid(
    slant_range: Float[ArrayLike, "..."], charge_mass: Float[ArrayLike, "..."]
) -> Bool[Array, "..."]:
    r"""Return where the air shock is not slower than sound: $R \le 14.8\sqrt{Q}$.

    $R/t_a \ge c_a$ means $R^{0.4} \le Q^{0.2}/0.34$.
    """
    slant_range, charge_mass = as_float_arrays(slant_range, charge_mass)
    return slant_range**0.4 <= charge_mass**0.2 / 0.34


@checked
def wu_hao_ground_arrival_time(
    ground_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    p_speed: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the travel time of the P wave along the rock surface [s].

    $$t_s = 0.91\,R^{1.03}\,Q^{-0.02} / c_s$$

    Args:
        ground_range: Distance along the ground $R$ [m], positive.
        charge_mass: TNT-equivalent mass $Q$ [kg], positive.
        p_speed: P-wave speed of the rock $c_s$ [m/s].
    """
    ground_range, charge_mass, p_speed = as_float_arrays(
        ground_range, charge_mass, p_speed
    )
    return 0.91 * ground_range**1.03 * charge_mass**-0.02 / p_speed


def wu_hao_ground_valid(ground_range: Float[ArrayLike, "..."]) -> Bool[Array, "..."]:
    """Return True at every positive range: the paper states no limit we could read."""
    return as_float_array(ground_range) > 0


register(
    Law(
        quantity="air_arrival_s",
        name="wu_hao",
        function=wu_hao_air_arrival_time,
        range="R <= 14.8 sqrt(Q) m (faster than sound)",
        source=SOURCE,
        valid=wu_hao_air_valid,
        scatter=declared_scatter(shot=0.01, record=0.01),
        scatter_source="declared",
    )
)
register(
    Law(
        quantity="ground_arrival_s",
        name="wu_hao",
        function=wu_hao_ground_arrival_time,
        range="stated for rock surfaces; no limit known",
        source=SOURCE,
        valid=wu_hao_ground_valid,
        scatter=declared_scatter(shot=0.01, record=0.01),
        scatter_source="declared",
    )
)
