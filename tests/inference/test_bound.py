"""Bounds of planned layouts: textbook, fits, added data, null directions, refusals."""

import dataclasses
import functools

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import bound, bound_map, fit
from jblast.inference.design.added_data import candidates
from jblast.inference.design.planned_log import hovering, planned as plan_of, values_at
from jblast.inference.posterior.parameters import Spread
from jblast.report.fit_report import cure_words
from jblast.scene import (
    Air,
    Charge,
    Free,
    LogNormal,
    LogUniform,
    Scene,
    Sensor,
    UncertainScene,
    VehicleSpec,
)
from jblast.waves import kingery_bulmash_pressure

RING = {"a": (60.0, 0.0), "b": (-70.0, 30.0), "c": (0.0, 90.0), "d": (20.0, -80.0)}
MASS = {"charge_mass_kg": Free(positive=True)}
PLACE = {"charge_east_m": Free(positive=False), "charge_north_m": Free(positive=False)}
TIME = {"origin_time_s": Free(positive=False)}
ARRIVAL = (("air_arrival_s", 1e-4),)
PRESSURE = (("peak_overpressure_pa", 0.05),)
C = 340.0


def scene_of(beliefs, places, records=ARRIVAL, law=(), scatter=False, mass=10.0):
    """A scene of sensors by name; `records` of all, or of each by name."""
    return UncertainScene(
        Scene(
            Charge(mass_kg=mass),
            air=Air(sound_speed=C),
            sensors=tuple(
                Sensor(
                    name,
                    np.array([*place, 0.0]),
                    records=records[name] if isinstance(records, dict) else records,
                )
                for name, place in places.items()
            ),
            law=law,
            scatter=scatter,
        ),
        beliefs,
    )


TRUE = {"charge_mass_kg": 15.0, "charge_east_m": 5.0, "charge_north_m": 10.0}
PLAN = scene_of(
    MASS | PLACE | {"air_sound_speed_m_s": LogNormal(C, 1.01)},
    RING,
    {name: ARRIVAL + PRESSURE * (name in "ab") for name in RING},
    law=(("air_arrival_s", "kingery_bulmash"),),
    scatter=True,
)

FOUR = scene_of(MASS, {name: (10.0, 0.0) for name in "abcd"}, PRESSURE)


@functools.cache
def four_bound():
    # of 1 kg, whose logarithm is 0
    return bound(FOUR, {"charge_mass_kg": 1.0}, noise="gaussian")


@pytest.fixture(scope="module")
def planned():
    return bound(PLAN, TRUE)


def slope_at(distance: float) -> float:
    """How ln p falls in ln R, by the law for 1 kg; finite differences, to 1e-6."""
    up, down = (
        float(kingery_bulmash_pressure(distance * np.exp(step), 1.0))
        for step in (1e-4, -1e-4)
    )
    return -np.log(up / down) / 2e-4


def test_normal_errors_give_the_textbook_standard_deviation():
    found = four_bound()
    assert found.exit_code == 0
    spread = found.summary.parameters["charge_mass_kg"]
    # ln p falls as s ln R: sd(ln W) = 3 sigma / (s sqrt n)
    expected = 3 * 0.05 / (slope_at(10.0) * 2)
    assert spread.log_sd == pytest.approx(expected, rel=1e-4)
    (low, high) = found.summary.mass_exponents["peak_overpressure_pa"]
    assert low == high == pytest.approx(slope_at(10.0) / 3, rel=1e-4)


@pytest.mark.slow
def test_the_bound_is_what_a_fit_of_the_errorless_log_says(planned):
    scene = dataclasses.replace(PLAN.scene, law=tuple(planned.summary.law.items()))
    free = dataclasses.replace(PLAN, scene=scene)
    estimates = fit(planned.log, free).summary.estimates
    assert planned.summary.identifiable
    assert planned.exit_code == 0
    assert planned.summary.at == TRUE | {"air_sound_speed_m_s": C}
    for name, spread in planned.summary.parameters.items():
        # the bound is that of a normal: a mass in kilograms is skewed
        assert estimates[name].sd == pytest.approx(spread.sd, rel=0.12)
        assert np.isnan(spread.log_sd) == name.endswith(("east_m", "north_m"))


