"""A fit finds what a log was made of, says by which law, and what to doubt."""

import dataclasses
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import jblast
from calibration.ford_2021 import QUANTITIES, records
from calibration.leave_out import EMCEE, FIT, estimate, weigh
from jblast.errors import InputError
from jblast.inference import fit
from jblast.inference.fitting.goodness_of_fit import (
    normal_scores,
    p_value,
    suspected_outliers,
    tail_probability,
)
from jblast.observations import observed
from jblast.registry import law_for
from jblast.report import summary
from jblast.report.messages import sentences_of
from jblast.scene import (
    Air,
    Charge,
    Free,
    LogNormal,
    Scene,
    Sensor,
    UncertainScene,
    VehicleSpec,
    freed,
    with_laws,
    with_values,
)
from jblast.sensors import simulate
from jblast.waves import (
    ford_2021_impulse,
    ground_motion_displacement,
    ground_motion_velocity,
    kingery_bulmash_arrival_time,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
)
from tests.catalogue import AROUND, BOTH, EXACT, MASS_FREE, TEN, TRUTH, pressures
from tests.inference.clocks_off import ASKED, heard
from tests.inference.logs import log


def test_an_exact_log_gives_its_mass_back():
    answer = fit(pressures(15.0), MASS_FREE).summary
    mass = answer.estimates["charge_mass_kg"]
    # the mode is climbed to within 1e-3 in ln of the density
    assert mass.value == pytest.approx(15.0, rel=1e-3)
    assert mass.q05 < 15.0 < mass.q95
    assert answer.converged
    assert answer.identifiable
    assert answer.law == {"peak_overpressure_pa": "kingery_bulmash"}
    assert answer.chi2 == pytest.approx(0.0, abs=1e-4)
    assert answer.dof == 2


def test_normal_errors_give_the_textbook_standard_deviation():
    # ln p falls as s ln R; with exact laws sd(ln W) = 3 sigma / (|s| sqrt n)
    log, step = pressures(15.0, [30.0, 30.0, 30.0]), 1e-4
    answer = fit(log, MASS_FREE, noise="gaussian").summary
    up, down = (kingery_bulmash_pressure(30.0 * np.exp(s), 15.0) for s in (step, -step))
    slope = np.log(up / down) / (2 * step)
    expected = 3 * 0.1 / (abs(slope) * np.sqrt(3))
    found = answer.estimates["charge_mass_kg"].log_sd
    # an sd by some thousand draws
    assert found == pytest.approx(expected, rel=0.03)


@pytest.mark.slow
def test_one_wild_reading_among_ten_moves_the_answer_by_less_than_its_interval():
    clean = pressures(15.0, TEN)
    value = clean.value.copy()
    value[4] *= 5
    wild = dataclasses.replace(clean, value=value)
    before, after = fit(clean, MASS_FREE).summary, fit(wild, MASS_FREE).summary
    mass = before.estimates["charge_mass_kg"]
    assert mass.q05 < after.estimates["charge_mass_kg"].value < mass.q95
    assert [o.sensor for o in after.suspected_outliers] == ["s4"]
    assert before.suspected_outliers == ()


@pytest.mark.slow
def test_five_microphones_find_mass_place_and_time_they_were_simulated_with():
    scene = with_values(
        dataclasses.replace(
            EXACT,
            sensors=tuple(
                Sensor(f"m{i}", jnp.array([*place, 1.5]), records=BOTH)
                for i, place in enumerate(AROUND)
            ),
        ),
        TRUTH,
    )
    observed = simulate(UncertainScene(scene, {}), seed=1)
    asked = freed(UncertainScene(scene, {}), list(TRUTH))
    asked = dataclasses.replace(
        asked, scene=with_values(scene, dict.fromkeys(TRUTH, 1.0))
    )
    answer = fit(observed, asked).summary
    assert answer.identifiable
    assert answer.converged
    for name, value in TRUTH.items():
        found = answer.estimates[name]
        # four sds: one wrong alarm in ten thousand seeds, and this seed is fixed
        assert abs(found.value - value) < 4 * found.sd


