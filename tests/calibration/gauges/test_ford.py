"""Ford's shots: the printed ratios, and what height explains of them."""

import pytest

from calibration import gauge_ford
from calibration.ford_2021 import QUANTITIES

IMPULSE, DURATION = QUANTITIES


@pytest.fixture(scope="module")
def shots():
    return {shot.name: shot for shot in gauge_ford.shots()}


# Observed over predicted impulse and duration, as the collected formulas print them
# (section 8, of Sachs' scaling).
PRINTED = {
    "HRI-2": (0.94, 0.97),
    "HRI-3": (0.88, 0.97),
    "HRI-5": (0.86, 0.87),
    "HRI-6": (0.66, 0.80),
    "HTA-1": (1.34, 1.01),
    "HTA-2": (1.22, 1.14),
    "HTA-3": (0.99, 1.10),
    "HTP-1": (1.14, 0.96),
    "HTP-3": (1.13, 1.14),
    "HTP-5": (0.86, 0.80),
}


@pytest.mark.parametrize("name", PRINTED)
def test_the_printed_ratios_come_out_to_their_digits(shots, name):
    ratio = shots[name].ratio["KB"]
    assert (round(ratio[IMPULSE], 2), round(ratio[DURATION], 2)) == PRINTED[name]


def test_every_record_is_inside_the_table(shots):
    near = gauge_ford.near_records()
    assert sum(shot.n_records for shot in shots.values()) == len(near.shot)
    assert all(shot.scaled_range[1] <= 40.0 for shot in shots.values())
    # h/W^(1/3) as printed beside the ratios
    told = {name: round(shots[name].scaled_height, 2) for name in ("HTA-1", "HTP-5")}
    assert told == {"HTA-1": 0.81, "HTP-5": -0.05}


def test_the_ground_term_is_what_ford_2021_says_of_a_buried_over_a_high_shot(shots):
    # ford over KB,ground is the same in shots of one place: the ground is in both.
    def left(name):
        ratio = shots[name].ratio
        return ratio["ford"][IMPULSE] / ratio["KB, ground"][IMPULSE]

    # at Z = 21.8 both, at heights of +0.38 and -0.05
    assert left("HTP-3") == pytest.approx(left("HTP-5"), rel=1e-9)


def test_height_explains_the_impulse(shots, said):
    some = list(shots.values())
    upper = gauge_ford.shallow(some)
    assert gauge_ford.rank_correlation(some, "KB", IMPULSE) > 0.9
    assert gauge_ford.rank_correlation(upper, "KB", IMPULSE) > 0.9
    for group in (some, upper):
        assert gauge_ford.explained(group, "KB, ground", IMPULSE) > 0.8
        assert 0 < gauge_ford.explained(group, "ford", DURATION) < 0.6
    share = 100 * gauge_ford.explained(some, "KB, ground", IMPULSE)
    assert f"takes {share:.0f} % of the variance in ln" in said


def test_the_deepest_last_as_long_as_those_on_the_ground(shots):
    ground = [
        shot.ratio["KB"][DURATION]
        for shot in shots.values()
        if abs(shot.scaled_height) < 0.15
    ]
    for name in ("HTA-5", "HRI-7"):
        assert min(ground) < shots[name].ratio["KB"][DURATION] < max(ground)
