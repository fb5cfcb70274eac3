"""A line of microphones with the source near its axis: no place with exit code 0."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jblast.inference import fit
from jblast.observations import read

CASES = Path(__file__).parent / "arrays" / "line_end"
ROUNDINGS = (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("rounding", ROUNDINGS)
@pytest.mark.parametrize("log", sorted(CASES.glob("*.csv")), ids=lambda log: log.stem)
def test_a_place_beside_the_line_is_no_answer(log, rounding):
    # six microphones on the east axis, 20 kg at 200 or 500 m; times exact to 0.1 us
    scene = CASES / f"{log.stem.rpartition('_')[2]}.toml"
    made = read(log)
    moved = np.random.default_rng(rounding).choice([-1e-7, 0.0, 1e-7], len(made))
    made = replace(made, value=made.value + (rounding > 0) * moved)
    assert fit(made, scene).exit_code == 4
