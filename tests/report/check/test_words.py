"""Every kind of doubt has its sentence, and a page says what was understood."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

import jblast
from jblast.observations.check import Doubt
from jblast.observations.places import Frame
from jblast.report.check import (
    SENTENCES,
    check_answer,
    check_text,
    sentence,
    setting_lines,
)
from jblast.scene import default_scene

PACKAGE = Path(jblast.__file__).parent
LOG = jblast.read(PACKAGE.parent / "calibration" / "data" / "five_microphones.csv")
NUMBERS = (
    *("value", "other", "share", "apart_m", "early_s", "largest", "distance_m"),
    *("mass_kg", "fireball_m", "nearer", "nearer_m", "before", "late_s", "ratio"),
    *("slowest_m_s", "took_s", "fastest_m_s", "agree", "rows", "east_m", "north_m"),
    *("factor", "lat_deg", "lon_deg", "speed_m_s"),
)
FOUND_IN = [
    *(PACKAGE / "inference" / name for name in ("consensus.py", "sanity.py")),
    PACKAGE / "observations" / "check.py",
]


def test_every_doubt_that_can_be_found_has_its_sentence():
    text = "".join(path.read_text("utf-8") for path in FOUND_IN)
    named = set(re.findall(r'Doubt\(\s*"(\w+)"', text))
    assert len(named) > 20
    assert named <= set(SENTENCES)


def test_a_clock_time_and_a_place_are_told_as_they_came():
    doubt = Doubt("off_in_time", (0,), {"late_s": 2.0, "mass_kg": 3.0})
    since = replace(LOG, epoch=datetime(2020, 8, 4, 15, 8, 18, tzinfo=UTC))
    assert "air arrival at 15:08:19.217 UTC is 2 s too late" in sentence(doubt, since)
    assert "air arrival of 1.218 s is 2 s too late" in sentence(doubt, LOG)
    numbers = {"east_m": 0.0, "north_m": 0.0}
    moved = Doubt("place_in_feet", (0,), numbers, ("m1",))
    assert "east 0 m, north 0 m: is it in feet?" in sentence(moved, LOG)
    placed = replace(LOG, frame=Frame(33.9, 35.5, 10.0))
    assert "33.90000° N, 35.50000° E" in sentence(moved, placed)


def test_datum_clock_and_what_a_fit_frees_are_told():
    told = replace(
        LOG,
        frame=Frame(33.9, -35.5, 10.0),
        epoch=datetime(2020, 8, 4, 15, 8, 18, tzinfo=UTC),
    )
    datum, clock, free = setting_lines(told, default_scene())
    assert "33.90000° N, 35.50000° W, 10 m, the centre of the sensors" in datum
    assert clock == "time zero is 2020-08-04 15:08:18 UTC"
    assert free.endswith("charge mass, charge east, charge north and origin time")
    assert setting_lines(LOG, default_scene()) == [free]


def test_what_is_said_of_many_lines_is_said_once():
    faults = [
        jblast.errors.InputError(f"{LOG.source}: line {line}: expected more")
        for line in (12, 4, 5, 6, 7, 8, 123)
    ]
    text = check_text(check_answer(LOG, faults, []))
    assert "A fit would reject this log: 7 faults" in text
    assert text.count("expected more") == 1
    assert "lines 4, 5, 6, 7, 8 and 2 more: expected more" in " ".join(text.split())
    known = "; expected one of a, b"
    faults = [
        jblast.errors.InputError(f"{LOG.source}: line {i}: no {i}{known}")
        for i in (4, 5, 6)
    ]
    text = check_text(check_answer(LOG, faults, []))
    assert text.count("expected one of") == 1
    assert "no 4; expected one of a, b" in text
    faults = [
        jblast.errors.InputError(f"{LOG.source}: line {i}: expected a zone; got '{i}'")
        for i in (4, 5, 6)
    ]
    text = check_text(check_answer(LOG, faults, []))
    assert "lines 4, 5 and 6: expected a zone; got '4' and others" in text
    many = Doubt("units_of_a_quantity", tuple(range(10)), {}, ("air_arrival_s", "x"))
    text = check_text(check_answer(LOG, [], [many]))
    assert "and 5 more: every air arrival (10 rows)" in " ".join(text.split())


@pytest.mark.parametrize("value", [1e-300, 1.0, 1e300])
def test_numbers_of_any_size_are_printed(value):
    log = replace(LOG, value=np.full(len(LOG), value))
    numbers = {name: value for name in NUMBERS}
    for kind in SENTENCES:
        name = "peak_overpressure_pa"
        doubt = Doubt(kind, (5, 6), numbers, (name, "a thousandth of"))
        assert sentence(doubt, log)
