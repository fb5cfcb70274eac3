r"""Arrival of the ground wave and the air shock of a charge on rock.

Wu and Hao (2005), Int. J. Impact Eng. 31:699, read as quoted in Parab's thesis,
eqs. 3.3 and 3.4. Their constants hold for metres and kilograms only, and the laws are
not Hopkinson-scaled: $t/Q^{1/3}$ is no function of $R/Q^{1/3}$ alone.

A sensor above the ground gets the ground wave through the air under it. The thesis'
plugin lets it climb at the mean speed of the air shock (`ground_path` "thesis"); by
default it is not delayed at all ("head").
"""

from typing import Any

from jblast.errors import require
from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.tables import Numbers


@checked
def wu_hao_air_arrival_time(
    slant_range: Number,
    charge_mass: Number,
    sound_speed: Number,
) -> Numbers:
    r"""Return the travel time of the air shock of a charge on rock [s].

    $$t_a = 0.34\,R^{1.4}\,Q^{-0.2} / c_a$$

    Past $R = 14.8\sqrt{Q}$ m it is slower than sound on average, so stay inside that.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $Q$ [kg], positive.
        sound_speed: Ambient sound speed $c_a$ [m/s].
    """
    return 0.34 * slant_range**1.4 * charge_mass**-0.2 / sound_speed


def wu_hao_air_valid(
    slant_range: Number, charge_mass: Number, burst: str = "surface"
) -> Any:
    r"""Return where the air shock is not slower than sound: $R \le 14.8\sqrt{Q}$.

    $R/t_a \ge c_a$ means $R^{0.4} \le Q^{0.2}/0.34$. Nowhere in free air.
    """
    # 14.8 is 0.34^-2.5 rounded: this form has the digits of the arrival instead.
    return (slant_range**0.4 <= charge_mass**0.2 / 0.34) & (burst == "surface")


@checked
def wu_hao_ground_arrival_time(
    ground_range: Number,
    charge_mass: Number,
    p_speed: Number,
) -> Numbers:
    r"""Return the travel time of the P wave along the rock surface [s].

    $$t_s = 0.91\,R^{1.03}\,Q^{-0.02} / c_s$$

    Args:
        ground_range: Distance along the ground $R$ [m], positive.
        charge_mass: TNT-equivalent mass $Q$ [kg], positive.
        p_speed: P-wave speed of the rock $c_s$ [m/s].
    """
    return 0.91 * ground_range**1.03 * charge_mass**-0.02 / p_speed


@checked
def wu_hao_ground_path_arrival_time(
    slant_range: Number,
    ground_range: Number,
    sensor_height: Number,
    charge_mass: Number,
    sound_speed: Number,
    p_speed: Number,
    ground_path: str = "head",
) -> Numbers:
    r"""Return the travel time of the ground wave along the path of the scene [s].

    With the path "head" a sensor above the ground gets it without delay. With "thesis"
    it climbs at the mean speed of the air shock over the slant range, as in the thesis'
    plugin:

    $$t = t_s(R_g) + \frac{h}{R / t_a(R)}$$

    That is for reproducing the thesis: what moving ground sends up is sound, not a
    shock. A sensor below the ground counts as on it; on it the derivative to the height
    is half of that above.

    Args:
        slant_range: Straight distance $R$ [m], positive.
        ground_range: Distance along the ground $R_g$ [m].
        sensor_height: Height of the sensor above the ground $h$ [m].
        charge_mass: TNT-equivalent mass $Q$ [kg], positive.
        sound_speed: Ambient sound speed $c_a$ [m/s].
        p_speed: P-wave speed of the rock $c_s$ [m/s].
        ground_path: "head" or "thesis".

    Raises:
        InputError: `ground_path` is neither.

    References:
        Parab's thesis, figure 3.6; the speed of the climb is read from the public
        plugin gazebo_blast3d (`e6dd04c`).
    """
    known = ground_path in ("head", "thesis")
    require(known, "ground_path", "'head' or 'thesis'", ground_path)
    along = wu_hao_ground_arrival_time(ground_range, charge_mass, p_speed)
    through_air = wu_hao_air_arrival_time(slant_range, charge_mass, sound_speed)
    climb = namespace(sensor_height).maximum(sensor_height, 0.0)
    # times zero, not without it: the result has one shape for either path
    return (
        along + (climb if ground_path == "thesis" else 0.0) * through_air / slant_range
    )


def wu_hao_ground_path_valid(
    slant_range: Number,
    ground_range: Number,
    sensor_height: Number,
    charge_mass: Number,
    ground_path: str = "head",
    burst: str = "surface",
) -> Any:
    """Return True where both legs are valid; the air leg needs a supersonic shock.

    The law is not valid in free air: such a charge does not move the rock as one on it.
    """
    # no limit of the paper is known to us
    along = (ground_range > 0) & (burst == "surface")
    if ground_path == "head":
        return along
    in_air = wu_hao_air_valid(slant_range, charge_mass)
    return along & ((sensor_height <= 0) | in_air)


for _quantity, _function, _valid, _range in (
    (
        "air_arrival_s",
        wu_hao_air_arrival_time,
        wu_hao_air_valid,
        "charge on rock, R <= 14.8 sqrt(Q) m (faster than sound)",
    ),
    (
        "ground_arrival_s",
        wu_hao_ground_path_arrival_time,
        wu_hao_ground_path_valid,
        "charge on rock; no limit of R known (thesis path: as in air)",
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="wu_hao",
            title="Wu-Hao",
            function=_function,
            range=_range,
            source="Wu & Hao 2005, as quoted in Parab's thesis, eqs. 3.3-3.4",
            valid=_valid,
            scatter=declared_scatter(shot=0.01, record=0.01),
            scatter_source="declared",
        )
    )
