import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jblast.waves.laws.sedov_taylor import sedov_alpha

GAMMAS = np.array([1.1, 1.2, 1.3, 1.4, 1.5, 5 / 3, 1.8])


@pytest.mark.parametrize(
    ("gamma", "printed", "digit"),
    [
        (1.2, 1.71980, 1e-5),
        (1.3, 1.14360, 1e-5),
        (1.4, 0.851071854758, 1e-12),
        (5 / 3, 0.493590, 1e-6),
    ],
)
def test_alpha_is_the_published_value(gamma, printed, digit):
    np.testing.assert_allclose(sedov_alpha(gamma), printed, rtol=0, atol=digit / 2)


def test_taylors_own_constant_is_half_a_percent_high():
    # Taylor (1950) integrated by hand: K = 0.856 at gamma = 1.4, three digits
    np.testing.assert_allclose(sedov_alpha(1.4), 0.856, rtol=6.5e-3)


def _alpha_by_integration(gamma):
    """Taylor (1950), eqs. 5 to 14: from the shock inwards, and the energy with it.

    u = A R^(-3/2) phi, p = p0 (A/c0)^2 R^(-3) f, rho = rho0 psi of eta = r/R; then
    R^(5/2) = (5/2) A t.
    """

    def inwards(eta, state):
        f, phi, psi, _ = state
        lag = eta - phi
        df = (
            f
            * (-3 * eta + phi * (3 + gamma / 2) - 2 * gamma * phi**2 / eta)
            / (lag**2 - f / psi)
        )
        dphi = (df / (gamma * psi) - 1.5 * phi) / lag
        dpsi = psi * (dphi + 2 * phi / eta) / lag
        energy = 2 * np.pi * psi * phi**2 + 4 * np.pi * f / (gamma * (gamma - 1))
        return [df, dphi, dpsi, energy * eta**2]

    # Near the centre there is pressure alone, and it is level: f has a correction of
    # order eta^((2 gamma + 1)/(gamma - 1)), 3e-9 here for gamma = 5/3, on a core that
    # holds 1e-4 of the energy.
    centre = 0.05
    shock = [2 * gamma / (gamma + 1), 2 / (gamma + 1), (gamma + 1) / (gamma - 1), 0.0]
    end = solve_ivp(
        inwards, (1.0, centre), shock, method="DOP853", rtol=1e-13, atol=1e-30
    ).y[:, -1]
    core = 4 * np.pi * end[0] / (gamma * (gamma - 1)) * centre**3 / 3
    return 4 / 25 * (core - end[3])


@pytest.mark.parametrize("gamma", [1.2, 1.3, 1.4, 5 / 3])
def test_alpha_is_that_of_the_integrated_equations(gamma):
    np.testing.assert_allclose(
        sedov_alpha(gamma), _alpha_by_integration(gamma), rtol=1e-9
    )


def test_gradient_is_the_derivative():
    # central difference of step 1e-4: error h^2/6 times the third derivative over the
    # first, 1e-5 at gamma = 1.1 and far less above
    slope = jax.jit(jax.vmap(jax.grad(sedov_alpha)))(GAMMAS)
    step = 1e-4
    shifts = step * np.array([[1.0], [-1.0], [2.0], [-2.0]])
    above, below, far_above, far_below = np.asarray(sedov_alpha(GAMMAS + shifts))
    difference = (above - below) / (2 * step)
    np.testing.assert_allclose(slope, difference, rtol=2e-6)
    # Richardson's extrapolation takes the error to h^4
    wide = (far_above - far_below) / (4 * step)
    np.testing.assert_allclose(slope, (4 * difference - wide) / 3, rtol=1e-10)
