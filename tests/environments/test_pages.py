"""The tables of docs/howto/environments.md have the lengths of spaces."""

import re
from functools import partial
from pathlib import Path

import jax
import pytest

from jblast.environments import COMMANDS, environment_params, reset
from jblast.environments.tasks import TASKS, default_guidance

PAGE = Path(__file__).parents[2] / "docs/howto/environments.md"


@pytest.mark.parametrize("task", TASKS)
def test_the_page_lists_every_observation(task):
    rows = re.findall(rf"^\| {task} \| (\d+)(?:-(\d+))? \|", PAGE.read_text(), re.M)
    listed = [n for a, b in rows for n in range(int(a), int(b or a) + 1)]
    guidance = default_guidance() if task == "Mission" else None
    params = environment_params(task, guidance=guidance)
    _, seen = jax.eval_shape(partial(reset, params=params), jax.random.key(0))
    assert listed == list(range(seen.shape[0]))


def test_the_page_lists_every_command():
    rows = re.findall(r"^\| `(\w+)` \| (\d) \|", PAGE.read_text(), re.M)
    assert {name: int(length) for name, length in rows} == dict(COMMANDS)
