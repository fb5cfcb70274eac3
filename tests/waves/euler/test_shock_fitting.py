import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.euler import Ambient, IdealGas, Primitives
from jblast.waves.euler.step import extrapolated, fitted_front
from jblast.waves.shock import blast_wind

AIR = Ambient(jnp.asarray(2.0), jnp.asarray(1.5), IdealGas())


@pytest.mark.parametrize("ratio", [1e-4, 0.1, 3.0, 1e4])
def test_gas_in_the_state_behind_a_shock_drives_that_shock(ratio):
    # a third way to the relations: jblast.waves.shock
    sound = float(np.sqrt(1.4 * 2.0 / 1.5))
    behind = [
        1.5 * (7 + 6 * ratio) / (7 + ratio),
        float(blast_wind(ratio, 1.0, sound)),
        2.0 * (1.0 + ratio),
    ]
    cells = Primitives(*(jnp.full(4, q) for q in behind))
    front = fitted_front(cells, IdealGas(), AIR)
    assert float(front.pressure) == pytest.approx(behind[2], rel=1e-13)
    assert float(front.velocity) == pytest.approx(behind[1], rel=1e-9)
    speed = sound * float(np.sqrt(1 + 6 / 7 * ratio))
    assert float(front.speed) == pytest.approx(speed, rel=1e-13)


def test_a_parabola_is_extrapolated_exactly_from_its_means():
    edges = np.arange(5.0)
    integral = edges**3 / 3.0 - 2.0 * edges**2 + edges
    value = extrapolated(jnp.asarray(np.diff(integral)))
    assert float(value) == pytest.approx(4.0**2 - 4.0 * 4.0 + 1.0, abs=1e-13)