@pytest.mark.slow
def test_a_value_away_from_the_priors_middle_keeps_the_priors_width():
    # a prior that pulled the answer would make a second solution of the first
    wide = {"charge_mass_kg": LogUniform(1.0, 100.0)}
    places = {"a": (30.0, 0.0)}
    weak = (("peak_overpressure_pa", 3.0),)
    found = bound(scene_of(wide, places, weak), {"charge_mass_kg": 50.0})
    assert found.summary.ambiguities == ()
    assert found.summary.at == {"charge_mass_kg": 50.0}
    middle = bound(scene_of(wide, places, weak))
    assert middle.summary.at["charge_mass_kg"] == pytest.approx(10.0)
    # uniform in ln over a factor of 100: sd ln 100 / sqrt 12; a datum that tells
    # little takes a little of it
    uniform = np.log(100.0) / np.sqrt(12.0)
    sd = middle.summary.parameters["charge_mass_kg"].log_sd
    assert 0.9 * uniform < sd < uniform


@pytest.mark.parametrize(
    ("at", "beliefs", "places", "words"),
    [
        ({}, MASS, RING, "at charge_mass_kg=VALUE"),
        ({"charge_mas_kg": 1.0}, MASS, RING, "did you mean charge_mass_kg"),
        ({"charge_up_m": 1.0}, MASS, RING, "charge_up_m is fixed"),
        ({"charge_mass_kg": -1.0}, MASS, RING, "positive"),
        ({"charge_mass_kg": np.inf}, MASS, RING, "finite"),
        ({"charge_east_m": 1e200, "charge_north_m": 0.0}, PLACE, RING, "reading"),
        (
            {"charge_mass_kg": 500.0},
            {"charge_mass_kg": LogUniform(1.0, 100.0)},
            RING,
            "within its prior",
        ),
        ({}, {}, RING, "nothing to bound"),
        ({"charge_mass_kg": 1.0}, MASS, {}, "no sensor records"),
        ({"charge_mass_kg": 1.0}, MASS, {"a": (0.0, 0.0)}, "where the charge is"),
        (
            {"charge_east_m": 60.0, "charge_north_m": 0.0},
            PLACE,
            RING,
            "where the charge is",
        ),
    ],
)
def test_what_cannot_be_bounded_is_refused(at, beliefs, places, words):
    with pytest.raises(ValueError, match=words):
        bound(scene_of(beliefs, places), at)


def test_what_only_shifts_clocks_needs_no_value():
    shifts = {n: Free(positive=False) for n in ("origin_time_s", "clock_offset_s.b")}
    scene = scene_of(MASS | shifts, RING)
    values = values_at(scene, {"charge_mass_kg": 10.0, "clock_offset_s.b": 0.5})
    assert values["origin_time_s"] == 0.0
    assert values["clock_offset_s.b"] == 0.5
    with pytest.raises(InputError, match="at charge_mass_kg=VALUE; the information"):
        values_at(scene, {})


def with_one_at(distance: float) -> float:
    """Give sd(ln W) of the four pressures and one at another range, by exact laws."""
    known = 4 * slope_at(10.0) ** 2 + slope_at(distance) ** 2
    return 3 * 0.05 / np.sqrt(known)


def test_a_map_of_pressures_is_what_the_slopes_at_its_places_say():
    drawn = bound_map(four_bound(), points=2)
    assert drawn.log_sd_mass is not None
    expected = [[with_one_at(np.hypot(e, n)) for e in drawn.east] for n in drawn.north]
    np.testing.assert_allclose(drawn.log_sd_mass, expected, rtol=1e-4)


def test_a_new_place_shares_no_path_with_another_sensor_or_another_charge():
    pair = Charge(mass_kg=1.0, name="one"), Charge(mass_kg=1.0, name="two", time_s=1.0)
    scene = dataclasses.replace(FOUR.scene, charges=pair)
    beliefs = {f"charge_mass_kg.{charge.name}": Free(positive=True) for charge in pair}
    at = dict.fromkeys(beliefs, 1.0)
    plan = plan_of(UncertainScene(scene, beliefs), at, "gaussian")
    more = candidates(plan)
    rows = zip(more.shot, more.group, more.clock, strict=True)
    new = {shot: group for shot, group, sensor in rows if not sensor}
    assert set(new) == {0, 1}
    assert len({*new.values(), *plan.posterior.layout.group}) == 2 + 8


