import math
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.waves.euler import (
    Ambient,
    IdealGas,
    Primitives,
    front_pressure_at,
    march,
    primitives,
    riemann_profile,
    run,
    simple_wave_means,
    start_sedov,
    start_simple_wave,
    start_sod,
    start_sphere,
    start_tube,
)
from jblast.waves.euler.initial import SOD_LEFT, SOD_RIGHT
from jblast.waves.laws.sedov_taylor import sedov_alpha

AIR = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())


def begun(start, *inputs, **options):
    """Return what a run starts from, by one program instead of one an operation."""
    return eqx.filter_jit(lambda: start(*inputs, **options))()


@eqx.filter_jit
def off_simple_wave(end, gas):
    exact = simple_wave_means(end.radius, 1.5)
    off = jnp.abs(primitives(end, gas).density - exact.density)
    return jnp.sum(off * jnp.diff(end.radius))


def wave_error(cells, overtaking):
    flow, state = begun(start_simple_wave, cells, overtaking=overtaking)
    return float(off_simple_wave(march(state, flow, 1.5).state, flow.gas))


@pytest.mark.parametrize("overtaking", [0.0, 0.2])
def test_smooth_flow_converges_with_second_order(overtaking):
    coarse, fine = wave_error(150, overtaking), wave_error(300, overtaking)
    # 2.0 to 2.1 from 240 cells on; 1.9 where the limiter still shows at the crest
    assert math.log2(coarse / fine) > 1.85
    assert fine < 7e-4


def test_sods_tube_converges_to_its_exact_solution():
    left, right = (Primitives(*map(jnp.asarray, q)) for q in (SOD_LEFT, SOD_RIGHT))

    @eqx.filter_jit
    def error(end, gas):
        middles = 0.5 * (end.radius[1:] + end.radius[:-1])
        exact = riemann_profile(left, right, IdealGas(), middles / 0.2)
        off = jnp.abs(primitives(end, gas).density - exact.density)
        return jnp.sum(off * jnp.diff(end.radius))

    errors = []
    for cells in (100, 200):
        flow, state = begun(start_sod, cells)
        errors.append(float(error(march(state, flow, 0.2).state, flow.gas)))
    assert errors[1] < 4e-3
    # a captured shock and the corners of the fan: first order
    assert math.log2(errors[0] / errors[1]) > 0.85


def test_still_air_stays_still_while_faces_pass_through_it():
    faces = jnp.linspace(0.0, 1.0, 21)
    rate = 0.2 * faces * (1.0 - faces)
    flow, state = start_tube(
        faces,
        Primitives(jnp.ones(20), jnp.zeros(20), jnp.ones(20)),
        IdealGas(),
        rate=rate,
    )
    end = march(state, flow, 1.0).state
    cells = primitives(end, flow.gas)
    assert float(jnp.max(jnp.abs(end.radius - faces))) > 0.01
    np.testing.assert_allclose(cells.pressure, 1.0, rtol=1e-13)
    np.testing.assert_allclose(cells.density, 1.0, rtol=1e-13)
    np.testing.assert_allclose(cells.velocity, 0.0, atol=1e-13)


def test_a_strong_point_source_goes_where_sedov_says():
    cold = Ambient(jnp.asarray(1e-12), jnp.ones(()), IdealGas())
    flow, state = begun(start_sedov, 1.0, cold, 0.1, cells=50, length=100.0)
    end = march(state, flow, 1.0)
    radius = (float(end.state.time) ** 2 / float(sedov_alpha(1.4))) ** 0.2
    # asked for 0.1 %; 0.0005 % from 0.02 on
    assert radius == pytest.approx(1.0, rel=2e-5)


@pytest.mark.parametrize("source", ["point", "sphere"])
def test_mass_volume_and_energy_grow_by_what_the_shock_overtakes(source):
    if source == "point":
        flow, state = begun(start_sedov, 1.0, AIR, 0.02, cells=40)
        end = 2.0
    else:
        sizes = {"core_cells": 30, "air_cells": 40}
        flow, state = begun(start_sphere, 1.0, 50.0, 8.0, AIR, **sizes)
        end = 4.0
    last = march(state, flow, end).state
    grown = float(last.clock**3 - state.clock**3) / 3.0
    for name, gain in (("mass", 1.0), ("volume", 1.0), ("energy", 2.5)):
        before, after = (float(getattr(s, name).sum()) for s in (state, last))
        # the users ask for 1e-10 of the whole; rounding of 5,000 steps
        assert after - before == pytest.approx(gain * grown, abs=1e-12 * after)
    shells = jnp.diff(last.radius**3) / 3.0
    np.testing.assert_allclose(shells, last.volume, rtol=1e-6)


