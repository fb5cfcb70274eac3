"""A written number in another unit is the float nearest to the exact product."""

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from jblast.units import products, si_ratio

WRITTEN = st.decimals(-(10**9), 10**9, places=6).map(str)


def test_what_is_short_stays_short():
    # 12.4 * 0.001 is 0.012400000000000001 in floating point
    assert repr(float(products(si_ratio("ms"), ["12.4"])[0])) == "0.0124"
    assert products(si_ratio("ft"), ["1.1"])[0] == 0.33528


@given(WRITTEN, st.sampled_from(["ms", "kPa", "ft", "psi", "in", "us", "torr", "lb"]))
def test_a_product_is_rounded_once(text, unit):
    exact = Fraction(Decimal(text)) * si_ratio(unit)
    # a division of whole numbers is rounded correctly by Python
    assert products(si_ratio(unit), [text])[0] == exact.numerator / exact.denominator


def test_two_written_numbers_are_multiplied_before_they_are_rounded():
    assert products(si_ratio("percent"), ["7"], ["12400"])[0] == 868.0


@pytest.mark.parametrize("text", ["", "nan", "inf", "sNaN", "1,5", "none"])
def test_what_is_no_number_gives_none(text):
    assert not np.isfinite(products(Fraction(1, 7), [text])[0])
