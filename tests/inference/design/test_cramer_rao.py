"""What a planned layout could tell: against a fit, a textbook and known null spaces."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import bound, bound_map, fit, information_of_layout
from jblast.inference.design.planned_log import values_at
from jblast.inference.design.summary import AddedDatum
from jblast.inference.posterior.estimate import Spread
from jblast.quantities import QUANTITIES
from jblast.report.design.added_datum import data_lines
from jblast.report.design.terminal import bound_text
from jblast.scene import (
    Air,
    Charge,
    Free,
    LogNormal,
    LogUniform,
    Scene,
    Sensor,
    UncertainScene,
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
            charge=Charge(mass=mass),
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


def sentences(found):
    """The text for the terminal on one line, its columns checked."""
    text = bound_text(found)
    assert max(map(len, text.splitlines())) <= 96
    return " ".join(text.split())


FOUR = scene_of(MASS, {name: (30.0, 0.0) for name in "abcd"}, PRESSURE)
FIFTEEN = {"charge_mass_kg": 15.0}


def textbook():
    """Give sd(ln W) of four pressures by exact laws, and how ln p falls in ln R."""
    step = 1e-4
    up, down = (
        kingery_bulmash_pressure(30.0 * np.exp(s * step), 15.0) for s in (1, -1)
    )
    slope = abs(float(np.log(up / down))) / (2 * step)
    # ln p falls as s ln R: sd(ln W) = 3 sigma / (|s| sqrt n)
    return 3 * 0.05 / (slope * 2), slope


def test_normal_errors_give_the_textbook_standard_deviation():
    found = bound(FOUR, FIFTEEN, noise="gaussian")
    assert found.exit_code == 0
    expected, slope = textbook()
    # finite differences of the slope are good to 1e-6
    spread = found.summary.parameters["charge_mass_kg"]
    assert spread.log_sd == pytest.approx(expected, rel=1e-4)
    (low, high) = found.summary.mass_exponents["peak_overpressure_pa"]
    assert low == high == pytest.approx(slope / 3, rel=1e-4)


@pytest.mark.slow  # each layout compiles its own search
def test_heavy_tails_keep_five_sevenths_of_the_information():
    student = bound(FOUR, FIFTEEN)
    ratio = student.summary.parameters["charge_mass_kg"].log_sd / textbook()[0]
    assert ratio == pytest.approx(np.sqrt(7 / 5), rel=1e-4)


TRUE = {"charge_mass_kg": 15.0, "charge_east_m": 5.0, "charge_north_m": 10.0}
PLAN = scene_of(
    MASS | PLACE | {"air_sound_speed_m_s": LogNormal(C, 1.01)},
    RING,
    {name: ARRIVAL + PRESSURE * (name in "ab") for name in RING},
    law=(("air_arrival_s", "kingery_bulmash"),),
    scatter=True,
)


@pytest.fixture(scope="module")
def planned():
    return bound(PLAN, TRUE)


@pytest.mark.slow
def test_the_bound_is_what_a_fit_of_the_errorless_log_says(planned):
    scene = dataclasses.replace(PLAN.scene, law=tuple(planned.summary.law.items()))
    # the bound is of the normal approximation, not of the weighted draws
    free = dataclasses.replace(PLAN, scene=scene)
    estimates = fit(planned.log, free, posterior="laplace").summary.estimates
    assert planned.summary.identifiable
    assert planned.exit_code == 0
    assert planned.summary.at == TRUE | {"air_sound_speed_m_s": C}
    for name, spread in planned.summary.parameters.items():
        # the fit's optimum is a little off: errors in seconds grow with travel time
        assert estimates[name].sd == pytest.approx(spread.sd, rel=0.03)
        assert np.isnan(spread.log_sd) == name.endswith(("east_m", "north_m"))


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
    # the same matrix, its rows in another order: rounding only
    assert entry.left.log_sd == pytest.approx(left, rel=1e-8)
    assert left < 0.99 * planned.summary.parameters["charge_mass_kg"].log_sd


@pytest.mark.slow
def test_help_is_ranked_by_what_it_leaves_of_the_mass_and_says_whose_sigma(planned):
    inside = [e for e in planned.summary.help if e.law_valid]
    sds = [e.left.log_sd for e in inside]
    assert sds == sorted(sds)
    assert {e.parameter for e in inside} == {"charge_mass_kg"}
    for entry in inside:
        planned_too = entry.quantity in ("air_arrival_s", "peak_overpressure_pa")
        assert entry.is_default != planned_too
    assert not any(
        (e.quantity, e.sensor) == ("air_arrival_s", "a") for e in planned.summary.help
    )


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
def test_information_of_many_layouts_at_once_is_that_of_each(planned):
    posterior = planned.posterior
    z, laws = jnp.asarray(planned.z), dict(posterior.laws)

    def moved(east):
        position = posterior.layout.position.at[0, 0].add(east)
        layout = dataclasses.replace(posterior.layout, position=position)
        return information_of_layout(
            posterior.parameters, layout, posterior.sigma, laws, z
        )

    steps = jnp.array([0.0, 7.0, -12.0])
    together = jax.jit(jax.vmap(moved))(steps)
    for step, one in zip(steps, together, strict=True):
        # the order of sums differs between the two programs
        np.testing.assert_allclose(one, moved(step), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(together[0], planned.information, rtol=1e-9, atol=1e-9)


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
    assert "peak overpressure" in null.cure
    assert found.exit_code == 4
    assert found.summary.parameters == dict.fromkeys(free, Spread())
    # a pressure tells the mass; no arrival by the same law does
    helps = {e.quantity: e.left.is_known for e in reversed(found.summary.help)}
    assert helps["peak_overpressure_pa"]
    assert not helps["air_arrival_s"]
    text = sentences(found)
    assert "charge mass times 2.00, air sound speed times 0.871 and ground" in text
    assert "Were the air sound speed known, the charge mass would be told" in text


@pytest.mark.parametrize("names", ["a", "abc"])
@pytest.mark.slow
def test_one_sensor_or_all_at_one_place_leave_the_charge_on_a_circle(names):
    found = bound(
        scene_of(PLACE, dict.fromkeys(names, (0.0, 0.0))),
        {"charge_east_m": 30.0, "charge_north_m": 40.0},
    )
    (null,) = found.summary.null_directions
    # along the circle: north by -30/40 of east
    assert null.parameters["charge_north_m"] == pytest.approx(-0.75, rel=1e-6)
    assert found.exit_code == 4
    assert "cannot tell the charge east and charge north apart" in sentences(found)


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


TRIANGLE = {"a": (0.0, 0.0), "b": (100.0, 0.0), "c": (0.0, 100.0)}


@pytest.mark.slow
def test_three_sensors_with_the_charge_outside_their_triangle_leave_a_second_place():
    law = (("air_arrival_s", "shock_kinematics"),)
    uncertain = scene_of(PLACE | TIME, TRIANGLE, law=law)
    at = {"charge_east_m": -20.0, "charge_north_m": -20.0, "origin_time_s": 1.0}
    found = bound(uncertain, at)
    (other,) = found.summary.ambiguities
    second = {name: other.parameters[name] for name in at}
    assert second["origin_time_s"] > 1.01
    # it is a solution: the same three arrivals to a hundredth of their sigma
    again = bound(uncertain, second)
    np.testing.assert_allclose(again.log.value, found.log.value, atol=1e-6)
    assert "Another solution fits nearly as well" in sentences(found)
    within = at | {"charge_east_m": 30.0, "charge_north_m": 30.0}
    assert bound(uncertain, within).summary.identifiable


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
        assert "leans on the prior of the air sound speed: without it not ident" in text
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


@pytest.mark.slow
def test_fewer_data_than_unknowns_are_computed_and_marked():
    found = bound(
        scene_of(PLACE | TIME | MASS, {"a": (50.0, 0.0), "b": (0.0, 70.0)}),
        TRUE | {"origin_time_s": 0.0},
    )
    assert found.exit_code == 4
    assert len(found.summary.null_directions) == 2


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


@pytest.mark.slow
def test_a_height_told_by_symmetry_alone_has_its_measured_width():
    free = PLACE | {"charge_up_m": Free(positive=False)}
    at = {"charge_east_m": 5.0, "charge_north_m": 10.0, "charge_up_m": 0.0}
    found = bound(scene_of(free, RING), at)
    assert found.summary.identifiable
    # 1e-4 s is 3.4 cm of slant range: h^2 / 2R = 3.4 cm at R = 75 m gives 2.3 m
    assert 0.5 < found.summary.parameters["charge_up_m"].sd < 10


@pytest.mark.parametrize(
    ("at", "beliefs", "places", "words"),
    [
        ({}, MASS, RING, "--at charge_mass_kg=VALUE"),
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


@pytest.mark.slow
def test_a_map_without_anything_to_draw_is_refused():
    ground = {"ground_p_speed_m_s": LogNormal(5660.0, 1.1)}
    found = bound(scene_of(ground, RING, (("ground_arrival_s", 1e-4),)))
    with pytest.raises(ValueError, match="mass or the place"):
        bound_map(found)
    ranged = scene_of(MASS, {"a": (0.0, 0.0)}, PRESSURE)
    charge = dataclasses.replace(ranged.scene.charge, range=jnp.asarray(30.0))
    scene = dataclasses.replace(ranged.scene, charge=charge)
    found = bound(dataclasses.replace(ranged, scene=scene), {"charge_mass_kg": 9.0})
    assert found.summary.identifiable
    assert all(entry.position is None for entry in found.summary.help)
    with pytest.raises(ValueError, match="needs places"):
        bound_map(found)


def test_what_only_shifts_clocks_needs_no_value():
    shifts = {n: Free(positive=False) for n in ("origin_time_s", "clock_offset_s.b")}
    scene = scene_of(MASS | shifts, RING)
    values = values_at(scene, {"charge_mass_kg": 10.0, "clock_offset_s.b": 0.5})
    assert values["origin_time_s"] == 0.0
    assert values["clock_offset_s.b"] == 0.5
    with pytest.raises(InputError, match="--at charge_mass_kg=VALUE; what"):
        values_at(scene, {})


@pytest.mark.slow
def test_a_bound_does_not_depend_on_when_it_exploded():
    scene = scene_of(MASS | {"origin_time_s": Free(positive=False)}, RING)
    known = {"charge_mass_kg": 10.0}
    early, late = bound(scene, known), bound(scene, known | {"origin_time_s": 70.0})
    for name, spread in early.summary.parameters.items():
        again = late.summary.parameters[name].sd
        assert spread.sd == pytest.approx(again, rel=1e-6)  # of 70 s in 1e-4 s


def test_further_data_stand_in_the_order_of_the_sd_they_leave():
    left = (Spread(0.3, 0.3), Spread(), Spread(0.1, 0.1), Spread(0.2, 0.2))
    made = [
        AddedDatum(
            quantity=quantity,
            sensor="a",
            position=None,
            charge="",
            sigma=0.1,
            is_default=False,
            law="acoustic",
            law_valid=True,
            parameter="charge_mass_kg",
            left=spread,
        )
        for quantity, spread in zip(list(QUANTITIES)[: len(left)], left, strict=True)
    ]
    _, _, *lines = data_lines(made, {"charge_mass_kg": Spread(5.0, 0.5)})
    assert [line.split("%")[0].split()[-1] for line in lines[:3]] == ["10", "20", "30"]
