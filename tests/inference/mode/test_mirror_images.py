"""Layouts with a symmetry have two optima, both of which are found."""

import jax.numpy as jnp
import numpy as np

from jblast.inference.mode.search import Optima, with_mirror_images
from tests.catalogue import AROUND, BOTH
from tests.inference.shots import place_of, shot

LINE = ((-60.0, 0.0), (-20.0, 0.0), (15.0, 0.0), (70.0, 0.0), (110.0, 0.0))


def found(posterior, **values):
    z = jnp.asarray(place_of(posterior, **values))
    return Optima(z[None, :], posterior.log_density(z)[None])


def named(posterior, name):
    return posterior.parameters.names.index(name)


def test_both_sides_of_a_line_of_sensors_are_found():
    posterior = shot(LINE, BOTH)
    best = found(posterior)
    both = with_mirror_images(posterior, best)
    assert len(both.z) == 2
    north = named(posterior, "charge_north_m")
    assert sorted(np.sign(both.z[:, north])) == [-1, 1]
    # the image is climbed to its optimum; the place given is the truth, below it
    assert min(both.log_density) >= best.log_density[0] - 1e-6


def test_a_charge_on_the_line_is_its_own_image():
    posterior = shot(LINE, BOTH)
    best = found(posterior, charge_north_m=0.0)
    assert len(with_mirror_images(posterior, best).z) == 1


def test_sensors_all_around_have_no_image():
    posterior = shot(AROUND, BOTH)
    assert len(with_mirror_images(posterior, found(posterior)).z) == 1