def test_laws_are_chosen_at_the_answer_and_not_at_the_start():
    # at the starting mass of 1 kg these ranges lie beyond Z = 40
    answer = fit(pressures(1000.0, [100.0, 200.0, 350.0]), MASS_FREE).summary
    assert answer.law == {"peak_overpressure_pa": "kingery_bulmash"}
    # the mode is climbed to within 1e-3 in ln of the density
    assert answer.estimates["charge_mass_kg"].value == pytest.approx(1e3, rel=1e-3)


def without_density():
    """A log one reading of which no mass gives."""
    made = pressures(15.0)
    made.value[1] = np.nan
    return made


@pytest.mark.parametrize(
    ("made", "asked", "words"),
    [
        (
            lambda: log(("a", "air_arrival_s", 0.1, None, 40.0), at_range=True),
            MASS_FREE,
            "expected a sigma",
        ),
        (without_density, MASS_FREE, r"no value of charge_mass_kg .* row 2$"),
        (lambda: pressures(15.0, [20.0]), UncertainScene(EXACT), "nothing to fit"),
    ],
)
def test_what_cannot_be_fitted_is_refused(made, asked, words):
    with pytest.raises(InputError, match=words):
        fit(made(), asked)


def test_a_poor_fit_exits_4_and_says_so_above_its_numbers():
    made = pressures(15.0, sigma=0.02)
    made.value[:] *= [1.0, 3.0, 0.3]
    found = fit(made, MASS_FREE, noise="gaussian")
    assert found.exit_code == 4
    text = summary(found)
    assert text.index("POOR FIT (p < 0.001)") < text.index("Estimates")


def test_an_answer_whose_law_holds_for_no_row_exits_4():
    laws = {"peak_overpressure_pa": "kingery_bulmash"}  # to Z = 40
    beyond = fit(pressures(15.0, [200.0, 400.0, 800.0]), with_laws(MASS_FREE, laws))
    assert beyond.summary.law_valid_rows == 0
    assert beyond.exit_code == 4


@pytest.mark.slow
def test_the_band_at_a_sensor_is_what_draws_say_of_it():
    found = fit(heard("arrivals", np.random.default_rng(4)), ASKED)
    (band,) = found.bands
    numbers = np.stack([found.draws[n] for n in found.names], axis=1)[::20]
    read = found.density.seen_with(numbers).predicted
    low, high = np.quantile(read, [0.05, 0.95], axis=0)
    at = np.log(found.distance)
    for ours, theirs in ((band.q05, low), (band.q95, high)):
        # other draws of the same, 0.1 sd at the ends; a chord between places
        near = np.interp(at, np.log(band.x), ours)
        np.testing.assert_allclose(near, theirs, atol=0.1 * np.max(high - low))


@pytest.mark.parametrize(
    ("noise", "reference"), [("gaussian", stats.norm), ("student", stats.t(df=4))]
)
def test_the_chance_beyond_a_residual_is_that_of_scipy(noise, reference):
    u = np.array([0.0, 0.3, -1.0, 4.0, -25.0])
    np.testing.assert_allclose(
        tail_probability(u, noise), 2 * reference.sf(np.abs(u)), rtol=1e-10
    )


@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_honest_errors_of_either_kind_seldom_look_poor(noise):
    rng = np.random.default_rng(0)
    draw = (
        rng.standard_normal if noise == "gaussian" else lambda n: rng.standard_t(4, n)
    )
    chi2 = np.sum(
        normal_scores(draw((4000, 20)).ravel(), noise).reshape(4000, 20) ** 2, 1
    )
    poor = np.mean([(p_value(c, 20) or 0.0) < 0.05 for c in chi2])
    # a share of 0.05 in 4000 has a standard error of 0.0035
    assert poor == pytest.approx(0.05, abs=0.012)


def test_chance_is_the_survival_of_chi_squared():
    assert p_value(9.1, 9) == pytest.approx(stats.chi2.sf(9.1, 9), rel=1e-10)
    assert p_value(1.0, 0) is None


