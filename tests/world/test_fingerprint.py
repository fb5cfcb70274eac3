"""What a seeded world is made of, in numbers: to be compared between machines.

    python -m tests.world.test_fingerprint

writes tests/world/data/fingerprint.json on the machine that it runs on.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jblast.scene.reader import world_from_document
from jblast.study.run_files import blasts_csv
from jblast.world import DrawnWorld, arrivals_of, draw_world, readings_of

KEPT = Path(__file__).parent / "data" / "fingerprint.json"
RECORDS = {
    "flash_time_s": 1e-3,
    "ground_arrival_s": 1e-3,
    "air_arrival_s": 1e-4,
    "peak_overpressure_pa": "5%",
}
DOCUMENT: dict[str, Any] = {
    "world": {
        "count": 3,
        "region_m": {"ring": [10, 20]},
        "mass_kg": {"lognormal": [8.0, 1.5]},
        "time_s": {"uniform": [1, 4]},
        "gap_s": 0.5,
    },
    "sensor": [
        {"name": "east", "position_m": [60.0, 0.0, 1.5], "records": RECORDS},
        {"name": "north", "position_m": [0.0, 45.0, 1.5], "records": RECORDS},
    ],
}
SEED = 22


def world() -> DrawnWorld:
    """Return the world."""
    return draw_world(*world_from_document(DOCUMENT, "w.toml"), SEED)


def by_laws() -> dict[str, Any]:
    """Return the text of the blasts, when waves come, and what was read."""
    drawn = world()
    arrivals = arrivals_of(drawn.scene)
    log, _ = readings_of(drawn, arrivals, np.inf)
    assert log is not None
    times = {name: np.asarray(x) for name, x in arrivals.times_s.items()}
    return {
        "blasts.csv": blasts_csv(drawn, []),
        **{f"{name}, when": times[name].ravel().tolist() for name in sorted(times)},
        "read": np.asarray(log.value).tolist(),
        "sigma": np.asarray(log.error_scale()).tolist(),
    }


CLOSE = 1e-12
"""Relative, of the largest of its kind: rounding of other libraries of functions.

The manual promises it. The tables of laws keep it: slopes have errors of 1e-13, and the
errors that decide how many nodes a table has are 3 % or more from their bound. Another
form, table or bound of a law changes times by up to its tolerance, 1e-7 in ln: then the
file is to be made again.
"""


@pytest.fixture(scope="module")
def kept():
    return json.loads(KEPT.read_text())


def compare(found, kept):
    assert found
    for name, values in found.items():
        if isinstance(values, str):
            assert values == kept[name], name
            continue
        expected = np.array(kept[name])
        scale = CLOSE * np.abs(expected[np.isfinite(expected)]).max()
        np.testing.assert_allclose(
            values, expected, rtol=CLOSE, atol=scale, err_msg=name
        )


def test_blasts_are_the_same_text_and_readings_the_same_numbers(kept):
    compare(by_laws(), kept)


if __name__ == "__main__":
    from jblast.cli.jax_start import start_jax

    start_jax()
    KEPT.write_text(json.dumps(by_laws(), indent=1) + "\n")
