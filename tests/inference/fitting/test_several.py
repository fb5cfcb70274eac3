"""Several charges, clocks that do not agree, wind, and explosives other than TNT."""

import dataclasses

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit
from jblast.report.messages import sentence_of
from jblast.scene import (
    Air,
    Charge,
    Free,
    LogNormal,
    Scene,
    Sensor,
    UncertainScene,
    freed,
)
from jblast.waves import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
)
from tests.inference.logs import log

RING = [(30.0, 0.0, 0.0), (0.0, 40.0, 0.0), (-50.0, 5.0, 0.0), (10.0, -60.0, 0.0)]
C = 340.29
AIR = Air(sound_speed=C)


def arrival(place, at, mass, time, c=C):
    distance = float(np.linalg.norm(np.subtract(place, at)))
    return time + float(kingery_bulmash_arrival_time(distance, mass, sound_speed=c))


def of_shots(made, shots):
    return dataclasses.replace(made, shot=tuple(shots))


@pytest.mark.slow
def test_two_charges_are_told_apart_by_the_shot_of_each_row():
    truth = {"one": (15.0, (2.0, 1.0, 0.0), 0.5), "two": (40.0, (-4.0, 3.0, 0.0), 3.0)}
    rows = [
        (f"s{i}", "air_arrival_s", arrival(place, at, mass, time), 1e-4, place)
        for mass, at, time in truth.values()
        for i, place in enumerate(RING)
    ]
    made = of_shots(log(*rows), ["one"] * 4 + ["two"] * 4)
    scene = Scene(
        charges=(Charge(name="one"), Charge(name="two")), air=AIR, scatter=False
    )
    names = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")
    uncertain = freed(
        UncertainScene(scene), [f"{n}.{shot}" for shot in truth for n in names]
    )
    answer = fit(made, uncertain).summary
    # eight readings of eight unknowns: a second place of one charge keeps 7 %
    assert answer.converged
    for shot, (mass, at, time) in truth.items():
        for name, true in zip(names, (mass, *at[:2], time), strict=True):
            assert answer.estimates[f"{name}.{shot}"].value == pytest.approx(
                true, rel=1e-3, abs=1e-3
            )
    assert set(answer.derived) == {
        f"{n}.{shot}"
        for n in ("charge_tnt_mass_kg", "charge_energy_j")
        for shot in truth
    }


@pytest.mark.slow
def test_a_shared_effect_of_one_charge_does_not_touch_the_other():
    rows = [
        (f"s{i}", "peak_overpressure_pa", p * factor, 0.01 * p, place)
        for factor in (1.0, 1.5)
        for i, place in enumerate(RING)
        for p in [float(kingery_bulmash_pressure(float(np.linalg.norm(place)), 15.0))]
    ]
    made = of_shots(log(*rows), ["one"] * 4 + ["two"] * 4)
    scene = Scene(charges=(Charge(name="one", mass_kg=15.0), Charge(name="two")))
    uncertain = UncertainScene(scene, {"charge_mass_kg.two": Free(positive=True)})
    result = fit(made, uncertain)
    # one loading for each charge: 10 % of its own rows and none of the other's
    assert result.shot == (0,) * 4 + (1,) * 4
    assert abs(result.shared[:4]).max() < 0.02
    assert result.summary.estimates["charge_mass_kg.two"].value > 20


@pytest.mark.slow
def test_a_recorder_that_runs_late_is_found_and_the_blast_with_it():
    mass, at, time, late = 15.0, (2.0, 1.0, 0.0), 0.5, 7.25
    rows = [
        (
            f"s{i}",
            "air_arrival_s",
            arrival(place, at, mass, time) + late * (i % 2),
            1e-4,
            place,
        )
        for i, place in enumerate([*RING, (25.0, 25.0, 0.0), (-30.0, -30.0, 0.0)])
    ]
    made = dataclasses.replace(log(*rows), clock=("x", "y") * 3)
    scene = Scene(Charge(mass_kg=mass), air=AIR, scatter=False)
    where = ["charge_east_m", "charge_north_m", "origin_time_s"]
    uncertain = freed(UncertainScene(scene), [*where, "clock_offset_s.y"])
    answer = fit(made, uncertain).summary
    estimates = answer.estimates
    assert estimates["clock_offset_s.y"].value == pytest.approx(late, abs=1e-5)
    assert estimates["charge_east_m"].value == pytest.approx(2.0, abs=1e-3)
    assert "clocks_taken_to_agree" not in [note.kind for note in answer.warnings]
    agreeing = fit(made, freed(UncertainScene(scene), where)).summary
    (found,) = (w for w in agreeing.warnings if w.kind == "clocks_taken_to_agree")
    assert found["parameters"] == ("clock_offset_s.y",)
    assert found["clocks"] == ("x", "y")
    assert "--free clock_offset_s.y fits" in sentence_of(found)


