"""What a fit learns from a camera: what no image can know, and how a bang tells it."""

import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import bound, fit, fit_many
from jblast.inference.posterior.parameters import as_seen, own_growth
from jblast.observations import Observations, read
from jblast.report.fit_report import cure_words
from jblast.scene import Camera, Charge, Free, Scene, Sensor, UncertainScene, read_scene
from jblast.sensors import observe, planned_layout, simulate
from jblast.sensors.forward_model import residuals_of

DATA = Path(__file__).parents[2] / "calibration" / "data"
FREE = Free(positive=True)
LAWS = {
    "flash_time_s": "light",
    "air_arrival_s": "kingery_bulmash",
    "fireball_radius_px": "fireball",
}
TIMES = (1e-3, 2e-3, 3e-3, 5e-3, 8e-3, 12e-3, 20e-3)
SIGHTED = (("fireball_radius_px", 0.02),)
HEARD = (*SIGHTED, ("flash_time_s", 2e-4), ("air_arrival_s", 1e-3))
MASS, RANGE = 50.0, 120.0


def camera() -> Camera:
    ahead = np.array([1.0, 0.0, 0.0, 0.0])
    return Camera(
        np.zeros(3), ahead, np.full(2, 1500.0), np.array([640, 360]), 1280, 720
    )


def scene_of(records) -> Scene:
    return Scene(
        Charge(mass_kg=MASS, range_m=RANGE),
        sensors=(Sensor("cam", np.full(3, np.nan), records=records, times_s=TIMES),),
        camera=camera(),
        law=tuple(LAWS.items()),
    )


def open_scene(scene: Scene, *more: str) -> UncertainScene:
    names = ("charge_mass_kg", "charge_range_m", *more)
    beliefs = {name: Free(positive=name != "origin_time_s") for name in names}
    return UncertainScene(scene, beliefs)


def log_of(records) -> Observations:
    return simulate(UncertainScene(scene_of(records)), 0)


def test_bearings_miss_by_the_short_way_round():
    names = ("bearing_rad", "elevation_rad", "bearing_rad")
    residual = residuals_of(np.array([0.1, 0.1, 3.0]), np.array([6.2, 6.2, 2.0]), names)
    expected = [0.1 - 6.2 + 2 * math.pi, -6.1, 1.0]
    np.testing.assert_allclose(residual, expected, atol=1e-12)


def test_the_growth_time_is_free_where_a_scene_is_silent():
    scene, times = UncertainScene(scene_of(SIGHTED)), np.array(TIMES)
    seen = ("fireball_radius_px",) * len(times)
    opened = as_seen(scene, seen, times)
    assert opened.beliefs == {"fireball_growth_s": FREE}
    assert opened.scene.instant_light
    told = UncertainScene(Scene(fireball_growth=2e-3, camera=camera()))
    assert not as_seen(told, seen, times).beliefs
    assert as_seen(scene, ("flash_time_s",), np.full(1, np.nan)) is scene


@pytest.mark.slow
def test_a_bound_takes_the_growth_time_of_the_law():
    scene = scene_of(HEARD)
    found = bound(
        open_scene(scene), {"charge_mass_kg": MASS, "charge_range_m": RANGE}
    ).summary
    assert found.identifiable
    assert found.at["fireball_growth_s"] == pytest.approx(own_growth(scene))
    # 20 % of a radius that the shot shares is 60 % of a mass, the rest adds a little
    assert 0.6 < found.parameters["charge_mass_kg"].log_sd < 0.75


@pytest.mark.slow
def test_an_image_alone_tells_size_over_distance_and_names_the_cure():
    found = fit(log_of(SIGHTED), open_scene(scene_of(SIGHTED)))
    answer = found.summary
    (null,) = answer.null_directions
    assert null.parameters == {
        "charge_mass_kg": 1.0,
        "charge_range_m": pytest.approx(1 / 3, rel=1e-6),
    }
    assert null.space == "ln"
    assert "an air arrival (of the bang" in cure_words(null.cure)
    assert found.exit_code == 4
    growth = answer.estimates["fireball_growth_s"]
    assert growth.q05 < own_growth(scene_of(SIGHTED)) < growth.q95


@pytest.mark.slow
def test_the_worked_example_is_recovered():
    log = read(DATA / "camera_and_bang.csv")
    found = fit(log, read_scene(DATA / "camera_and_bang.toml"))
    assert found.exit_code == 0
    truth = {"charge_mass_kg": 50.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
    truth |= {"charge_up_m": 0.0, "origin_time_s": 2.0}
    truth |= {"fireball_growth_s": 1e-3 * np.cbrt(50.0)}
    for name, value in truth.items():
        told = found.summary.estimates[name]
        wide = 2 * (told.q95 - told.q05) / 3.29  # two sds
        assert told.q50 - wide < value < told.q50 + wide, name


@pytest.mark.slow
def test_a_line_of_sight_is_a_null_direction_of_a_charge_anywhere(tmp_path):
    text = (DATA / "camera_and_bang.csv").read_text().splitlines()
    silent = tmp_path / "silent.csv"
    silent.write_text("\n".join(row for row in text if ",air_arrival_s," not in row))
    uncertain = read_scene(DATA / "camera_and_bang.toml")
    found = fit(read(silent), uncertain)
    (null,) = found.summary.null_directions
    along = [null.parameters[f"charge_{side}_m"] for side in ("east", "north", "up")]
    charge = found.scene.charge
    away = np.array(charge.position_m) - [150.0, -200.0, 1.5]
    np.testing.assert_allclose(3 * np.array(along), away, rtol=1e-4)
    assert "an air arrival (of the bang" in cure_words(null.cure)


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["student", "gaussian"])
def test_intervals_of_many_logs_cover_the_truth(noise):
    truth = scene_of(HEARD)
    layout, sigma, _ = planned_layout(truth)
    quantity, time = layout.quantity, np.asarray(layout.time)
    uncertain = as_seen(open_scene(truth, "origin_time_s"), quantity, time)
    keys = jax.random.split(jax.random.key(1), 400)
    values = jax.jit(
        jax.vmap(lambda k: observe(k, truth, layout, LAWS, sigma, noise=noise))
    )(keys)
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise=noise)
    assert found.converged.mean() > 0.99
    expected = {
        "charge_mass_kg": math.log(MASS),
        "charge_range_m": math.log(RANGE),
        "origin_time_s": 0.0,
        "fireball_growth_s": math.log(own_growth(truth)),
    }
    z = jnp.array([expected[name] for name in found.names])
    inside = (jnp.abs(found.z - z[None, :]) < 1.645 * found.sd()).mean(axis=0)
    # 90 % of 400 is 0.9 +- 0.015; intervals of the normal approximation, so 4 sds
    assert (jnp.abs(inside - 0.9) < 0.06).all(), (found.names, inside)