def named(residual):
    rows = [(f"s{i}", "air_arrival_s", 1.0, 0.1, 10.0) for i in range(len(residual))]
    return [
        found.sensor
        for found in suspected_outliers(
            log(*rows, at_range=True), np.array(residual, float), "student"
        )
    ]


def test_a_wild_reading_is_named_and_honest_ones_are_not():
    assert named([0.1, -1.0, 8.0, 0.5, 0.0, 2.0, -2.0, 1.0, 0.3, 0.2]) == ["s2"]
    assert named([0.1, -1.0, 3.0, 0.5, 0.0, 2.0, -2.0, 1.0, 0.3, 0.2]) == []
    assert named([50.0, -60.0, 0.0]) == []  # most are wild: the law is wrong


LAWS = [law_for(quantity, "ford_2021") for quantity in QUANTITIES]


def log_of(shot):
    return records().where(records().shot == shot)


def agree(told, exact, mean, sd, ends):
    assert told.mean == pytest.approx(exact.mean, abs=mean * exact.sd)
    assert told.sd == pytest.approx(exact.sd, rel=sd)
    assert told.q05 == pytest.approx(exact.q05, abs=ends * exact.sd)
    assert told.q95 == pytest.approx(exact.q95, abs=ends * exact.sd)


@pytest.mark.slow  # a walk
# the second is buried deeper than the range of the law
@pytest.mark.parametrize(("shot", "valid"), [("HRI-2", True), ("HTP-7", False)])
def test_a_fit_agrees_with_the_exact_posterior_of_the_mass(shot, valid):
    (told, marked), exact = weigh(shot, LAWS), estimate(log_of(shot), LAWS)
    assert marked == valid
    # Some thousand effective draws know the mean to 0.04 sd and the sd to 3 %, ends to
    # 0.08 sd; walkers stop when their ends have a standard error of 0.05 sd. Three of
    # each.
    agree(told[FIT], exact, mean=0.12, sd=0.1, ends=0.25)
    agree(told[EMCEE], exact, mean=0.12, sd=0.1, ends=0.25)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("height", "far", "valid", "exit_code"),
    [
        # impulses inside have 5 %; the displacement, beyond Z = 1000, 1.9 in ln
        (-0.5, 10_000.0, 3, 0),
        # deeper than impulses reach, h/W^(1/3) = -0.2; the displacement is inside
        (-2.1, 300.0, 1, 4),
    ],
)
def test_an_answer_is_as_valid_as_the_rows_that_tell_it(height, far, valid, exit_code):
    mass, rows = 300.0, []
    for name, r in (("a", 300.0), ("b", 500.0), ("c", 700.0)):
        slant = np.hypot(r, height)
        value = float(ford_2021_impulse(slant, mass, height, 101325.0, 340.29))
        rows.append((name, "positive_impulse_pa_s", value, 0.05 * value, (r, 0.0, 0.0)))
    value = float(ground_motion_displacement(far, mass, height))
    rows.append(("d", "ground_displacement_m", value, 0.05 * value, (far, 0.0, 0.0)))
    charge = Charge(mass_kg=mass, position_m=(0.0, 0.0, height))
    scene = Scene(charge, law=(("positive_impulse_pa_s", "ford_2021"),))
    found = fit(log(*rows), freed(UncertainScene(scene), ["charge_mass_kg"]))
    assert found.summary.law_valid_rows == valid
    assert found.summary.extrapolated == ("charge_mass_kg",) * (exit_code == 4)
    assert found.exit_code == exit_code


HOVERING = VehicleSpec("hummingbird", jnp.array([25.0, 0.0, 4.0]))
JOLTED = Scene(Charge(10.0, range_m=25.0), vehicle=HOVERING)
UNKNOWN = {"charge_mass_kg": Free(True), "charge_range_m": Free(True)}


def jolt(**readings):
    values, sigmas = zip(*readings.values(), strict=True)
    return observed(("imu",) * len(values), tuple(readings), values, sigmas)


