"""jblast in JAX's default precision, in which GPUs are fast.

The rest of the tests run in float64, which cannot be undone in the same process.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from jblast.inference import solve
from tests.inference.clocks_off import ASKED, heard
from tests.tools.single_precision import fitted

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def in_float32():
    """Ask `single_precision.py`; promotions are spelled out, warnings errors too."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "tests/tools/single_precision.py"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "JAX_ENABLE_X64": "0",
            "JAX_NUMPY_DTYPE_PROMOTION": "strict",
            "JAX_COMPILATION_CACHE_DIR": str(ROOT / ".jax_cache" / "jblast"),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        },
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("question", ["laws", "recording"])
def test_values_and_gradients_are_finite_and_stay_in_single_precision(
    in_float32, question
):
    told = in_float32[question]
    assert told
    for name, arrays in told.items():
        assert arrays, name
        for dtype, finite in arrays:
            assert dtype in ("float32", "bool"), name
            assert finite, name


@pytest.mark.slow
def test_a_fit_gives_the_mass_back(in_float32):
    answer = in_float32["fit"]
    mass = answer["estimates"]["charge_mass_kg"]
    assert answer["converged"]
    assert answer["identifiable"]
    # as in float64, but for the pressures, which the laws made in float32
    assert mass == pytest.approx(fitted()["estimates"]["charge_mass_kg"], rel=1e-6)
    assert mass["value"] == pytest.approx(15.0, rel=3e-4)


def test_a_place_and_a_time_are_fitted_in_double_precision_anyway():
    log = heard("arrivals", np.random.default_rng(4))
    there = solve(log, ASKED).answer.values
    with jax.enable_x64(False):
        here = solve(log, ASKED).answer.values
    np.testing.assert_array_equal(here, there)
