import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import norm, t

from calibration.leave_out import log_likelihood

RESIDUAL = np.array([0.3, 0.1, -0.2])
OF_PATH = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
SHOT_SD, PATH_SD, RECORD_SD = 0.2, 0.15, 0.1


@pytest.mark.slow
def test_likelihood_is_the_integral_over_shot_and_paths():
    def own(rows, z, u):
        left = RESIDUAL[rows] - SHOT_SD * z - PATH_SD * u
        return np.prod(t.pdf(left, 4, scale=RECORD_SD))

    def integrand(u, z):
        # The second path's own effect is summed on a fine grid of its own.
        grid = np.linspace(-6, 6, 241)
        second = t.pdf(
            RESIDUAL[2] - SHOT_SD * z - PATH_SD * grid, 4, scale=RECORD_SD
        ) @ norm.pdf(grid)
        return norm.pdf(z) * norm.pdf(u) * own([0, 1], z, u) * second * 0.05

    expected = dblquad(integrand, -6, 6, -6, 6, epsabs=1e-5, epsrel=1e-5)[0]
    sds = tuple(jnp.full((1, 3), sd) for sd in (SHOT_SD, PATH_SD, RECORD_SD))
    got = log_likelihood(jnp.asarray(RESIDUAL)[None, :], sds, jnp.asarray(OF_PATH))
    # Both sums are of smooth functions on even grids; 1e-4 leaves room for dblquad.
    assert got[0] == pytest.approx(np.log(expected), abs=1e-4)
