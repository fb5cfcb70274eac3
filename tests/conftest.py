"""Every test runs in float64 with promotions spelled out."""

import os

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")
os.environ.setdefault("MPLBACKEND", "agg")


@pytest.fixture(autouse=True, scope="module")
def forget_what_was_compiled():
    """Drop compiled programs after each module: thousands would fill the memory."""
    yield
    jax.clear_caches()
