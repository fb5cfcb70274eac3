"""What a log cannot tell, in the words its reader gets."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.under_determined import KINDS, ended, fault, logs
from jblast.errors import InputError
from jblast.inference import fit
from jblast.observations import Observations, read
from jblast.report import summary
from jblast.scene import Charge, Free, Scene, UncertainScene, freed
from jblast.waves import kingery_bulmash_arrival_time
from tests.catalogue import AROUND, KNOWN_MASS as MASS, PLACE, TIMED as SCENE, arrivals

pytestmark = pytest.mark.slow  # each log compiles its own search

RING = AROUND[:4]
CASES = sorted((Path(__file__).parent / "arrays" / "line_end").glob("*.csv"))


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
    assert np.isnan(mass.q05)  # a smaller charge would be heard like sound
    assert mass.q95 > MASS
    assert not mass.identified
    assert np.isnan([mass.value, mass.sd, mass.log_sd]).all()
    for name, true in zip(PLACE, (5.0, 10.0), strict=True):
        place = found.summary.estimates[name]
        assert place.identified
        assert place.q05 < true < place.q95
    assert not found.summary.derived["charge_energy_j"].identified
    text = " ".join(summary(found).split())
    assert "Charge mass not identified at most" in text
    # the law was chosen again at the answer, where it holds
    assert found.summary.law_valid
    assert found.exit_code == 0


@pytest.mark.parametrize("explosive", ["TNT", "nuclear"])
def test_a_fit_of_tnt_by_a_law_of_a_point_source_has_a_warning(explosive):
    # photographs of 15 kg of TNT, at Z = 0.2 to 0.5: the mass comes out a fifth
    radius = np.array([0.2, 0.3, 0.4, 0.5]) * 15.0 ** (1.0 / 3.0)
    time = np.asarray(kingery_bulmash_arrival_time(radius, 15.0, burst="free-air"))
    made = Observations(
        sensor=("camera",) * 4,
        quantity=("shock_radius_m",) * 4,
        value=radius,
        sigma=0.01 * radius,
        position=np.full((4, 3), np.nan),
        slant_range=np.full(4, np.nan),
        time=time,
        path=("",) * 4,
        shot=("",) * 4,
        clock=("",) * 4,
    )
    law = (("shock_radius_m", "sedov_taylor"),)
    scene = Scene(Charge(explosive=explosive), law=law)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Free(positive=True)})
    answer = fit(made, uncertain, noise="gaussian").summary
    warned = any(one.kind == "no_point_source" for one in answer.warnings)
    assert warned == (explosive == "TNT")
    if warned:
        assert answer.estimates["charge_mass_kg"].value < 5.0


def test_under_determined_logs_of_every_kind_end_with_a_sentence():
    every = len(KINDS)
    made = logs(10 * every, every, seed=1)
    ends = [(kind, fault(ended(one))) for kind, one in made]
    assert [end for end in ends if end[1]] == []


@pytest.mark.parametrize("rounding", [0, 1])
@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_a_place_beside_the_line_is_no_answer(path, rounding):
    # six microphones on the east axis, 20 kg at 200 or 500 m; times exact to 0.1 us
    scene = path.with_name(f"{path.stem.rpartition('_')[2]}.toml")
    made = read(path)
    moved = np.random.default_rng(rounding).choice([-1e-7, 0.0, 1e-7], len(made))
    made = replace(made, value=made.value + (rounding > 0) * moved)
    assert fit(made, scene).exit_code == 4
