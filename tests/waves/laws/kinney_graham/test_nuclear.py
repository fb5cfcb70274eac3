import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.laws.dna_1kt import dna_1kt_pressure
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_duration
from jblast.waves.laws.kinney_graham import (
    kinney_graham_nuclear_duration,
    kinney_graham_nuclear_pressure,
    kinney_graham_nuclear_valid,
)

ONE_KILOTON = 0.5e6
"""Mass of TNT with the air blast of 1 kt nuclear [kg]."""


def printed_ratio(z):
    return 3.2e6 * z**-3 * math.sqrt(1 + (z / 87) ** 2) * (1 + z / 800)


def printed_duration(z):
    """Milliseconds."""
    return (
        180
        * math.sqrt(1 + (z / 100) ** 3)
        / math.sqrt(1 + z / 40)
        / (1 + (z / 285) ** 5) ** (1 / 6)
        / (1 + z / 50000) ** (1 / 6)
    )


@pytest.mark.parametrize("z", [1.0, 16.0, 50.0, 100.0, 285.0, 1e3, 4e3, 1e5])
def test_the_printed_formulas_come_out_for_one_kiloton(z):
    # roundings of logarithms up to 30
    assert float(kinney_graham_nuclear_pressure(z, ONE_KILOTON)) == pytest.approx(
        STANDARD_PRESSURE * printed_ratio(z), rel=1e-12
    )
    assert float(kinney_graham_nuclear_duration(z, ONE_KILOTON)) == pytest.approx(
        1e-3 * printed_duration(z), rel=1e-12
    )


def test_its_pressure_is_near_the_1_kt_standard():
    # the docstring's figures, over the range: 1.00 to 1.22
    r = jnp.geomspace(16.0, 4000.0, 300)
    ratio = kinney_graham_nuclear_pressure(r, ONE_KILOTON) / dna_1kt_pressure(
        r, ONE_KILOTON
    )
    assert float(ratio.min()) == pytest.approx(1.00, abs=0.005)
    assert float(ratio.max()) == pytest.approx(1.22, abs=0.005)


def test_its_duration_is_near_that_of_tnt_from_a_scaled_metre_on():
    z = jnp.geomspace(1.0, 40.0, 300)
    ratio = kinney_graham_nuclear_duration(z, 1.0) / kingery_bulmash_duration(
        z, 1.0, burst="free-air"
    )
    assert float(ratio.min()) == pytest.approx(0.89, abs=0.005)
    assert float(ratio.max()) == pytest.approx(1.22, abs=0.005)
    near = kinney_graham_nuclear_duration(0.2, 1.0) / kingery_bulmash_duration(
        0.2, 1.0, burst="free-air"
    )
    assert float(near) == pytest.approx(10.0, abs=0.5)


@pytest.mark.parametrize(
    ("law", "near", "far"),
    [
        (kinney_graham_nuclear_pressure, -3.0, -1.0),
        (kinney_graham_nuclear_duration, 0.0, 0.0),
    ],
)
def test_at_both_ends_it_is_a_power_of_the_distance(law, near, far):
    def slope(r):
        log_law = lambda x: jnp.log(law(jnp.exp(x), ONE_KILOTON))  # noqa: E731
        return float(jax.grad(log_law)(math.log(r)))

    # the nearest bends: z/40 with half a share, (z/50000)^-1 with a sixth, 800/z
    assert slope(1e-4) == pytest.approx(near, abs=5e-6)
    assert slope(1e9) == pytest.approx(far, abs=1e-4)


def test_it_holds_in_free_air_from_16_to_4000_metres_for_a_kiloton():
    r = np.array([15.9, 16.1, 3990.0, 4010.0])
    assert kinney_graham_nuclear_valid(r, ONE_KILOTON).tolist() == [
        False,
        True,
        True,
        False,
    ]
    assert not kinney_graham_nuclear_valid(100.0, ONE_KILOTON, burst="surface")
