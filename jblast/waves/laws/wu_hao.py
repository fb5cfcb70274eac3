r"""Arrival of the ground wave and the air shock of a charge on rock.

Wu and Hao (2005), Int. J. Impact Eng. 31:699, read as quoted in Parab's thesis,
eqs. 3.3 and 3.4. Their constants hold for metres and kilograms only, and the laws are
not Hopkinson-scaled: $t/Q^{1/3}$ is no function of $R/Q^{1/3}$ alone.

A sensor above the ground gets the ground wave through the air under it. The thesis'
plugin lets it climb at the mean speed of the air shock (`ground_path` "thesis"); by
default it is not delayed at all ("head").
"""

import jax.numpy as jnp
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
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    burst: str = "surface",
) -> Bool[Array, "..."]:
    r"""Return where the air shock is not slower than sound: $R \le 14.8\sqrt{Q}$.

    $R/t_a \ge c_a$ means $R^{0.4} \le Q^{0.2}/0.34$. Nowhere in free air.
    """
    slant_range, charge_mass = as_float_arrays(slant_range, charge_mass)
    # 14.8 is 0.34^-2.5 rounded: this form has the digits of the arrival instead.
    return (slant_range**0.4 <= charge_mass**0.2 / 0.34) & (burst == "surface")


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


@checked
def dual_path_ground_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    ground_range: Float[ArrayLike, "..."],
    sensor_height: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    sound_speed: Float[ArrayLike, "..."],
    p_speed: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the time of the ground wave that climbs to a sensor above the ground [s].

    $$t = t_s(R_g) + \frac{h}{R / t_a(R)}$$

    As the thesis' plugin computes it: along the rock to the point below the sensor,
    then up at the mean speed of the air shock over the slant range. That is for
    reproducing the thesis: what moving ground sends up is sound, not a shock. A sensor
    below the ground counts as on it; on it the derivative to the height is half of
    that above.

    Args:
        slant_range: Straight distance $R$ [m], positive.
        ground_range: Distance along the ground $R_g$ [m].
        sensor_height: Height of the sensor above the ground $h$ [m].
        charge_mass: TNT-equivalent mass $Q$ [kg], positive.
        sound_speed: Ambient sound speed $c_a$ [m/s].
        p_speed: P-wave speed of the rock $c_s$ [m/s].

    References:
        Parab's thesis, figure 3.6; the speed of the climb is read from the public
        plugin gazebo_blast3d (`e6dd04c`).
    """
    slant_range, sensor_height = as_float_arrays(slant_range, sensor_height)
    along = wu_hao_ground_arrival_time(ground_range, charge_mass, p_speed)
    slowness = (
        wu_hao_air_arrival_time(slant_range, charge_mass, sound_speed) / slant_range
    )
    return along + jnp.maximum(sensor_height, 0.0) * slowness


@checked
def wu_hao_ground_path_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    ground_range: Float[ArrayLike, "..."],
    sensor_height: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    sound_speed: Float[ArrayLike, "..."],
    p_speed: Float[ArrayLike, "..."],
    ground_path: str = "head",
) -> Float[Array, "..."]:
    """Return the travel time of the ground wave along the path of the scene [s].

    Args:
        slant_range: Straight distance [m], positive.
        ground_range: Distance along the ground [m].
        sensor_height: Height of the sensor above the ground [m].
        charge_mass: TNT-equivalent mass [kg], positive.
        sound_speed: Ambient sound speed [m/s].
        p_speed: P-wave speed of the rock [m/s].
        ground_path: "head" (`wu_hao_ground_arrival_time`, whatever the height) or
            "thesis" (`dual_path_ground_arrival_time`).

    Raises:
        ValueError: `ground_path` is neither.
    """
    way = as_float_arrays(slant_range, ground_range, sensor_height)
    rest = as_float_arrays(charge_mass, sound_speed, p_speed)
    if ground_path == "thesis":
        return dual_path_ground_arrival_time(*way, *rest)
    if ground_path != "head":
        raise ValueError(f"ground_path must be 'head' or 'thesis', got {ground_path!r}")
    along = wu_hao_ground_arrival_time(way[1], rest[0], rest[2])
    # the answer has one shape, whichever way the scene names
    return jnp.broadcast_to(along, jnp.broadcast_shapes(*map(jnp.shape, way + rest)))


def wu_hao_ground_valid(ground_range: Float[ArrayLike, "..."]) -> Bool[Array, "..."]:
    """Return True at every positive range; no limit of the paper is known to us."""
    return as_float_array(ground_range) > 0


def wu_hao_ground_path_valid(
    slant_range: Float[ArrayLike, "..."],
    ground_range: Float[ArrayLike, "..."],
    sensor_height: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ground_path: str = "head",
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True where both legs are valid; the air leg needs a supersonic shock.

    The law is not valid in free air: such a charge does not move the rock as one on it.
    """
    along = wu_hao_ground_valid(ground_range) & (burst == "surface")
    if ground_path == "head":
        return along
    climbs = as_float_array(sensor_height) > 0
    return along & (~climbs | wu_hao_air_valid(slant_range, charge_mass))


register(
    Law(
        quantity="air_arrival_s",
        name="wu_hao",
        title="Wu-Hao",
        function=wu_hao_air_arrival_time,
        range="charge on rock, R <= 14.8 sqrt(Q) m (faster than sound)",
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
        title="Wu-Hao",
        function=wu_hao_ground_path_arrival_time,
        range="charge on rock; no limit of R known (thesis path: as in air)",
        source=SOURCE,
        valid=wu_hao_ground_path_valid,
        scatter=declared_scatter(shot=0.01, record=0.01),
        scatter_source="declared",
    )
)
