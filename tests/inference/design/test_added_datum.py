"""What one more datum, or one more sensor anywhere, leaves of a bound."""

import dataclasses
import functools

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import bound, bound_map
from jblast.inference.design.added_data import candidates
from jblast.inference.design.planned_log import planned as plan_of
from jblast.scene import Charge, Free, LogNormal, Sensor, UncertainScene
from jblast.waves import kingery_bulmash_pressure
from tests.inference.design.plans import MASS, PLAN, PRESSURE, RING, TRUE, scene_of

FOUR = scene_of(MASS, {name: (10.0, 0.0) for name in "abcd"}, PRESSURE)


@functools.cache
def four_bound():
    # of 1 kg, whose logarithm is 0
    return bound(FOUR, {"charge_mass_kg": 1.0}, noise="gaussian")


def with_one_at(distance: float) -> float:
    """Give sd(ln W) of the four pressures and one at another range, by exact laws."""
    known = 0.0
    for r, count in ((10.0, 4), (distance, 1)):
        up, down = (
            float(kingery_bulmash_pressure(r * np.exp(step), 1.0))
            for step in (1e-4, -1e-4)
        )
        # ln p falls as s ln R, and so grows as s/3 ln W
        known += count * (np.log(up / down) / 2e-4 / 3 / 0.05) ** 2
    return 1 / np.sqrt(known)


def test_a_map_of_pressures_is_what_the_slopes_at_its_places_say():
    drawn = bound_map(four_bound(), points=3)
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
def test_a_map_without_anything_to_draw_is_refused():
    ground = {"ground_p_speed_m_s": LogNormal(5660.0, 1.1)}
    found = bound(scene_of(ground, RING, (("ground_arrival_s", 1e-4),)))
    with pytest.raises(ValueError, match="mass or position"):
        bound_map(found)
    ranged = scene_of(MASS, {"a": (0.0, 0.0)}, PRESSURE)
    charge = dataclasses.replace(ranged.scene.charge, range_m=jnp.asarray(30.0))
    scene = dataclasses.replace(ranged.scene, charges=(charge,))
    found = bound(dataclasses.replace(ranged, scene=scene), {"charge_mass_kg": 9.0})
    assert found.summary.identifiable
    assert all(entry.position is None for entry in found.summary.help)
    with pytest.raises(ValueError, match="needs positions"):
        bound_map(found)