@pytest.mark.slow
def test_the_peak_follows_the_energy_as_similarity_and_differences_demand():
    def log_peak(log_energy, radius):
        flow, state = start_sedov(jnp.exp(log_energy), AIR, 0.02, cells=80, length=1.0)
        _, history = run(state, flow, 1.2 * radius, records=500, stride=10)
        return jnp.log(front_pressure_at(history, radius) - 1.0)

    peak = jax.jit(log_peak)
    zero, one = jnp.zeros(()), jnp.ones(())
    half = jnp.asarray(0.5)
    _, forward = jax.jvp(lambda x: peak(x, half), (zero,), (one,))

    def central(function, step=0.05):
        near, far = (
            float(function(n * step) - function(-n * step)) / (2 * n * step)
            for n in (1, 2)
        )
        return (4.0 * near - far) / 3.0

    similar = -central(lambda x: peak(zero, 0.5 * jnp.exp(x))) / 3.0
    # 1e-3 is asked for; the scheme is off by 1.3e-3 with 40 cells, a third with 80
    assert float(forward) == pytest.approx(similar, rel=1e-3)
    # what is asked for; read where the last step is cut short they differ by 2e-4
    differences = central(lambda x: peak(x, half))
    assert float(forward) == pytest.approx(differences, rel=1e-4)


@pytest.mark.slow  # half a minute of compilation
def test_reverse_mode_gives_what_forward_mode_gives():
    flow, state = start_sedov(1.0, AIR, 0.02, cells=30, length=1.0)

    def final(log_energy):
        hotter = eqx.tree_at(
            lambda s: s.energy, state, state.energy * jnp.exp(log_energy)
        )
        last, _ = run(hotter, flow, 1.0, records=3, stride=4)
        return jnp.log(primitives(last, flow.gas).pressure[-1])

    zero = jnp.zeros(())
    reverse = jax.jit(jax.grad(final))(zero)
    forward = jax.jit(jax.jacfwd(final))(zero)
    assert float(reverse) == pytest.approx(float(forward), rel=1e-10)


@pytest.mark.slow
def test_a_batch_by_vmap_is_its_members():
    def final(energy):
        flow, state = start_sedov(energy, AIR, 0.02, cells=30, length=1.0)
        return run(state, flow, 1.0, records=3, stride=5)[0].energy

    energies = jnp.array([0.5, 1.0, 2.0])
    together = jax.jit(jax.vmap(final))(energies)
    for energy, row in zip(energies, together, strict=True):
        np.testing.assert_allclose(jax.jit(final)(energy), row, rtol=1e-12)


def test_a_step_beyond_the_limit_is_refused():
    flow, state = start_sod(20)
    with pytest.raises(InputError, match=r"courant: expected at most 1, .* got 1\.2"):
        run(state, flow, 0.1, records=1, courant=1.2)


def test_a_run_that_loses_positivity_says_where_and_keeps_what_it_wrote():
    # a shock of 10,000 to 1 comes to the wall: no step allows for the reflection
    left = jnp.arange(40) < 20
    filled = Primitives(jnp.ones(40), jnp.zeros(40), jnp.where(left, 1e4, 1.0))
    flow, state = start_tube(jnp.linspace(-1.0, 1.0, 41), filled, IdealGas())
    end = march(state, flow, 0.3, stride=1)
    found = re.fullmatch(
        r"positivity lost at r = (\S+) m, t = (\S+) s, in cell (\d+): a step takes its "
        r"density from (\S+) to (\S+) kg/m3, its pressure from (\S+) to (\S+) Pa",
        end.lost,
    )
    assert found
    place, time, cell, density, thinner, pressure, less = map(float, found.groups())
    assert cell == 39
    assert place == pytest.approx(1.0, abs=0.01)
    assert time == pytest.approx(float(end.state.time), rel=1e-5)
    assert min(thinner, less) < 0.0
    # the state is the last good one, and the records go up to it
    cells = primitives(end.state, flow.gas)
    assert density == pytest.approx(float(cells.density[39]), rel=1e-2)
    assert pressure == pytest.approx(float(cells.pressure[39]), rel=1e-2)
    assert min(float(cells.pressure.min()), float(cells.density.min())) > 0.0
    assert len(end.history.clock) > 50
    assert end.history.alive.all()
    assert end.history.clock[-1] == float(end.state.clock)
    # the pure run marks it, in its state and from some record on
    last, history = run(state, flow, 0.3, records=50, stride=2)
    assert not last.alive
    lost = int(np.argmin(history.alive))
    assert 25 < lost < 50
    assert not history.alive[lost:].any()


def test_a_loss_by_the_very_last_step_is_seen():
    left = jnp.arange(40) < 20
    filled = Primitives(jnp.ones(40), jnp.zeros(40), jnp.where(left, 1e4, 1.0))
    flow, state = start_tube(jnp.linspace(-1.0, 1.0, 41), filled, IdealGas())
    good = march(state, flow, 0.3, stride=1).state
    assert good.alive
    assert not run(good, flow, 0.3, records=1)[0].alive


def test_the_state_stays_while_the_end_is_reached():
    flow, state = begun(start_sedov, 1.0, AIR, 0.02, cells=30)
    # a number of no given type is another program than that of a state it returned
    state = jax.tree.map(lambda x: jnp.asarray(x, x.dtype), state)
    f = eqx.filter_jit(lambda s, e: run(s, flow, e, records=2, stride=30)[0])
    there = f(state, 0.0205)
    again = f(there, 0.0205)
    assert float(there.clock) == 0.0205
    np.testing.assert_array_equal(there.energy, again.energy)
