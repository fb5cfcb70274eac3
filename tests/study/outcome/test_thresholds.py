"""Thresholds of pressure are named as thresholds, with their published values."""

import pytest

from jblast.study.outcome.quantities import LIMITS

KPA = {
    # Clancey 1972, printed in kPa: "typical pressure for glass breakage"
    "above_glass_threshold": 1.03,
    # Zipf and Cashdollar 2007 print 5 and 15 psi; 1 psi is 6.8948 kPa
    "above_eardrum_threshold": 5 * 6.8948,
    "above_lung_threshold": 15 * 6.8948,
}


@pytest.mark.parametrize("name", KPA)
def test_a_threshold_has_its_published_value(name):
    assert LIMITS[name].value == pytest.approx(1e3 * KPA[name], rel=5e-3)