@pytest.mark.slow
def test_what_an_added_datum_leaves_is_the_bound_of_the_layout_that_has_it(planned):
    # rows of one shot share effects: what they tell does not add up
    (entry,) = (
        e
        for e in planned.summary.help
        if (e.quantity, e.sensor) == ("peak_overpressure_pa", "c")
    )
    added = (("peak_overpressure_pa", entry.sigma),)
    scene = dataclasses.replace(
        PLAN.scene,
        sensors=tuple(
            dataclasses.replace(s, records=s.records + added * (s.name == "c"))
            for s in PLAN.scene.sensors
        ),
        law=tuple(planned.summary.law.items()),
    )
    again = bound(dataclasses.replace(PLAN, scene=scene), TRUE)
    left = again.summary.parameters["charge_mass_kg"].log_sd
    # the same covariance; its independent part, whose errors are Student-t and tell
    # less, is split off with all rows that could be added present: 2e-6 here
    assert entry.left.log_sd == pytest.approx(left, rel=1e-5)
    assert left < 0.99 * planned.summary.parameters["charge_mass_kg"].log_sd


@pytest.mark.slow
def test_a_map_is_the_bound_with_one_more_sensor_at_each_place(planned):
    drawn = bound_map(planned, points=5)
    assert drawn.log_sd_mass is not None
    assert drawn.place_sd is not None
    # twice the extent: 170 m from north -80 to 90
    assert np.ptp(drawn.north) == pytest.approx(2 * 170.0)
    assert drawn.now["mass"] == pytest.approx(
        planned.summary.parameters["charge_mass_kg"].log_sd, rel=1e-9
    )
    row, column = 1, 3
    at = np.array([drawn.east[column], drawn.north[row], drawn.up])
    new = Sensor("new", at, records=PLAN.scene.sensors[0].records)
    scene = dataclasses.replace(
        PLAN.scene,
        sensors=(*PLAN.scene.sensors, new),
        law=tuple(planned.summary.law.items()),
    )
    left = bound(dataclasses.replace(PLAN, scene=scene), TRUE).summary.parameters
    assert drawn.log_sd_mass[row, column] == pytest.approx(
        left["charge_mass_kg"].log_sd, rel=1e-8
    )
    place = np.hypot(left["charge_east_m"].sd, left["charge_north_m"].sd)
    assert drawn.place_sd[row, column] == pytest.approx(place, rel=1e-8)
    assert (drawn.log_sd_mass <= drawn.now["mass"] * (1 + 1e-9)).all()


@pytest.mark.slow
def test_a_map_without_a_mass_or_place_is_refused():
    free = {"air_sound_speed_m_s": LogNormal(C, 1.1)}
    with pytest.raises(ValueError, match="mass or position"):
        bound_map(bound(scene_of(free, {"a": (60.0, 0.0)})))


WU_HAO = (("air_arrival_s", "wu_hao"), ("ground_arrival_s", "wu_hao"))


@pytest.mark.slow
def test_wu_hao_arrivals_never_tell_mass_from_speeds():
    free = {
        "charge_mass_kg": Free(positive=True),
        "air_sound_speed_m_s": Free(positive=True),
        "ground_p_speed_m_s": Free(positive=True),
    }
    places = {f"s{i}": (r, 0.0) for i, r in enumerate((15.0, 50.0))}
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


@pytest.mark.slow
def test_clocks_all_unknown_tell_no_place_and_no_origin_time():
    clocks = {f"clock_offset_s.{name}": Free(positive=False) for name in RING}
    at = dict.fromkeys(clocks, 0.0) | {"charge_east_m": 5.0, "charge_north_m": 10.0}
    found = bound(scene_of(PLACE | clocks, RING), at)
    assert len(found.summary.null_directions) == 2  # six unknowns, four readings
    assert not any(s.is_known for s in found.summary.parameters.values())
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


NOWHERE = jnp.full(3, jnp.nan)
RIDER = Sensor("rider", NOWHERE, mount="vehicle", offset_m=(1.0, 2.0, 3.0))
STAYS = Sensor("stays", (7.0, 8.0, 9.0))


def test_forward_is_east_at_first_and_north_after_a_quarter_turn():
    for yaw, expected in ((0.0, [11.0, 22.0, 33.0]), (np.pi / 2, [8.0, 21.0, 33.0])):
        vehicle = VehicleSpec(
            "iris", jnp.zeros(3), jnp.array([10.0, 20.0, 30.0]), yaw=yaw
        )
        scene = Scene(Charge(1.0), vehicle=vehicle, sensors=(RIDER, STAYS))
        rider, stays = hovering(scene).sensors
        # to rounding of the cosine of a right angle
        np.testing.assert_allclose(rider.position_m, expected, atol=1e-12)
        np.testing.assert_array_equal(stays.position_m, STAYS.position_m)
