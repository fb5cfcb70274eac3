import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.waves.euler import Ambient, IdealGas, start_sedov
from jblast.waves.euler.initial import sedov_cells
from jblast.waves.euler.state import primitives
from jblast.waves.euler.step import fitted_front
from jblast.waves.laws.sedov_taylor import sedov_alpha

AIR = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())


def test_mass_volume_and_energy_are_those_of_the_whole():
    _, state = start_sedov(2.0, AIR, 0.03, cells=50)
    sphere = 0.03**3 / 3.0
    assert float(state.mass.sum()) == pytest.approx(sphere, rel=1e-14)
    assert float(state.volume.sum()) == pytest.approx(sphere, rel=1e-14)
    # the source's energy a steradian, and the internal energy of the air overtaken
    whole = 2.0 / (4.0 * np.pi) + sphere / 0.4
    assert float(state.energy.sum()) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("gamma", [1.2, 1.4, 5.0 / 3.0])
def test_the_energy_in_the_cells_is_that_of_the_exact_constant(gamma):
    labels = jnp.linspace(0.0, 1.0, 41)
    _, _, _, energy = jax.jit(sedov_cells)(labels, jnp.asarray(gamma))
    # E = alpha rho R^5/t^2 with u_s = 4R/(5t(gamma + 1)) and rho_s/rho = b
    b = (gamma + 1.0) / (gamma - 1.0)
    unit = 0.5 * b * (0.8 / (gamma + 1.0)) ** 2
    alpha = 4.0 * np.pi * unit * float(energy.sum())
    # 7e-10: the quadrature of eight nodes in the first cell
    assert alpha == pytest.approx(float(sedov_alpha(gamma)), rel=1e-8)


def test_the_shock_behind_the_profile_is_the_strong_one():
    flow, state = start_sedov(1.0, AIR, 0.01, cells=400)
    assert flow.ambient is not None
    front = fitted_front(primitives(state, flow.gas), flow.gas, flow.ambient)
    strong = 8.0 / (25.0 * 2.4 * float(sedov_alpha(1.4)) * 0.01**3)
    # a parabola through means of the last three of 400 cells
    assert float(front.pressure) == pytest.approx(strong, rel=2e-4)


def test_too_few_cells_are_refused():
    with pytest.raises(InputError, match=r"cells: expected at least 20 .* got 8"):
        start_sedov(1.0, AIR, 0.02, cells=8)


def test_a_start_where_the_shock_is_weak_is_refused():
    with pytest.raises(InputError, match="at least 300 ambient pressures"):
        start_sedov(1.0, AIR, 0.2, cells=50)
