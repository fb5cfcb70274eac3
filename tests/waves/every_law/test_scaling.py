"""Every law scales as blasts do, with the charge and with the air, or is named."""

import numpy as np
import pytest

from tests.waves.every_law.laws import every_law, grid, in_blocks

LENGTHS = ("slant_range", "ground_range", "height_of_burst", "sensor_height")
LENGTHS += ("toward_east", "toward_north", "toward_up")


def grows_as(quantity: str) -> float:
    """Power of the length scale by which a quantity grows, pressures kept."""
    if quantity.endswith(("_m_s", "_pa", "_px", "_rad")):
        return 0.0
    return 1.0  # lengths, times, and impulses: pressure times time


KNOWS_NO_AIR = ("fireball", "ground_motion")
"""Laws that scale with the charge alone, whatever the air."""
OWN_LENGTHS = {
    "wu_hao": "its constants have units, and it knows no ambient pressure",
    "weak_shock_iso": "the air absorbs over lengths and times of its own",
}
"""Laws that no scaling law holds for, by design, and why."""


@every_law
def test_hopkinson_and_cranz_a_larger_blast_is_the_same_blast_at_a_larger_scale(
    law, word
):
    if law.name in OWN_LENGTHS:
        pytest.skip(OWN_LENGTHS[law.name])
    values, k = grid(60, seed=8), 7.0
    larger = dict(values) | {n: values[n] * k for n in LENGTHS}
    larger |= {"charge_mass": values["charge_mass"] * k**3}
    larger |= {n: values[n] * k for n in ("time_since_detonation", "fireball_growth")}
    ratio = in_blocks(law, word, larger) / in_blocks(law, word, values)
    # a sum of logarithms of up to 20: a few roundings of 2e-15 each, steep curves
    np.testing.assert_allclose(ratio, k ** grows_as(law.quantity), rtol=1e-11)


@every_law
def test_sachs_in_denser_air_a_larger_charge_is_the_same_blast(law, word):
    if law.name in OWN_LENGTHS:
        pytest.skip(OWN_LENGTHS[law.name])
    if law.name in KNOWS_NO_AIR:
        pytest.skip("it scales with the charge alone")
    values, k = grid(60, seed=9), 1.7
    scaled = ("charge_mass", "ambient_pressure", "air_density")
    denser = dict(values) | {n: values[n] * k for n in scaled}
    ratio = in_blocks(law, word, denser) / in_blocks(law, word, values)
    # The strong shock starts where the charge ends, which air has no part in.
    early = law.name == "sedov_taylor" and (
        values["time_since_detonation"]
        < 2 * law.joins[0] * np.cbrt(values["charge_mass"])
    )
    has_pressure = "_pa" in law.quantity
    expected = np.where(early, ratio, k if has_pressure else 1.0)
    np.testing.assert_allclose(ratio, expected, rtol=1e-11)
