"""Which method tells how sure an answer is, and that both say the same of a normal."""

import numpy as np
import pytest
from logs import log

from jblast.inference import fit
from jblast.scene import Free, Scene, UncertainScene, freed
from jblast.waves import kingery_bulmash_pressure, wu_hao_air_arrival_time

SCENE = Scene(scatter=False)
MASS_FREE = UncertainScene(SCENE, {"charge_mass_kg": Free(positive=True)})


def pressures(sigma: float):
    return log(
        *(
            (f"s{i}", "peak_overpressure_pa", p, sigma * p, r)
            for i, r in enumerate((10.0, 20.0, 40.0))
            for p in [float(kingery_bulmash_pressure(r, 15.0))]
        ),
        at_range=True,
    )


def test_a_narrow_answer_is_left_to_the_normal_approximation():
    result = fit(pressures(0.01), MASS_FREE, noise="gaussian", posterior="auto")
    assert result.answer["posterior"] == "laplace"
    assert "k-hat" in result.posterior_reason
    assert result.answer["warnings"] == []


def test_a_wide_answer_gets_walkers_and_they_agree_where_it_is_normal():
    wide = fit(pressures(0.3), MASS_FREE, noise="gaussian", posterior="auto")
    assert wide.answer["posterior"] == "emcee"
    assert wide.answer["converged"]
    assert any("k-hat" in said for said in wide.answer["warnings"])
    normal = fit(pressures(0.3), MASS_FREE, noise="gaussian").answer
    by_walk = wide.answer["estimates"]["charge_mass_kg"]
    by_normal = normal["estimates"]["charge_mass_kg"]
    assert by_walk["value"] == by_normal["value"]
    # ln p is nearly straight in ln W: the two differ by the walk's error of 5 % of the
    # sd, and as much by the bend
    for quantile in ("q05", "q95"):
        apart = np.log(by_walk[quantile] / by_normal[quantile])
        assert abs(apart) < 0.15 * by_normal["log_sd"]
    assert by_walk["log_sd"] == pytest.approx(by_normal["log_sd"], rel=0.1)


def test_what_no_log_can_tell_is_not_walked_over():
    place = float(wu_hao_air_arrival_time(20.0, 15.0, 340.0))
    made = log(("a", "air_arrival_s", place, 1e-4, 20.0), at_range=True)
    scene = Scene(scatter=False, law=(("air_arrival_s", "wu_hao"),))
    uncertain = freed(UncertainScene(scene), ["charge_mass_kg", "air_sound_speed_m_s"])
    result = fit(made, uncertain, posterior="emcee")
    assert result.answer["posterior"] == "laplace"
    assert "untold" in result.posterior_reason
    assert not result.answer["identifiable"]