def test_a_clock_free_beside_the_origin_time_is_refused_with_one_arrival():
    made = log(
        (
            "a",
            "air_arrival_s",
            arrival(RING[0], (0.0, 0.0, 0.0), 15.0, 1.0),
            1e-3,
            RING[0],
        )
    )
    scene = Scene(Charge(mass_kg=15.0), sensors=(Sensor("a", np.array(RING[0])),))
    uncertain = freed(UncertainScene(scene), ["origin_time_s", "clock_offset_s.a"])
    with pytest.raises(InputError, match="1 clock times and 0 other readings cannot"):
        fit(made, uncertain)


@pytest.mark.slow
def test_wind_is_found_from_arrivals_around_the_charge():
    wind, rows = np.array([6.0, -3.0]), []
    for i, place in enumerate(RING):
        distance = np.linalg.norm(place)
        along = float(wind @ np.array(place[:2]) / distance)
        reading = arrival(place, (0.0, 0.0, 0.0), 15.0, 0.0, c=C + along)
        rows.append((f"s{i}", "air_arrival_s", reading, 1e-5, place))
    scene = Scene(Charge(mass_kg=15.0), air=AIR, scatter=False)
    uncertain = freed(UncertainScene(scene), ["wind_east_m_s", "wind_north_m_s"])
    estimates = fit(log(*rows), uncertain).summary.estimates
    assert estimates["wind_east_m_s"].value == pytest.approx(6.0, abs=1e-4)
    assert estimates["wind_north_m_s"].value == pytest.approx(-3.0, abs=1e-4)
    assert np.isnan(estimates["wind_north_m_s"].log_sd)


@pytest.mark.slow  # a layout of its own is compiled
@pytest.mark.parametrize(
    ("quantity", "law", "factor"),
    [
        ("peak_overpressure_pa", kingery_bulmash_pressure, 1.37),
        pytest.param(
            "positive_impulse_pa_s",
            kingery_bulmash_impulse,
            1.19,
            marks=pytest.mark.slow,  # compiles for itself
        ),
    ],
)
def test_c4_weighs_less_than_the_tnt_that_does_the_same(quantity, law, factor):
    value = float(law(30.0, 10.0))
    made = log(("a", quantity, value, 0.1 * value, 30.0), at_range=True)
    # dry air of the tables, so that the impulse is not scaled by the sound speed
    scene = Scene(Charge(explosive="C4"), air=AIR, scatter=False)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Free(positive=True)})
    answer = fit(made, uncertain).summary
    mass = answer.estimates["charge_mass_kg"].value
    assert mass == pytest.approx(10.0 / factor, rel=1e-6)
    derived = answer.derived
    assert derived["charge_tnt_mass_kg"].value == pytest.approx(1.37 * mass)
    by_impulse = derived["charge_tnt_mass_by_impulse_kg"].value
    assert by_impulse == pytest.approx(1.19 * mass)


@pytest.mark.slow
def test_an_uncertain_tnt_factor_widens_the_mass_by_as_much():
    value = float(kingery_bulmash_pressure(30.0, 11.0))
    made = log(("a", "peak_overpressure_pa", value, 1e-3 * value, 30.0), at_range=True)
    charge = Charge(tnt_factor=1.1)
    scene = Scene(charge, scatter=False)
    uncertain = UncertainScene(
        scene,
        {"charge_mass_kg": Free(positive=True), "tnt_factor": LogNormal(1.1, 1.1)},
    )
    estimate = fit(made, uncertain).summary.estimates["charge_mass_kg"]
    assert estimate.value == pytest.approx(10.0, rel=1e-3)
    # three standard errors of the sd of 1,600 effective draws
    assert estimate.log_sd == pytest.approx(np.log(1.1), rel=0.05)
