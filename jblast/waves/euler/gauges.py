"""Gauges at fixed radii: the profile between the centres of the cells, straight."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.geometry import Geometry
from jblast.waves.euler.shock_fitting import fitted_front
from jblast.waves.euler.state import Flow, FlowState, primitives


def cell_centres(
    radius: Float[Array, "face ..."], geometry: Geometry
) -> Float[Array, "cell ..."]:
    r"""Return where the means of cells are reached by a straight profile [m].

    $$\frac34 \frac{r_2^4 - r_1^4}{r_2^3 - r_1^3} =
    \frac34 \frac{(r_1+r_2)(r_1^2+r_2^2)}{r_1^2+r_1r_2+r_2^2}$$
    """
    a, b = radius[:-1], radius[1:]
    if geometry == "planar":
        return 0.5 * (a + b)
    return 0.75 * (a + b) * (a * a + b * b) / (a * a + a * b + b * b)


def gauge_readings(
    state: FlowState, flow: Flow, places: Float[Array, " gauge"]
) -> tuple[Float[Array, " gauge"], Float[Array, " gauge"]]:
    """Return pressure [Pa] and velocity [m/s] at some radii.

    Ahead of a fitted shock it is that of the ambient air, and up to the shock the
    profile leads to what is behind it. Within the first centre, and past the last where
    there is a wall, it is the mean of that cell.

    Args:
        state: Of one run, not of a batch written out.
        flow: What does not change.
        places: Radii [m].
    """
    if places.shape[0] == 0:
        return places, places
    cells = primitives(state, flow.gas)
    centres = cell_centres(state.radius, flow.geometry)
    if flow.ambient is None:
        return (
            jnp.interp(places, centres, cells.pressure),
            jnp.interp(places, centres, cells.velocity),
        )
    front = fitted_front(cells, flow.gas.of_cells(slice(-1, None)), flow.ambient)
    radii = jnp.concatenate([centres, state.radius[-1:]])
    ahead = places > state.radius[-1]
    pressure = jnp.concatenate([cells.pressure, front.pressure[None]])
    velocity = jnp.concatenate([cells.velocity, front.velocity[None]])
    return (
        jnp.where(ahead, flow.ambient.pressure, jnp.interp(places, radii, pressure)),
        jnp.where(ahead, 0.0, jnp.interp(places, radii, velocity)),
    )
