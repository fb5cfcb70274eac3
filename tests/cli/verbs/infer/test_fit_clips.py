"""Six phone clips, as people have them: from the file alone to a place on the Earth."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from jblast.observations import read
from jblast.observations.places import Frame
from jblast.observations.scenes import for_log
from jblast.scene import default_scene

CLIPS = Path(__file__).parents[4] / "calibration" / "data" / "six_clips.csv"
TRUTH = {
    line.split()[2]: float(line.split()[4])
    for line in CLIPS.read_text().splitlines()
    if line.startswith("# truth")
}
ABOUT = Frame(33.9, 35.5, 20.0)


ASKED = ("--date", "2024-05-17", "--zone", "UTC")


def test_what_is_typed_then_frees_place_time_and_clocks():
    log = read(CLIPS, date="2024-05-17", zone="UTC")
    clocks = [f"clock_offset_s.clip_{number}" for number in range(2, 7)]
    place = ["charge_east_m", "charge_north_m", "origin_time_s"]
    uncertain = for_log(default_scene(), log)
    assert list(uncertain.beliefs) == ["charge_mass_kg", *place, *clocks]
    assert log.epoch == datetime(2024, 5, 17, 11, 50, 39, tzinfo=UTC)


@pytest.mark.slow  # nine numbers: their programs compile for longer than 10 J
def test_the_answer_holds_the_truth_in_degrees_and_utc(jblast):
    code, out, _ = jblast("fit", str(CLIPS), *ASKED, "--json")
    assert code == 0
    answer = json.loads(out)
    mass = answer["estimates"]["charge_mass_kg"]
    assert mass["q05"] < TRUTH["charge_mass_kg"] < mass["q95"]
    place = answer["place"]
    found = ABOUT.to_enu(
        *(np.array(place[key]) for key in ("lat_deg", "lon_deg", "alt_m"))
    )
    true = np.array([TRUTH["charge_east_m"], TRUTH["charge_north_m"]])
    (major, minor), azimuth = place["ellipse_90_m"], place["ellipse_azimuth_deg"]
    azimuth = np.radians(azimuth)
    along = np.array([np.sin(azimuth), np.cos(azimuth)])
    away = found[:2] - true
    across = away - (away @ along) * along
    # three times as wide an ellipse holds all but 1 in 1e8 of normal draws
    assert (away @ along / major) ** 2 + (across @ across) / minor**2 < 9
    seconds = answer["origin_time_utc"].removeprefix("2024-05-17T11:53:").rstrip("Z")
    # a frame is 33 ms long
    assert float(seconds) == pytest.approx(TRUTH["origin_time_s"] + 420, abs=0.034)
    assert answer["origin_clock"] == "clip_1"