@pytest.mark.slow
def test_a_jolt_alone_leaves_a_curve_of_masses_and_ranges():
    result = fit(
        jolt(jolt_velocity_m_s=(0.117, 0.003)), UncertainScene(JOLTED, beliefs=UNKNOWN)
    )
    (null,) = result.summary.null_directions
    assert set(null.parameters) == {"charge_mass_kg", "charge_range_m"}
    assert not result.summary.identifiable
    assert result.exit_code == 4
    # along the direction the reading stays; it may be anywhere on the curve
    names = result.answer.names
    along = np.array([null.parameters[name] for name in names])
    against = along * np.where(np.array(names) == "charge_mass_kg", -1.0, 1.0)
    moves = 0.01 * np.stack([0 * along, along, against])
    read = result.density.seen_with(result.answer.values * np.exp(moves)).predicted
    here, same, other = read[:, 0]
    # a curve bends; a lighter charge farther away differs in the first order
    assert abs(same - here) < 0.05 * abs(other - here)


@pytest.mark.slow
def test_with_a_flash_and_its_arrival_a_jolt_tells_the_charge():
    readings = {
        "flash_time_s": (0.0, 1e-3),
        "air_arrival_s": (0.0577, 1e-3),
        "jolt_velocity_m_s": (0.117, 0.003),
    }
    unknown = UNKNOWN | {"origin_time_s": Free(False)}
    result = fit(jolt(**readings), UncertainScene(JOLTED, beliefs=unknown))
    assert result.summary.identifiable
    mass = result.summary.estimates["charge_mass_kg"]
    # 15 % and 15 % of the law, by a slope of 1.1 in ln
    assert 0.15 < mass.log_sd < 0.35


LAW = (("peak_overpressure_pa", "kingery_bulmash"),)
SCENE = Scene(air=Air(sound_speed=340.0), scatter=False, law=LAW)


def warnings(belief, *factors):
    """What is said of pressures of 15 kg, each times a factor, and a prior."""
    rows = [
        (f"s{i}", "peak_overpressure_pa", f * p, 0.05 * p, r)
        for i, (r, f) in enumerate(zip((10.0, 20.0, 30.0, 40.0), factors, strict=True))
        for p in [float(kingery_bulmash_pressure(r, 15.0))]
    ]
    uncertain = UncertainScene(SCENE, {"charge_mass_kg": belief}, "scene.toml")
    answer = fit(log(*rows, at_range=True), uncertain, noise="gaussian").summary
    assert "poor_fit" in [problem.kind for problem in answer.problems]
    return sentences_of(answer.warnings)


def test_a_prior_that_excludes_the_data_is_named_with_what_they_say():
    (sentence,) = warnings(LogNormal(5000.0, 1.05), 1.0, 1.0, 1.0, 1.0)
    # and not that the log tells nothing of the mass
    assert sentence.startswith("without priors the log fits well, at charge mass 15 kg")
    assert "which a prior excludes" in sentence


def test_readings_that_contradict_one_another_are_not_blamed_on_a_prior():
    assert warnings(LogNormal(5000.0, 1.05), 1.0, 3.0, 1.0, 3.0) == []


FAR = {"a": 400.0, "b": 900.0, "c": 1500.0}
BURIED = -3.0


