"""Factors of units are their definitions, to the last digit."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.units import LN_PER_DB, SI, SUFFIXES, overpressure, si_factor


@pytest.mark.parametrize(
    ("suffix", "factor"),
    [
        ("ft", 0.3048), ("in", 0.0254), ("yd", 0.9144), ("mi", 1609.344),
        ("nmi", 1852.0), ("kPa", 1e3), ("mbar", 1e2), ("bar_ms", 1e2),
        ("atm", 101325.0), ("psi", 6894.757293168361), ("lb", 0.45359237),
        ("torr", 101325.0 / 760), ("km_h", 1e3 / 3600), ("percent", 0.01),
        ("ksi", 6894757.293168361), ("deg", np.pi / 180), ("kn", 1852 / 3600),
    ],
)  # fmt: skip
def test_a_factor_is_the_definition(suffix, factor):
    # NIST SP 811 (2008), appendix B; psi is 0.45359237 * 9.80665 / 0.0254**2
    assert si_factor(suffix) == pytest.approx(factor, rel=2e-16)


@pytest.mark.parametrize("dimension", SI)
def test_every_ending_has_a_factor_and_ours_is_one(dimension):
    factors = {s: si_factor(s) for s in list(SUFFIXES[dimension])[:40]}
    assert factors[SI[dimension]] == 1.0
    assert all(np.isfinite(f) and f > 0 for f in factors.values())


@pytest.mark.parametrize(
    ("suffix", "said"),
    [("mpa", "expected MPa or mPa"), ("kpal", "a known unit"), ("db", "no factor")],
)
def test_what_is_no_unit_is_told(suffix, said):
    with pytest.raises(InputError, match=said):
        si_factor(suffix)


def test_a_peak_level_is_above_twenty_micropascals():
    # IEC 61672-1: 94 dB is 1.0024 Pa, what calibrators give; 0 dB is 20 uPa
    levels = np.array([0.0, 94.0, 120.0, 180.0])
    pascals = [2e-5, 1.00237, 20.0, 20_000.0]
    np.testing.assert_allclose(overpressure(levels), pascals, rtol=1e-5)


def test_an_error_in_decibels_is_one_in_ln_at_any_size():
    level, sigma = np.array([100.0, 150.0]), 6.0  # not small: the law is exact
    up = np.log(overpressure(level + sigma) / overpressure(level))
    down = np.log(overpressure(level) / overpressure(level - sigma))
    np.testing.assert_allclose(up, sigma * LN_PER_DB, rtol=1e-12)
    np.testing.assert_allclose(down, sigma * LN_PER_DB, rtol=1e-12)
