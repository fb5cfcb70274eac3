import importlib

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.verification.stability.waveforms import (
    fewest_cells,
    sod_end,
    torn,
    wave_error,
)
from jblast.waves.euler import (
    Ambient,
    IdealGas,
    decay_at,
    march,
    point_source_march,
    run,
    start_sedov,
    start_sod,
)


def test_steps_beyond_the_limit_lose_the_flow_and_are_refused():
    alive, usual = sod_end(0.7)
    assert alive
    # the edge measured is 1.13
    alive, at_limit = sod_end(1.05)
    assert alive
    assert at_limit < 1.3 * usual
    assert not sod_end(1.2)[0]
    flow, state = start_sod(20)
    for attempt in (
        lambda: run(state, flow, 0.1, records=1, courant=1.001),
        lambda: march(state, flow, 0.1, courant=1.001),
    ):
        with pytest.raises(InputError, match="courant: expected at most 1"):
            attempt()


def test_accuracy_goes_before_stability_and_not_at_the_usual_step():
    short = wave_error(0.1)
    assert wave_error(0.7) < 2.0 * short
    assert 3.0 * short < wave_error(1.0) < 10.0 * short
    assert np.isinf(wave_error(1.25))


def test_a_grid_too_coarse_for_the_source_is_refused():
    air = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())
    with pytest.raises(InputError, match="cells: expected at least 20"):
        start_sedov(1.0, air, 0.02, cells=19)
    start_sedov(1.0, air, 0.02, cells=20)


@pytest.mark.slow  # four grids, each compiled
def test_a_coarser_grid_would_miss_half_a_per_cent(monkeypatch):
    fewest = fewest_cells()
    at = np.array([0.3])

    def pressure(cells):
        run = point_source_march(cells, 0.31)
        return float(decay_at(at, run).overpressure_ratio[0])

    fine = pressure(4 * fewest)
    # half a per cent is what the solver promises from lambda = 0.3 on
    assert abs(pressure(fewest) / fine - 1.0) < 5e-3
    module = importlib.import_module("jblast.waves.euler.initial")
    monkeypatch.setattr(module, "FEWEST_SEDOV_CELLS", 1)
    for cells in (8, 12):
        assert abs(pressure(cells) / fine - 1.0) > 5e-3


def test_gas_torn_apart_stops_the_run_and_slower_gas_does_not():
    # the edge measured is Mach 0.95, each half
    assert torn(0.9) == ""
    assert "positivity lost at r = " in torn(1.0)
