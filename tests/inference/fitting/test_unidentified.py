"""What a log cannot tell, in the words its reader gets. A planned one: `test_bound`."""

from dataclasses import replace

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit
from jblast.inference.fitting.unidentified import WIDEST_FACTOR
from jblast.report import summary
from jblast.scene import LogNormal, UncertainScene, freed
from jblast.waves import kingery_bulmash_pressure, shock_kinematics_arrival_time
from tests.catalogue import (
    AROUND,
    KNOWN_MASS as MASS,
    PLACE,
    SOUND_SPEED as C,
    TIMED as SCENE,
    arrivals,
    travel_time as travel,
)
from tests.inference.logs import log

pytestmark = pytest.mark.slow  # each log compiles its own search

RING = AROUND[:4]


def told(made, free, **beliefs):
    """The answer, and its text on one line."""
    uncertain = freed(UncertainScene(SCENE, beliefs), free)
    found = fit(made, uncertain)
    return found, " ".join(summary(found).split())


def test_three_sensors_with_the_charge_outside_their_triangle_leave_a_second_place():
    triangle = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)]
    free = [*PLACE, "origin_time_s"]
    found, text = told(arrivals(triangle, -20.0, -20.0, 1.0), free)
    (other,) = found.summary.ambiguities
    both = [
        {name: of.value for name, of in found.summary.estimates.items()},
        other.parameters,
    ]
    one, two = sorted(both, key=lambda values: values["origin_time_s"])
    for name, true in zip(free, (-20.0, -20.0, 1.0), strict=True):
        assert one[name] == pytest.approx(true, abs=1e-2)
    # the second explains the arrivals as well, to a hundredth of their sigma
    again = arrivals(triangle, *(two[name] for name in free))
    np.testing.assert_allclose(again.value, found.observations.value, atol=1e-6)
    assert found.exit_code == 4
    assert "Another solution fits nearly as well" in text
    assert "in charge_east_m, charge_north_m, origin_time_s" in text
    assert "Add: a" in text
    within = told(arrivals(triangle, 30.0, 30.0, 1.0), free)[0]
    assert within.exit_code == 0


def test_clocks_all_unknown_are_refused_with_what_would_help():
    clocks = [f"clock_offset_s.{name}" for name in "abcd"]
    with pytest.raises(InputError, match=r"4 clock times .* 5 unknown.*flash_time_s"):
        told(arrivals(RING, 5.0, 10.0), [*PLACE, "origin_time_s", *clocks])


def test_a_mass_told_by_arrivals_alone_has_an_interval_and_no_value():
    scene = replace(SCENE, law=(), scatter=True)
    free = ["charge_mass_kg", *PLACE, "origin_time_s"]
    made = arrivals(RING, 5.0, 10.0)
    found = fit(made, freed(UncertainScene(scene), free))
    mass = found.summary.estimates["charge_mass_kg"]
    assert mass.q95 / mass.q05 > WIDEST_FACTOR
    assert mass.q05 < MASS < mass.q95
    assert not mass.identified
    assert np.isnan([mass.value, mass.sd, mass.log_sd]).all()
    for name, true in zip(PLACE, (5.0, 10.0), strict=True):
        place = found.summary.estimates[name]
        assert place.identified
        assert place.q05 < true < place.q95
    assert not found.summary.derived["charge_energy_j"].identified
    text = " ".join(summary(found).split())
    assert "The charge mass is not identified (" in text
    assert "); position and time are." in text
    # the law was chosen again at the answer, where it holds
    assert found.summary.law_valid
    assert found.exit_code == 0


def test_sensors_all_at_one_place_are_told_to_spread():
    made = arrivals([(60.0, 0.0)] * 3, 30.0, 40.0)
    found, text = told(made, PLACE)
    (null,) = found.summary.null_directions
    assert null.space == "linear"
    assert "do not separate the charge east and charge north" in text
    assert "or an air arrival at a new position" in text
    assert found.exit_code == 4


def test_far_out_the_mass_rests_on_the_prior_of_the_sound_speed():
    sds = {}
    for z in (3.0, 30.0):
        r = z * MASS ** (1 / 3)
        made = log(("a", "air_arrival_s", travel(r), 1e-6, r), at_range=True)
        free = ["charge_mass_kg"]
        believed = {"air_sound_speed_m_s": LogNormal(C, 1.01)}
        found, _ = told(made, free, **believed)
        sds[z] = found.summary.estimates["charge_mass_kg"].log_sd
        step = [
            np.log(float(shock_kinematics_arrival_time(r, MASS * f, 101325.0, C)))
            for f in (0.99, 1.01)
        ]
        exponent = (step[1] - step[0]) / np.log(1.01 / 0.99)
        # t goes as W^n / c: 1 % of the speed is 1 % / n of the mass
        assert sds[z] == pytest.approx(np.log(1.01) / abs(exponent), rel=0.05)
    # n falls from -0.25 to -0.03
    assert 6 < sds[30.0] / sds[3.0] < 11
    found, text = told(made, [*free, "air_sound_speed_m_s"])
    assert "do not separate the charge mass and air sound speed" in text
    assert "Add: a prior on, or a measurement of, charge_mass_kg or air_sound" in text
    assert found.exit_code == 4


def test_fewer_data_than_unknowns_are_answered_and_marked():
    p = float(kingery_bulmash_pressure(40.0, MASS))
    made = log(("a", "peak_overpressure_pa", p, 0.05 * p, (40.0, 0.0, 0.0)))
    found, text = told(made, ["charge_mass_kg", *PLACE])
    assert len(found.summary.null_directions) == 2
    assert found.exit_code == 4
    assert "no more recordings than free" in text
