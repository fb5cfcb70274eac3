"""What an environment is built of is checked, and named where it cannot be used."""

import math
import re
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

from jblast.environments import COMMANDS, Randomisation, environment_params, reset
from jblast.environments.tasks import TASKS, default_guidance
from jblast.errors import InputError
from jblast.scene import Normal, Uniform, WorldSpec
from jblast.scene.random_blasts import ByRate


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
