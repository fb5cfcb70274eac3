"""Environments: what they are built of, and the rules of Gymnasium."""

import math
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from jblast.environments import (
    COMMANDS,
    NAMES,
    QuadrotorBlast,
    QuadrotorEnv,
    Randomisation,
    environment_params,
    reset,
)
from jblast.environments.tasks import TASKS, default_guidance
from jblast.errors import InputError
from jblast.scene import Normal, Uniform, WorldSpec
from jblast.scene.random_blasts import ByRate
from tests.environments.lanes_of_one_blast import PARAMS


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"task": "Hovr"}, "task 'Hovr': expected Hover, Rates, Mission"),
        ({"command": "thrust"}, "command 'thrust': expected rotor_speeds"),
        (
            {"step_s": 0.05},
            "at most 0.03482 s, the stability limit .* iris, got 0.05 s",
        ),
        ({"episode_s": math.nan}, "episode_s: expected a positive number, got nan"),
        ({"world": WorldSpec(ByRate(0.2))}, "expected ByCount of 1 or more"),
        (
            {"randomisation": Randomisation(delay_s=Uniform(0.0, 0.5))},
            "delay_s: expected 0 to 0.1 s, 10 steps, got 0 to 0.5 s",
        ),
        (
            {"randomisation": Randomisation(delay_s=Normal(0.0, 0.5))},
            "delay_s: expected a number or a Uniform",
        ),
        ({"guidance": default_guidance()}, "none but for Mission, got one for Hover"),
    ],
)
def test_what_cannot_be_used_is_named(given, message):
    with pytest.raises(InputError, match=message):
        environment_params(**given)


def test_a_delay_is_counted_in_steps():
    late = Randomisation(delay_s=jnp.asarray(0.03))
    assert environment_params(randomisation=late).most_delay == 3


PAGE = Path(__file__).parents[2] / "docs/howto/environments.md"


@pytest.mark.parametrize("task", TASKS)
def test_the_page_lists_every_observation(task):
    rows = re.findall(rf"^\| {task} \| (\d+)(?:-(\d+))? \|", PAGE.read_text(), re.M)
    listed = [n for a, b in rows for n in range(int(a), int(b or a) + 1)]
    params = environment_params(task)
    _, seen = jax.eval_shape(partial(reset, params=params), jax.random.key(0))
    assert listed == list(range(seen.shape[0]))


def test_the_page_lists_every_command():
    rows = re.findall(r"^\| `(\w+)` \| (\d) \|", PAGE.read_text(), re.M)
    assert {name: int(length) for name, length in rows} == dict(COMMANDS)


STEPS = int(PARAMS.episode_steps)


@pytest.fixture(scope="module")
def lanes():
    return QuadrotorBlast(3, params=PARAMS)


@pytest.mark.parametrize("made", [QuadrotorEnv, QuadrotorBlast])
def test_a_render_mode_is_refused(made):
    with pytest.raises(InputError, match=r"not rendered.*, got 'human'"):
        made(task="Hover", render_mode="human")


def test_in_a_new_process_the_import_registers_them_without_jax():
    script = (
        "import gymnasium, sys, jblast.environments\n"
        "assert gymnasium.spec('jblast/Hover-v0')\n"
        "assert 'jax' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_own_checker_passes_as_registered(name):
    made = gymnasium.make(
        f"jblast.environments:jblast/{name}-v0", disable_env_checker=True
    )
    check_env(made.unwrapped, skip_render_check=True)
    many = gymnasium.make_vec(f"jblast/{name}-v0", num_envs=2)
    seen, _ = many.reset(seed=0)
    assert seen in many.observation_space
    many.action_space.seed(0)
    for _ in range(20):
        seen, reward, *_ = many.step(many.action_space.sample())
        assert seen in many.observation_space
        assert np.isfinite(seen).all()
        assert np.isfinite(reward).all()


@pytest.mark.slow  # a vector of lanes is compiled
def test_one_seed_gives_one_trajectory_and_another_seed_another(lanes):
    def flown(seed):
        rows = [lanes.reset(seed=seed)[0]]
        still = np.zeros((3, 3), np.float32)
        return np.array(rows + [lanes.step(still)[0] for _ in range(STEPS)])

    np.testing.assert_array_equal(flown(5), flown(5))
    assert np.abs(flown(5) - flown(6)).max() > 1e-3


@pytest.mark.parametrize("count", [0, -1, True])
def test_a_vector_without_lanes_is_refused(count):
    with pytest.raises(
        InputError, match="num_envs: expected a whole number, 1 or more"
    ):
        QuadrotorBlast(count)


@pytest.mark.slow
def test_actions_of_another_shape_and_a_step_before_a_reset_are_refused(lanes):
    with pytest.raises(InputError, match="expected a reset before it"):
        QuadrotorBlast(2, params=PARAMS).step(np.zeros((2, 3)))
    lanes.reset(seed=0)
    with pytest.raises(InputError, match=r"expected the shape \(3, 3\), got \(3, 4\)"):
        lanes.step(np.zeros((3, 4)))
    with pytest.raises(InputError, match="expected numbers, got 'up'"):
        lanes.step("up")


def test_options_beside_params_are_refused():
    with pytest.raises(InputError, match="expected no other options, got spread_m"):
        QuadrotorBlast(2, params=PARAMS, spread_m=1.0)
