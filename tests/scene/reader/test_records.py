"""What a sensor of a scene records, and how well."""

import pytest
from hypothesis import given, strategies as st

from jblast.quantities import ADDITIVE, QUANTITIES
from jblast.scene.reader.sensors import read_records, share_text


@pytest.mark.parametrize("text", ["5%", " 5 % ", "5.0%", "0.5e1%", "5.%"])
def test_a_share_is_a_hundredth_of_its_percentage(text):
    ((quantity, sigma),) = read_records({"peak_overpressure_pa": text}, "s")
    assert (quantity, sigma) == ("peak_overpressure_pa", 0.05)


@given(st.sampled_from(list(QUANTITIES)), st.floats(1e-4, 10.0))
def test_what_is_written_for_a_sigma_is_read_again(quantity, sigma):
    """To the three digits that are written, half of the last: 0.5 %."""
    text = share_text(sigma).strip('"')
    told = sigma if quantity in ADDITIVE else text
    ((_, again),) = read_records({quantity: told}, "s")
    assert again == pytest.approx(sigma, rel=5e-3)
