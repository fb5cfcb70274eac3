"""Which views stand for a direction, and for how much."""

import jax.numpy as jnp
import numpy as np

from jblast.sensors.camera.baked_explosion import (
    nearest_side,
    shown_towards,
    three_sides,
    triangles,
)


def unit(rng, count, *, above):
    way = rng.normal(size=(count, 3))
    way[:, 2] = np.abs(way[:, 2]) if above else way[:, 2]
    return way / np.linalg.norm(way, axis=1)[:, None]


def test_weights_are_shares_of_three_views_and_one_at_a_view():
    rng = np.random.default_rng(0)
    views = unit(rng, 20, above=True)
    corners, inverses = (jnp.asarray(part) for part in triangles(views))
    for way in unit(rng, 50, above=False):
        view, share = three_sides(corners, inverses, jnp.asarray(3.0 * way))
        np.testing.assert_allclose(np.sum(share), 1.0, rtol=1e-6)
        assert np.min(share) >= 0.0
        found = set(np.asarray(view)[np.asarray(share) > 1e-9].tolist())
        assert found <= set(shown_towards(views, way[None], 3).tolist())
    for number, way in enumerate(views):
        view, share = three_sides(corners, inverses, jnp.asarray(way))
        part = np.asarray(share)[np.asarray(view) == number]
        np.testing.assert_allclose(part.sum(), 1.0, atol=1e-5)
        assert int(nearest_side(jnp.asarray(views), jnp.asarray(way))[0][0]) == number


def test_weights_are_continuous_all_the_way_round():
    views = unit(np.random.default_rng(1), 12, above=True)
    corners, inverses = (jnp.asarray(part) for part in triangles(views))
    steps = np.linspace(0.0, 2 * np.pi, 1500)
    ways = np.stack([np.cos(steps), 0.8 * np.sin(steps), 0.6 * np.sin(steps)], -1)
    shares = np.zeros((len(ways), len(views)))
    for row, way in zip(shares, ways, strict=True):
        view, share = three_sides(corners, inverses, jnp.asarray(way))
        np.add.at(row, np.asarray(view), np.asarray(share))
    # a step is 0.004 rad, an edge of a small triangle a tenth of a radian
    assert np.abs(np.diff(shares, axis=0)).max() < 0.1
