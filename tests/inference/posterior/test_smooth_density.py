"""Log densities far from their modes: no steps, and slopes that are derivatives."""

import dataclasses
from pathlib import Path

import jax
import numpy as np
import pytest

import calibration
from jblast.inference.density import Density, density_of
from jblast.inference.fitting.solution import solve
from jblast.observations import Observations, read, resolve_positions
from jblast.observations.grouping import located
from jblast.observations.scenes import for_log
from jblast.scene import UncertainScene, default_scene, read_scene, with_laws
from jblast.sensors.simulated_readings import Noise

DATA = Path(calibration.__path__[0]) / "data"
LOGS = ("hta_1", "hri_2", "trinity", "five_microphones", "camera_and_bang", "six_clips")
FORD: dict[str, str] = {
    "positive_impulse_pa_s": "ford_2021",
    "positive_duration_s": "ford_2021",
}
REACH, STEP = 5.0, 0.0125
"""How far from the mode each coordinate goes, and in what steps. Both are less for a
coordinate, as a time, of which a tenth of a standard deviation is less than a step."""
DATES = {"six_clips": ("2024-05-17", "UTC")}
"""Date and zone of times of day."""


def kept_log(name: str) -> tuple[Observations, UncertainScene]:
    """Read a log of `calibration/data` and its scene, as `fit` takes them."""
    date, zone = DATES.get(name, (None, None))
    log = read(DATA / f"{name}.csv", date=date, zone=zone)
    scene = DATA / f"{name}.toml"
    uncertain = for_log(read_scene(scene) if scene.exists() else default_scene(), log)
    log = located(log, uncertain)
    return resolve_positions(log, uncertain.scene, uncertain.beliefs), uncertain


def ford_density(name: str, noise: Noise) -> Density:
    """Return the density of a log of impulses and durations."""
    log, uncertain = kept_log(name)
    return density_of(log, with_laws(uncertain, FORD), noise)


def assert_smooth(density: Density, places: np.ndarray, axis: int) -> None:
    """Assert that values follow slopes from place to place, and slopes differences.

    Args:
        density: The density.
        places: Coordinates in even steps along one axis.
        axis: Which.
    """
    both = jax.jit(jax.vmap(jax.value_and_grad(density.log_density)))
    value, slope = (np.asarray(x) for x in both(places))
    assert np.isfinite(value).all()
    slope, steps = slope[:, axis], np.diff(places[:, axis])
    by_slopes = 0.5 * (slope[1:] + slope[:-1]) * steps
    # where one maximum over the effects takes over from another the density has a kink:
    # there the mean slope is off by up to half of its change along a step
    bend = np.abs(np.diff(slope)) * steps
    np.testing.assert_array_less(
        np.abs(np.diff(value) - by_slopes), 0.02 + 0.51 * bend, err_msg=str(axis)
    )
    near = 1e-5 * np.eye(places.shape[1])[axis]
    change = np.asarray(both(places + near)[0]) - np.asarray(both(places - near)[0])
    difference = change / 2e-5
    rounding = 1e-14 * np.abs(value) / 1e-5
    off = np.abs(difference - slope) > 1e-2 * np.abs(difference) + 1e-3 + rounding
    assert not off.any(), (axis, places[off, axis], difference[off], slope[off])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hta_1", "hri_2"])
def test_student_errors_far_from_the_mode_leave_no_steps(name):
    density = ford_density(name, "student")
    assert_smooth(density, np.arange(-4.0, 12.0, STEP)[:, None], 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_each_kept_log_has_a_smooth_density_along_each_coordinate(name):
    solution = solve(*kept_log(name))
    mode = solution.answer.z
    # of each coordinate given the others: a ridge is steeper across than it is long
    steepness = np.abs(np.diag(jax.hessian(solution.density.log_density)(mode)))
    sd = np.minimum(solution.answer.sds, steepness**-0.5)
    offsets = np.arange(-REACH, REACH, STEP)
    scale = np.where(sd > 0, np.minimum(0.1 * sd / STEP, 1.0), 1.0)
    for noise in ("student", "gaussian"):
        rows = dataclasses.replace(solution.density.rows, noise=noise)
        density = dataclasses.replace(solution.density, rows=rows)
        for axis in range(mode.size):
            # a time known to 0.15 ms: 7 sd away it is that of a frame with a fireball,
            # and ln of its radius has no end
            if 0 < sd[axis] < 1e-3:
                continue
            away = scale[axis] * offsets
            places = mode[None, :] + away[:, None] * np.eye(mode.size)[axis]
            assert_smooth(density, places, axis)
