"""Random blasts: exact distributions, exact gaps, and the same for one seed always.

Kolmogorov's and Smirnov's test is one of fixed seeds, so it passes or fails for ever;
at alpha = 1e-3 one seed in a thousand would fail a right law. 4,000 draws tell
distributions apart whose functions differ by 0.03.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import stats

from jblast.errors import InputError
from jblast.scene import Box, ByCount, ByRate, ByTick, Ring, Uniform, WorldSpec
from jblast.world import Blasts, blast_sequence, draw_blasts

ALPHA = 1e-3
MANY = 4000
HERE = jnp.zeros(3)


def worlds(world: WorldSpec, count: int) -> Blasts:
    """Return many worlds by their seeds, in one batch."""
    keys = jax.vmap(jax.random.key)(jnp.arange(MANY))
    draw = jax.jit(jax.vmap(lambda key: blast_sequence(key, world, HERE, count)))
    return jax.tree.map(np.asarray, draw(keys))


def passes(values: Any, distribution: Any) -> bool:
    return stats.kstest(values, distribution.cdf).pvalue > ALPHA


@pytest.fixture(scope="module")
def counted():
    """Five blasts with gaps, on a ring."""
    time, region = Uniform(2.0, 12.0), Ring(10.0, 20.0)
    return worlds(WorldSpec(ByCount(5), region=region, time=time, gap=1.5), 5)


def test_times_of_a_count_are_order_statistics_of_what_the_gaps_leave(counted):
    times = np.sort(counted.time_s, axis=1)
    free = 10.0 - 4 * 1.5
    for number in range(5):
        share = (times[:, number] - 2.0 - 1.5 * number) / free
        assert passes(share, stats.beta(number + 1, 5 - number))


def test_a_number_says_nothing_of_when_its_blast_comes(counted):
    first = np.argmin(counted.time_s, axis=1)
    assert stats.chisquare(np.bincount(first, minlength=5)).pvalue > ALPHA


def test_masses_follow_their_prior(counted):
    assert passes(counted.mass_kg[:, 0], stats.uniform(5, 10))


def test_waits_by_rate_are_exponential_beyond_the_gap():
    world = WorldSpec(ByRate(jnp.asarray(0.5)), time=Uniform(3.0, 100.0), gap=0.7)
    times = worlds(world, 4).time_s
    assert passes(times[:, 0] - 3.0, stats.expon(scale=2.0))
    waits = np.diff(times, axis=1)
    for number in range(3):
        assert passes(waits[:, number] - 0.7, stats.expon(scale=2.0))
    # one after another owes nothing to the one before; 4,000 pairs: sd 0.016
    assert abs(np.corrcoef(waits[:, 0], waits[:, 1])[0, 1]) < 0.05


def test_waits_by_tick_are_geometric_beyond_the_gap():
    world = WorldSpec(ByTick(0.15, 0.5), time=Uniform(1.0, 100.0), gap=1.0)
    times = worlds(world, 3).time_s
    ticks = (times - 1.0) / 0.5
    np.testing.assert_allclose(ticks, np.round(ticks), atol=1e-9)
    waits = [ticks[:, 0] + 1, *(np.diff(ticks, axis=1) - 1).T]  # the gap is 2 ticks
    for wait in waits:
        counts = np.bincount(np.round(wait).astype(int), minlength=40)
        assert counts[0] == 0
        seen = np.append(counts[1:20], counts[20:].sum())
        expected = stats.geom.pmf(np.arange(1, 20), 0.15)
        expected = MANY * np.append(expected, 1 - expected.sum())
        assert stats.chisquare(seen, expected).pvalue > ALPHA


def test_a_certain_blast_comes_at_every_tick():
    world = WorldSpec(ByTick(1.0, 0.5), time=Uniform(1.0, 3.0), gap=0.0)
    times = draw_blasts(0, world).time_s
    np.testing.assert_allclose(times, [1.0, 1.5, 2.0, 2.5, 3.0])


def test_places_are_uniform_over_a_box_and_over_the_area_of_a_ring(counted):
    box = WorldSpec(region=Box(jnp.array([-5.0, 0, 1]), jnp.array([5.0, 2, 4])))
    place = worlds(box, 5).position_m[:, 4]
    for axis, (low, length) in enumerate([(-5, 10), (0, 2), (1, 3)]):
        assert passes(place[:, axis], stats.uniform(low, length))
    place = counted.position_m[:, 2]
    square = np.square(place[:, :2]).sum(axis=1)
    assert passes(square, stats.uniform(100, 300))
    turn = np.arctan2(place[:, 1], place[:, 0])
    assert passes(turn, stats.uniform(-np.pi, 2 * np.pi))
    assert (place[:, 2] == 0).all()


def test_a_region_about_a_vehicle_is_moved_and_a_ring_stays_on_the_ground():
    about = jnp.array([100.0, 200.0, 30.0])
    ring = WorldSpec(region=Ring(10.0, 20.0))
    moved = draw_blasts(1, ring, about).position_m - draw_blasts(1, ring).position_m
    np.testing.assert_allclose(moved, [[100, 200, 0]] * 5)
    box = WorldSpec()
    moved = draw_blasts(1, box, about).position_m - draw_blasts(1, box).position_m
    np.testing.assert_allclose(moved, [[100, 200, 30]] * 5, atol=1e-12)


SEQUENCE = eqx.filter_jit(blast_sequence)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32),
    count=st.sampled_from([1, 2, 7, 40]),  # each is a program
    gap=st.floats(0, 1),
    tightness=st.floats(0, 1),
)
def test_gaps_hold_and_all_blasts_lie_in_their_window(seed, count, gap, tightness):
    length = max((count - 1) * gap / max(tightness, 1e-3), 1e-3)
    world = WorldSpec(ByCount(count), time=Uniform(1.0, 1.0 + length), gap=gap)
    blasts = SEQUENCE(jax.random.key(seed), world, HERE, count)
    times = np.sort(np.asarray(blasts.time_s))
    assert times.size == count
    # a rounding for each of up to 40 gaps
    rounding = (1.0 + length) * 1e-13
    assert (np.diff(times) >= gap - rounding).all()
    assert times[0] >= 1.0
    assert times[-1] <= 1.0 + length + rounding


def alike(these: Blasts, those: Blasts, count: int) -> None:
    """Compare the first blasts of two worlds, to the last bit."""
    for one, other in zip(these, those, strict=True):
        np.testing.assert_array_equal(one[:count], other[:count])


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", [ByRate(jnp.asarray(0.5)), ByTick(0.2, 0.5)], ids=["rate", "tick"]
)
def test_a_longer_world_begins_as_the_shorter_one(how):
    short = draw_blasts(7, WorldSpec(how, time=Uniform(0.0, 50.0)))
    long = draw_blasts(7, WorldSpec(how, time=Uniform(0.0, 200.0)))
    assert 0 < short.time_s.size < long.time_s.size
    assert short.time_s[-1] <= 50.0 < long.time_s[short.time_s.size]
    alike(short, long, short.time_s.size)
    cut = draw_blasts(7, WorldSpec(how, time=Uniform(0.0, 200.0)), until_s=50.0)
    alike(short, cut, short.time_s.size)


def test_more_blasts_leave_the_first_ones_as_they_are():
    few, more = (draw_blasts(3, WorldSpec(ByCount(n), gap=0.0)) for n in (4, 9))
    alike(few, more, 4)
    few, more = (draw_blasts(3, WorldSpec(ByCount(n), gap=0.5)) for n in (4, 9))
    alike(few._replace(time_s=few.mass_kg), more._replace(time_s=more.mass_kg), 4)
    np.testing.assert_array_equal(np.argsort(few.time_s), np.argsort(more.time_s[:4]))


@pytest.mark.slow
def test_a_seed_gives_the_same_world_alone_and_in_a_batch():
    world = WorldSpec(ByRate(Uniform(0.1, 0.2)), gap=Uniform(0.1, 0.2))
    batch = worlds(world, 3)
    alone = blast_sequence(jax.random.key(17), world, HERE, 3)
    for of_batch, one in zip(batch, alone, strict=True):
        # the library of logarithms and cosines of another machine is as far off
        np.testing.assert_allclose(of_batch[17], one, rtol=1e-14)
    apart = {float(time) for time in batch.time_s[:, 0]}
    assert len(apart) == MANY  # no two seeds are alike


@pytest.mark.slow
def test_what_is_drawn_and_cannot_be_is_told():
    tight = WorldSpec(ByCount(5), time=Uniform(0.0, 10.0), gap=Uniform(2.0, 90.0))
    with pytest.raises(InputError, match=r"a.toml: \[world\] \(seed 0\) count: .*fit"):
        draw_blasts(0, tight, source="a.toml")
    often = WorldSpec(ByRate(jnp.asarray(1e4)), gap=0.0)
    with pytest.raises(InputError, match=r"expected at most 10,000 blasts, got more"):
        draw_blasts(0, often)
    never = WorldSpec(ByRate(jnp.asarray(1e-9)))
    assert draw_blasts(0, never).time_s.size == 0
