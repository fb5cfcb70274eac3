"""Mirror images of an optimum: places that a symmetric layout cannot tell apart.

Sensors in a line, seen from above, measure the same of a charge on either side of it;
sensors in a plane the same of a charge above and below it. A search need not end at
both, so the image of the best optimum is looked up, and climbed from.
"""

from itertools import combinations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.mode.laplace import climbed
from jblast.inference.mode.search import Optima
from jblast.inference.mode.starts import typical_step
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.posterior import Posterior
from jblast.parameters import CHARGE_POSITION
from jblast.scene import Free

FLAT = 0.03
"""A layout whose extent across its line or plane is a smaller share of that along it is
taken as symmetric: an image by a wider one is off the log by more than arrival times
with a scatter of 1 % allow."""
ROUNDS = 20
"""Newton steps from an image to its optimum."""
GAIN = 1e-6
"""A step that gains less than this in ln of the density is the last."""
ASIDE = 2.0
"""An optimum nearer to its image than this many standard deviations is one with it."""


def with_mirror_images(posterior: Posterior, found: Optima) -> Optima:
    """Add the mirror images of the best optimum that are optima themselves.

    Args:
        posterior: What was searched.
        found: Ends of the search, the best first.
    """
    best = np.asarray(found.z)[0]
    known = np.asarray(information(posterior, jnp.asarray(best)))
    least = np.diag(1e-6 / np.square(np.asarray(typical_step(posterior))))
    everything = np.eye(len(best))

    def known_at(z):
        return np.asarray(information(posterior, jnp.asarray(z))) + least, everything

    images = []
    for image in _images(posterior, best):
        away = image - best
        if not away @ known @ away > ASIDE**2:
            continue
        end = climbed(posterior, image, known_at, np.add, rounds=ROUNDS, gain=GAIN)
        away = end.z - best
        if away @ known @ away > ASIDE**2:
            images.append((end.z, end.log_density))
    if not images:
        return found
    z = np.concatenate([np.asarray(found.z), np.array([z for z, _ in images])])
    density = np.append(np.asarray(found.log_density), [d for _, d in images])
    order = np.argsort(-density, kind="stable")
    # the best of the search stays the answer unless an image is better by itself
    order = np.concatenate([[0], order[order != 0]])
    if density[order[1:]].max() > density[0] + GAIN:
        order = np.argsort(-density, kind="stable")
    return Optima(jnp.asarray(z[order]), jnp.asarray(density[order]))


def _images(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> list[Float[np.ndarray, " free"]]:
    """Return the images of a place in the symmetries of the layout."""
    parameters, layout = posterior.parameters, posterior.layout
    scene = parameters.scene
    placed = ~(np.asarray(layout.slant_range) > 0)
    position = np.unique(np.asarray(layout.position)[placed], axis=0)
    if len(scene.charges) > 1 or scene.charge.range_m is not None or len(position) < 2:
        return []

    def free(name):
        at = parameters.names.index(name) if name in parameters.names else -1
        return at if at >= 0 and isinstance(parameters.beliefs[at], Free) else -1

    east, north, up = map(free, CHARGE_POSITION)
    middle = position.mean(axis=0)
    width = float(np.ptp(position, axis=0).max())
    mirrors = []
    if east >= 0 and north >= 0:
        _, sizes, axes = np.linalg.svd(position[:, :2] - middle[:2])
        if len(position) == 2 or sizes[1] < FLAT * sizes[0]:
            normal = np.zeros(len(z))
            normal[[east, north]] = axes[1]
            mirrors.append((normal, middle[:2] @ axes[1]))
    if up >= 0 and np.ptp(position[:, 2]) < FLAT * width:
        normal = np.zeros(len(z))
        normal[up] = 1.0
        mirrors.append((normal, middle[2]))
    images = []
    for count in range(1, len(mirrors) + 1):
        for some in combinations(mirrors, count):
            image = np.array(z)
            for normal, offset in some:
                image = image - 2 * (normal @ image - offset) * normal
            images.append(image)
    return images
