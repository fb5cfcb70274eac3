"""Values are dataclasses that become PyTrees when JAX is imported, by whomever."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
import numpy as np
from jblast.scene import Charge, Scene
early = Charge(mass_kg=15.0, position_m=(0.0, 0.0, 1.5))
assert "jax" not in sys.modules
assert isinstance(early.mass_kg, np.ndarray)
import jax
assert jax.__spec__.loader is jax.__loader__
assert len(jax.tree.leaves(early)) == 5, jax.tree.leaves(early)
doubled = jax.jit(lambda charge: jax.tree.map(lambda leaf: 2 * leaf, charge))(early)
assert isinstance(doubled, Charge) and doubled.mass_kg == 30.0
assert doubled.explosive == "TNT"
assert jax.grad(lambda charge: charge.mass_kg**2)(early).mass_kg == 30.0
late = Charge(mass_kg=15.0, position_m=(0.0, 0.0, 1.5))
assert isinstance(late.mass_kg, jax.Array) and late == early
(path, leaf), *_ = jax.tree_util.tree_flatten_with_path(Scene(late))[0]
assert jax.tree_util.keystr(path) == ".charges[0].mass_kg" and leaf == 15.0
"""


def test_a_value_made_before_jax_is_a_pytree_after_it():
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr


def test_values_are_frozen_and_equal_by_their_numbers():
    from jblast.scene import Charge

    charge = Charge(mass_kg=2.0)
    with pytest.raises(AttributeError):
        charge.mass_kg = 3.0  # type: ignore
    assert charge == Charge(mass_kg=2.0)
    assert charge != Charge(mass_kg=3.0)
    assert charge != Charge(mass_kg=2.0, name="a")
