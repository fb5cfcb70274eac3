r"""Sound on moving air."""

from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked


@checked
def effective_sound_speed(
    sound_speed: Float[ArrayLike, "..."],
    wind_along: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the speed of sound along a path through wind [m/s].

    $$c_{eff} = c_0 + \mathbf{w} \cdot \mathbf{n}$$

    with $\mathbf n$ the direction from charge to sensor: a tail wind adds. In uniform
    wind the wave is a sphere that drifts, so the exact travel time over $\mathbf d$
    solves $c_0 t = |\mathbf{d} - \mathbf{w} t|$ and the exact speed is
    $w_\parallel + \sqrt{c_0^2 - w_\perp^2}$. The crosswind left out slows it by the
    fraction $w_\perp^2/(2 c_0^2)$ of $c_0$: 0.04 % at 10 m/s. Meant for winds well
    below the speed of sound; nearer it the answer falls to zero and below.

    Args:
        sound_speed: $c_0$ in still air [m/s], positive.
        wind_along: Wind's component along the path
            $\mathbf{w} \cdot \mathbf{n}$ [m/s]; negative is a head wind.
    """
    sound_speed, wind_along = as_float_arrays(sound_speed, wind_along)
    return sound_speed + wind_along
