r"""The constant $\alpha(\gamma)$ of a spherical point explosion, exactly.

Behind the shock of $E = \alpha\rho_0 R^5/t^2$ the flow is self-similar, and Sedov
(1946) found it in closed form. With $V = u t/r$ as parameter, in the notation of Kamm
(2000), LA-UR-00-6055, for a sphere and uniform density:

$$x_1 = \tfrac{5(\gamma+1)}{4} V,\quad
x_2 = \tfrac{\gamma+1}{\gamma-1}(\tfrac{5\gamma}{2} V - 1),\quad
x_3 = \tfrac{5(\gamma+1)}{7-\gamma}(1 - \tfrac{3\gamma-1}{2} V),\quad
x_4 = \tfrac{\gamma+1}{\gamma-1}(1 - \tfrac{5}{2} V)$$

$$\lambda = r/R = x_1^{-2/5}\,x_2^{-a_2}\,x_3^{-a_1},\quad u/u_s = x_1\lambda,\quad
\rho/\rho_s = x_2^{a_3} x_3^{a_4} x_4^{a_5},\quad
p/p_s = x_1^{6/5} x_3^{a_4-2a_1} x_4^{1+a_5}$$

with $x_2$ running from 0 at the centre to 1 at the shock.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array
from jblast.waves.arguments import checked

NODES = 24
"""Quadrature nodes. The error falls as 6^-n; 24 reach rounding for gamma from 1.05."""


GAMMAS = (1.02, 1.9)
"""Where the constant is computed; beyond, it goes on as a power of gamma."""


@checked
def sedov_alpha(sedov_gamma: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    r"""Return $\alpha$ of a spherical point explosion, $E = \alpha\rho_0 R^5/t^2$ [-].

    Kinetic and internal energy behind the shock add up to

    $$\alpha = \frac{32\pi}{25(\gamma^2-1)} \int_0^1 \left[
    \frac{\rho}{\rho_s}\frac{u^2}{u_s^2} + \frac{p}{p_s}\right]\lambda^2 d\lambda$$

    In $x = x_2$ the bracket is analytic, and $\lambda^2 d\lambda$ is $x^{k-1} dx$ times
    something analytic, $k = 3(\gamma-1)/(2\gamma+1)$. So the analytic part is expanded
    in Legendre polynomials of $2x-1$, and $x^{k-1}$ times each is integrated exactly.

    Args:
        sedov_gamma: Ratio of specific heats $\gamma$ [-], above 1 and below 2 (where
            two exponents of the closed form are infinite).
    """
    gamma = as_float_array(sedov_gamma)
    inside = jnp.clip(gamma, *GAMMAS)
    alpha, slope = jax.jvp(jnp.vectorize(_alpha), (inside,), (inside,))
    return alpha * jnp.exp(slope / alpha * jnp.log(gamma / inside))


def _alpha(gamma: Float[Array, ""]) -> Float[Array, ""]:
    nodes, projection = (jnp.asarray(array, gamma.dtype) for array in _legendre(NODES))
    k = 3.0 * (gamma - 1.0) / (2.0 * gamma + 1.0)
    coefficients = projection @ _analytic_part(nodes, gamma)
    # The integral of x^(k-1) P_n is (-1)^n/k times the product of (j-k)/(j+k), j to n;
    # summed in ln, for the derivative of a cumulative product takes long to compile.
    j = jnp.arange(1, NODES, dtype=gamma.dtype)
    products = jnp.exp(jnp.cumsum(jnp.log((j - k) / (j + k))))
    moments = jnp.concatenate([jnp.ones(1, gamma.dtype), (-1.0) ** j * products]) / k
    return 32.0 * jnp.pi / (25.0 * (gamma**2 - 1.0)) * (moments @ coefficients)


def _analytic_part(
    x2: Float[Array, " node"], gamma: Float[Array, ""]
) -> Float[Array, " node"]:
    r"""Energy density times $\lambda^2 d\lambda/dx_2$, over $x_2^{k-1}$.

    Density carries $x_2^{a_3}$ and $u^2$ carries $x_2^{-2a_2}$: together exactly $x_2$.
    The powers of $x_1$ cancel, which leaves

    $$(x_2 + x_4)\,x_4^{a_5}\,x_3^{a_4-5a_1}\,\frac{d\ln\lambda}{d\ln x_2}$$
    """
    minus_a2 = (gamma - 1.0) / (2.0 * gamma + 1.0)
    a1 = (6.0 * (2.0 - gamma) / 5.0 + 5.0 * gamma * minus_a2) / (3.0 * gamma - 1.0)
    a4 = 5.0 * a1 / (2.0 - gamma)
    a5 = -2.0 / (2.0 - gamma)
    b = (gamma + 1.0) / (gamma - 1.0)
    e = (3.0 * gamma - 1.0) / 2.0

    v = 0.4 * (1.0 + x2 / b) / gamma
    x3 = 5.0 * (gamma + 1.0) / (7.0 - gamma) * (1.0 - e * v)
    x4 = b * (1.0 - 2.5 * v)
    dv = 0.4 / (b * gamma)  # dV/dx2
    slope = minus_a2 + x2 * dv * (-0.4 / v + a1 * e / (1.0 - e * v))
    return (x2 + x4) * jnp.exp(a5 * jnp.log(x4) + (a4 - 5.0 * a1) * jnp.log(x3)) * slope


def _legendre(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes on (0, 1), and the matrix from values there to Legendre coefficients."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    degree = np.arange(count)[:, None]
    values = np.polynomial.legendre.legvander(nodes, count - 1).T
    return (nodes + 1.0) / 2.0, (degree + 0.5) * values * weights
