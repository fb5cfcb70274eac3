r"""The distortion of a lens, and where its formula folds over.

Brown and Conrady's radial-tangential model in OpenCV's form (Calib3d, "Detailed
Description"), for $x$ a point of the plane at distance 1 and $r = |x|$:

$$x_d = S x + 2 (p \cdot x)\,x + r^2 p, \quad S = 1 + k_1 r^2 + k_2 r^4 + k_3 r^6, \quad
p = (p_2, p_1)$$

It is the gradient of a potential, so its Jacobian is symmetric. In the axes $e$ along
$x$ and $e_\perp$ across, with $a = p \cdot e$ and $b = p \cdot e_\perp$, it is

$$\begin{pmatrix} S_r + 6 r a & 2 r b \\ 2 r b & S + 2 r a \end{pmatrix}, \quad
S_r = 1 + 3 k_1 r^2 + 5 k_2 r^4 + 7 k_3 r^6$$

At the centre it is the unit matrix. Where its smaller eigenvalue reaches zero on the
way out, so does its determinant, and the image folds over: one pixel then shows several
directions, and only those inside the fold are real.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

STEPS = 64
"""Places on the way out at which the fold is looked for; one that opens and closes
between two of them is overlooked."""

HALVINGS = 52
"""Of a bracket: they leave the last bit of float64."""


def distort(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Float[Array, "... 2"]:
    """Where the lens puts a point of the plane at distance 1.

    Args:
        point: Without distortion: x/z, y/z [-].
        distortion: k1, k2, p1, p2, k3 [-].
    """
    x, y = point[..., 0], point[..., 1]
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    scale = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)) + 2 * (p2 * x + p1 * y)
    return jnp.stack([scale * x + r2 * p2, scale * y + r2 * p1], axis=-1)


@jax.jit
def distortion_jacobian(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> tuple[Float[Array, "..."], Float[Array, "..."], Float[Array, "..."]]:
    """Entries xx, xy and yy of the symmetric Jacobian of `distort` in the point."""
    x, y = point[..., 0], point[..., 1]
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    scale = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * k1 + r2 * (4 * k2 + r2 * 6 * k3)
    return (
        scale + slope * x * x + 6 * p2 * x + 2 * p1 * y,
        slope * x * y + 2 * (p1 * x + p2 * y),
        scale + slope * y * y + 2 * p2 * x + 6 * p1 * y,
    )


def unfolded(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Bool[Array, "..."]:
    """Return whether no fold lies between the centre and a point, nor on it.

    Args:
        point: Without distortion: x/z, y/z [-].
        distortion: k1, k2, p1, p2, k3 [-].
    """
    point, distortion = jax.lax.stop_gradient((point, distortion))

    def step(n, clear):
        return clear & _clear(point * ((n + 1) / STEPS), distortion)

    clear = jnp.ones(point.shape[:-1], bool)
    return jax.lax.fori_loop(0, STEPS, step, clear)


@jax.jit
def fold_radius(
    distortion: Float[Array, "5"], direction: Float[Array, "... 2"]
) -> Float[Array, "..."]:
    """Distance from the centre at which the model first folds over, going one way.

    Found by its sign at 1024 angles from the axis, 0.09 degrees apart, and bisection.
    It is not differentiated: its gradient is zero.

    Args:
        distortion: k1, k2, p1, p2, k3 [-].
        direction: Along which to go; its length does not matter.

    Returns:
        Radius without distortion, in the plane at distance 1 [-]; infinite where there
        is no fold.
    """
    distortion = jax.lax.stop_gradient(distortion)
    length = jnp.sqrt(jnp.sum(jnp.square(direction), axis=-1, keepdims=True))
    unit = jax.lax.stop_gradient(direction / length)

    def clear(radius):
        return _clear(unit * radius[..., None], distortion)

    def halve(_, bracket):
        inside, beyond = bracket
        middle = 0.5 * (inside + beyond)
        before = clear(middle)
        return jnp.where(before, middle, inside), jnp.where(before, beyond, middle)

    radii = jnp.asarray(np.tan(np.arange(1024) * (np.pi / 2 / 1024)), unit.dtype)
    at = jax.vmap(lambda radius: clear(jnp.broadcast_to(radius, unit.shape[:-1])))
    folded = ~at(radii)  # never at the centre itself
    first = jnp.argmax(folded, axis=0)
    bracket = radii[jnp.maximum(first - 1, 0)], radii[first]
    inside, _ = jax.lax.fori_loop(0, HALVINGS, halve, bracket)
    return jnp.where(jnp.any(folded, axis=0), inside, jnp.inf)


def _clear(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Bool[Array, "..."]:
    """Return whether both eigenvalues of the Jacobian in a point are positive.

    The determinant is compared after division: its products would overflow in float32.
    """
    xx, xy, yy = distortion_jacobian(point, distortion)
    return (xx > 0) & (xy * (xy / jnp.where(xx > 0, xx, 1.0)) < yy)
