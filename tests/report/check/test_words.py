"""Every kind of doubt has its sentence, and a page says what was understood."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jblast
from jblast.observations.check import Doubt
from jblast.report.check import (
    SENTENCES,
    sentence,
)

PACKAGE = Path(jblast.__file__).parent
LOG = jblast.read(PACKAGE.parent / "calibration" / "data" / "five_microphones.csv")
NUMBERS = (
    *("share", "apart_m", "early_s", "largest", "distance_m", "mean_m_s"),
    *("mass_kg", "fireball_m", "nearer_m", "late_s", "ratio"),
    *("slowest_m_s", "fastest_m_s", "agree", "rows", "east_m", "north_m"),
    *("factor", "lat_deg", "lon_deg", "speed_m_s"),
)
FOUND_IN = [
    *(PACKAGE / "inference" / name for name in ("consensus.py", "sanity.py")),
    PACKAGE / "observations" / "check.py",
]


def test_every_doubt_that_can_be_found_has_its_sentence():
    text = "".join(path.read_text("utf-8") for path in FOUND_IN)
    named = set(re.findall(r'Doubt\(\s*"(\w+)"', text))
    assert len(named) > 15
    assert named <= set(SENTENCES)


@pytest.mark.parametrize("value", [1e-300, 1.0, 1e300])
def test_numbers_of_any_size_are_printed(value):
    log = replace(LOG, value=np.full(len(LOG), value))
    numbers = {name: value for name in NUMBERS}
    for kind in SENTENCES:
        name = "peak_overpressure_pa"
        doubt = Doubt(kind, (5, 6), numbers, (name, "a thousandth of"))
        assert sentence(doubt, log)
