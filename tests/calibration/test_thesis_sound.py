from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "calibration" / "results" / "thesis_sound.txt"


def kept(row: str) -> list[float]:
    """Numbers of a row of the kept table."""
    (line,) = [x for x in KEPT.read_text().splitlines() if x.startswith(row)]
    return [float(word) for word in line.removeprefix(row).split()]


def test_the_kept_arrivals_are_the_printed_equations():
    """Equations 3.3 and 3.4 of the thesis, at 20 m of 15 kg."""
    ground = 1e3 * 0.91 * 20.0**1.03 * 15.0**-0.02 / 6000.0
    air = 1e3 * 0.34 * 20.0**1.4 * 15.0**-0.2 / 340.0
    # printed to 0.01 ms
    assert kept("ground arrival [ms]") == [pytest.approx(ground, abs=6e-3)]
    assert kept("air arrival [ms]") == [pytest.approx(air, abs=6e-3)]
    apart, observed = kept("air minus ground [ms]")
    assert apart == pytest.approx(air - ground, abs=6e-3)
    # section 4.2.1.1: 1.91778 s and 1.88535 s
    assert observed == pytest.approx(1e3 * (1.91778 - 1.88535), abs=6e-3)