@pytest.mark.slow
def test_seismic_rows_alone_bound_a_mass_as_far_as_rocks_are_alike():
    distance = np.array([*FAR.values()])
    readings = {
        "ground_displacement_m": ground_motion_displacement,
        "ground_peak_velocity_m_s": ground_motion_velocity,
    }
    rows = [
        (name, quantity, value, 0.05 * value, (far, 0.0, BURIED))
        for quantity, law in readings.items()
        for (name, far), value in zip(
            FAR.items(), np.asarray(law(distance, 300.0, BURIED)), strict=True
        )
    ]
    scene = Scene(Charge(mass_kg=jnp.asarray(100.0), position_m=(0.0, 0.0, BURIED)))
    free = freed(UncertainScene(scene), ["charge_mass_kg"])
    answer = fit(log(*rows), free).summary
    mass = answer.estimates["charge_mass_kg"]
    assert set(answer.law.values()) == {"ground_motion"}
    # at the answer; small masses of the interval are deeper than the law reaches
    assert answer.law_valid_rows == len(rows)
    assert mass.q05 < 300.0 < mass.q95
    # Shots of a new site share 1.90 and 2.05 in ln; a displacement grows as W^0.82, a
    # velocity as W^0.66: 1 / (0.82^2 / 1.90^2 + 0.66^2 / 2.05^2) is 1.86^2, more with
    # path and record scatter, so the 90 % interval spans a factor above 30
    assert 1.6 < np.log(mass.q95 / mass.q05) / (2 * 1.645) < 2.6
    assert not mass.identified


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


@pytest.mark.slow
def test_c4_weighs_less_than_the_tnt_that_does_the_same():
    value = float(kingery_bulmash_impulse(30.0, 10.0))
    row = ("a", "positive_impulse_pa_s", value, 0.1 * value, 30.0)
    # dry air of the tables, so that the impulse is not scaled by the sound speed
    scene = Scene(Charge(explosive="C4"), air=AIR, scatter=False)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Free(positive=True)})
    answer = fit(log(row, at_range=True), uncertain).summary
    mass = answer.estimates["charge_mass_kg"].value
    assert mass == pytest.approx(10.0 / 1.19, rel=1e-6)
    derived = {name: one.value / mass for name, one in answer.derived.items()}
    assert derived["charge_tnt_mass_kg"] == pytest.approx(1.37)
    assert derived["charge_tnt_mass_by_impulse_kg"] == pytest.approx(1.19)


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


PLACES = ((-180, 240), (310, 150), (420, -260), (60, -390), (-350, -120), (-90, 520))
RECORDS = (("air_arrival_s", 0.002), ("peak_overpressure_pa", 0.1))


def six_sensors():
    """Return six sensors' log of a charge off the origin at 3 s."""
    sensors = tuple(
        Sensor(f"m{i}", np.array([east, north, 0.0]), records=RECORDS)
        for i, (east, north) in enumerate(PLACES)
    )
    charge = Charge(mass_kg=100.0, position_m=(80.0, -50.0, 0.0), time_s=3.0)
    return simulate(UncertainScene(Scene(charge, sensors=sensors)), 1)


@pytest.mark.slow
def test_place_and_time_of_a_log_with_positions_need_no_scene():
    found = jblast.fit(six_sensors())
    assert found.exit_code == 0
    truth = {
        "charge_mass_kg": 100.0,
        "charge_east_m": 80.0,
        "charge_north_m": -50.0,
        "origin_time_s": 3.0,
    }
    assert set(found.summary.free) == set(truth)
    assert found.summary.suspected_outliers == ()
    for name, value in truth.items():
        estimate = found.summary.estimates[name]
        assert abs(estimate.value - value) < 3 * estimate.sd, name


@pytest.mark.slow
def test_several_wrong_clocks_are_named_together():
    recorder = {f"m{i}": name for i, name in enumerate("aabbcc")}
    ahead = {"a": 0.0, "b": 1.7, "c": 0.85}
    made = six_sensors()
    clock = tuple(recorder[sensor] for sensor in made.sensor)
    late = np.array([ahead[name] for name in clock])
    late *= np.isin(made.quantity, "air_arrival_s")
    here = made.position - np.array([80.0, -50.0, 0.0])  # about a charge at the origin
    apart = replace(made, value=made.value + late, clock=clock, position=here)
    said = jblast.fit(apart).summary.warnings
    (more,) = (one for one in said if one.kind == "more_to_free")
    assert more["parameters"] == ("clock_offset_s.b", "clock_offset_s.c")
    mass = more["masses"]["charge_mass_kg"]
    assert abs(np.log(mass.value / 100.0)) < 4 * mass.log_sd
