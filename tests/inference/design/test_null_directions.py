"""Layouts that leave something open: null directions and mirror images."""

import numpy as np
import pytest

from jblast.inference import bound
from jblast.inference.posterior.parameters import Spread
from jblast.report.fit_report import cure_words
from jblast.scene import Free, LogNormal
from tests.inference.design.plans import MASS, PLACE, RING, TIME, C, scene_of, sentences

WU_HAO = (("air_arrival_s", "wu_hao"), ("ground_arrival_s", "wu_hao"))


@pytest.mark.parametrize("ranges", [[20.0], [15.0, 20.0, 30.0, 50.0]])
@pytest.mark.slow
def test_wu_hao_arrivals_never_tell_mass_from_speeds(ranges):
    free = {
        "charge_mass_kg": Free(positive=True),
        "air_sound_speed_m_s": Free(positive=True),
        "ground_p_speed_m_s": Free(positive=True),
    }
    places = {f"s{i}": (r, 0.0) for i, r in enumerate(ranges)}
    records = (("air_arrival_s", 1e-4), ("ground_arrival_s", 1e-5))
    at = {
        "charge_mass_kg": 15.0,
        "air_sound_speed_m_s": C,
        "ground_p_speed_m_s": 6000.0,
    }
    found = bound(scene_of(free, places, records, WU_HAO), at)
    (null,) = found.summary.null_directions
    weights = [round(null.parameters[name], 3) for name in free]
    assert weights == [1.0, -0.2, -0.02]
    assert null.space == "ln"
    assert "peak overpressure" in cure_words(null.cure)
    assert found.exit_code == 4
    assert found.summary.parameters == dict.fromkeys(free, Spread())
    # a pressure tells the mass; no arrival by the same law does
    helps = {e.quantity: e.left.is_known for e in reversed(found.summary.help)}
    assert helps["peak_overpressure_pa"]
    assert not helps["air_arrival_s"]
    text = sentences(found)
    assert "charge mass times 2.00, air sound speed times 0.871 and ground" in text
    assert "With a known air sound speed the sd of the charge mass would be" in text


@pytest.mark.slow
def test_sensors_in_a_line_leave_a_mirror_image():
    places = {"a": (-100.0, 0.0), "b": (0.0, 0.0), "c": (150.0, 0.0)}
    found = bound(
        scene_of(PLACE, places), {"charge_east_m": 30.0, "charge_north_m": 60.0}
    )
    (other,) = found.summary.ambiguities
    assert other.parameters["charge_east_m"] == pytest.approx(30.0, abs=1e-3)
    assert other.parameters["charge_north_m"] == pytest.approx(-60.0, abs=1e-3)
    assert found.summary.null_directions == ()
    assert found.exit_code == 4
    assert found.summary.parameters["charge_east_m"].sd > 0
    text = sentences(found)
    assert "Another solution fits nearly as well" in text
    assert "off the sensors' line" in text


@pytest.mark.slow
def test_clocks_all_unknown_tell_no_place_and_no_origin_time():
    clocks = {f"clock_offset_s.{name}": Free(positive=False) for name in RING}
    at = dict.fromkeys(clocks, 0.0) | {"charge_east_m": 5.0, "charge_north_m": 10.0}
    found = bound(scene_of(PLACE | clocks, RING), at)
    assert len(found.summary.null_directions) == 2  # six unknowns, four readings
    assert not any(s.is_known for s in found.summary.parameters.values())
    text = sentences(found)
    assert "clock offset of a, clock offset of b, clock offset of c and clock" in text
    beside_time = bound(
        scene_of(TIME | {"clock_offset_s.a": Free(positive=False)}, {"a": (50.0, 0.0)}),
        {"origin_time_s": 1.0, "clock_offset_s.a": 0.0},
    )
    (null,) = beside_time.summary.null_directions
    assert null.parameters == pytest.approx(
        {"origin_time_s": 1.0, "clock_offset_s.a": -1.0}
    )


@pytest.mark.slow
def test_far_out_the_mass_leans_on_a_prior_of_the_sound_speed():
    believed = MASS | {"air_sound_speed_m_s": LogNormal(C, 1.01)}
    mass, sds = 8.0, {}
    for z, expected in ((3.0, -0.25), (30.0, -0.03)):
        places = {"near": (z * 2.0, 0.0)}  # 8 kg: its cube root is 2
        uncertain = scene_of(believed, places, (("air_arrival_s", 1e-6),))
        found = bound(uncertain, {"charge_mass_kg": mass})
        (exponent, _) = found.summary.mass_exponents["air_arrival_s"]
        assert exponent == pytest.approx(expected, abs=0.005)  # the printed digits
        sd = found.summary.parameters["charge_mass_kg"].log_sd
        # t goes as W^n / c: 1 % of the speed is 1 % / n of the mass
        assert sd == pytest.approx(np.log(1.01) / abs(exponent), rel=1e-2)
        (lean,) = found.summary.leans_on
        assert lean.on == "air_sound_speed_m_s"
        assert lean.without_prior == Spread()
        assert lean.if_known.log_sd < 0.02 * sd
        text = sentences(found)
        assert "without the prior of the air sound speed: not identified" in text
        assert f"the air shock's travel time as W^{exponent:.2g}" in text
        sds[z] = sd
    assert sds[30.0] > 6 * sds[3.0]
    free = MASS | {"air_sound_speed_m_s": Free(positive=True)}
    alone = bound(
        scene_of(free, {"a": (60.0, 0.0)}),
        {"charge_mass_kg": mass, "air_sound_speed_m_s": C},
    )
    (null,) = alone.summary.null_directions
    # c = t^-1 goes as W^n: the direction turns by the exponent
    assert null.parameters["air_sound_speed_m_s"] == pytest.approx(-0.03, abs=0.005)
