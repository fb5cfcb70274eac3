"""What a log does not identify is reported as such, not as a value."""

import dataclasses

import numpy as np
import pytest

from calibration.stability_fits import (
    MIRRORED,
    SIGMA,
    WU_HAO_NULL,
    line,
    ring,
    solved_log,
    wu_hao_solution,
)
from jblast.errors import InputError
from jblast.inference import ensemble, fit
from jblast.inference.fitting.findings import NoPointSource
from jblast.observations import Observations
from jblast.scene import Charge, Free, Scene, UncertainScene
from jblast.waves import kingery_bulmash_arrival_time

pytestmark = pytest.mark.slow


def test_the_mirror_image_of_a_charge_next_to_a_line_is_an_ambiguity():
    found = solved_log(line(), *MIRRORED)
    answer = fit(found.log, found.uncertain, noise="gaussian")
    (other,) = answer.summary.ambiguities
    north = answer.summary.estimates["charge_north_m"].value
    assert other.parameters["charge_north_m"] == pytest.approx(-north, abs=1e-3)
    assert not answer.summary.identifiable
    assert answer.exit_code == 4


def test_sensors_at_one_position_identify_neither_mass_nor_position():
    one = solved_log(ring()[:1] * 8, 30.0, 10.0, -5.0)
    answer = fit(one.log, one.uncertain, noise="gaussian")
    assert len(answer.summary.null_directions) == 2
    assert not any(each.identified for each in answer.summary.estimates.values())
    assert answer.exit_code == 4


def test_an_outlier_of_20_sd_is_suspected_alone():
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    value = clean.log.value.copy()
    value[0] += 20 * SIGMA
    log = dataclasses.replace(clean.log, value=value)
    suspects = fit(log, clean.uncertain).summary.suspected_outliers
    assert [one.sensor for one in suspects] == [clean.log.sensor[0]]


def test_mass_and_both_speeds_of_wu_hao_have_one_null_direction_and_no_walk():
    found = wu_hao_solution()
    (null,) = found.identifiability.null
    np.testing.assert_allclose(null, WU_HAO_NULL, atol=1e-6)
    assert not any(found.identifiability.determined)
    with pytest.raises(InputError, match=r"improper along charge_mass_kg.*a prior"):
        ensemble(found.posterior, found.laplace, found.identifiability)


@pytest.mark.parametrize("explosive", ["TNT", "nuclear"])
def test_a_fit_of_tnt_by_a_law_of_a_point_source_has_a_warning(explosive):
    # photographs of 15 kg of TNT, at Z = 0.2 to 0.5: the mass comes out a fifth
    radius = np.array([0.2, 0.3, 0.4, 0.5]) * 15.0 ** (1.0 / 3.0)
    time = np.asarray(kingery_bulmash_arrival_time(radius, 15.0, burst="free-air"))
    log = Observations(
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
    scene = Scene(charge=Charge(explosive=explosive), law=law)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Free(positive=True)})
    summary = fit(log, uncertain, noise="gaussian").summary
    warned = any(isinstance(one, NoPointSource) for one in summary.warnings)
    assert warned == (explosive == "TNT")
    if warned:
        assert summary.estimates["charge_mass_kg"].value < 5.0
