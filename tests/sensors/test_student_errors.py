import jax
import numpy as np
from scipy.stats import kstest, t

from jblast.sensors.simulated_readings import student_errors


def test_they_have_students_distribution():
    # by Kolmogorov's statistic; two degrees of freedom more are told apart
    for freedom in (3.0, 4.0):
        drawn = np.asarray(student_errors(jax.random.key(1), freedom, 60_000))
        assert kstest(drawn, t(freedom).cdf).pvalue > 1e-3
        assert kstest(drawn, t(freedom + 2.0).cdf).pvalue < 1e-3


def test_rows_are_independent():
    drawn = jax.vmap(lambda key: student_errors(key, 9.0, 2))(
        jax.random.split(jax.random.key(0), 10_000)
    )
    a, b = np.asarray(drawn).T
    # four standard errors; squares, as one length for both would show in them alone
    assert abs(np.corrcoef(a, b)[0, 1]) < 4e-2
    assert abs(np.corrcoef(np.abs(a) > 1, np.abs(b) > 1)[0, 1]) < 4e-2
