import numpy as np
from scipy.stats import multivariate_normal

from jblast.inference.mcmc.engines import independence_move, mixture_of

CENTER = np.array([[0.0, 0.0], [3.0, -4.0]])
ROOT = np.array([[[1.0, 0.0], [0.0, 1.0]], [[0.5, 0.2], [-0.1, 2.0]]])
SHARE = np.array([0.8, 0.2])
MIXTURE = mixture_of(CENTER, ROOT, 5 * SHARE)


def log_density(w):
    return np.log(
        sum(
            share * multivariate_normal.pdf(w, center, root @ root.T)
            for share, center, root in zip(SHARE, CENTER, ROOT, strict=True)
        )
    )


def drawn(count):
    rng = np.random.default_rng(0)
    w = np.zeros((count, 2))
    return independence_move(
        MIXTURE, w, rng.uniform(size=count), rng.standard_normal(w.shape)
    )


def test_the_factor_is_the_density_left_over_the_density_reached():
    there, factor = drawn(20)
    expected = log_density(np.zeros(2)) - log_density(np.asarray(there))
    np.testing.assert_allclose(factor, expected, rtol=1e-10)


def test_places_have_the_moments_of_the_sum():
    there = np.asarray(drawn(20_000)[0])
    mean = SHARE @ CENTER
    away = CENTER - mean
    covariance = np.einsum("k,kij,klj->il", SHARE, ROOT, ROOT)
    covariance += np.einsum("k,ki,kj->ij", SHARE, away, away)
    products = np.einsum("ni,nj->nij", there - mean, there - mean)
    for drawn_of, expected in ((there, mean), (products, covariance)):
        error = drawn_of.std(axis=0) / np.sqrt(len(there))
        assert np.all(np.abs(drawn_of.mean(axis=0) - expected) < 4 * error)
