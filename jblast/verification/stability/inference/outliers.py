"""One reading far off: how far normal errors, and Student-t errors, move the mass."""

import functools
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference import fit_many, solve
from jblast.inference.fitting.goodness_of_fit import (
    standardised_residuals,
    suspected_outliers,
)
from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.observations import Observations
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.inference.arrival_logs import (
    FITS,
    LAWS,
    SIGMA,
    SolvedLog,
    ring,
    solved_log,
)

FAR = 20
"""The size that is told of [standard deviations]."""
SIZES = np.arange(0.0, 2 * FAR + 1)
"""Tried by `solve` [sds]."""
FINE = np.linspace(0.0, 2 * FAR, FITS)
"""Tried by least squares [sds]."""
WHICH = 0
"""The nearest sensor, which tells most."""


class Moved(NamedTuple):
    """What a reading ever further off does to ln of the mass.

    Attributes:
        normal: How far normal errors move it, by `FINE` [sds without the outlier].
        student: How far Student-t errors do, as `solve` takes them, by `SIZES`.
        named: Whether the reading is suspected, by `SIZES`.
    """

    normal: Float[np.ndarray, " fine"]
    student: Float[np.ndarray, " size"]
    named: Bool[np.ndarray, " size"]


@functools.cache
def moved() -> Moved:
    """Fit the same log with one reading ever further off."""
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    posterior, z = clean.solution.posterior, clean.solution.laplace.z
    normal = fit_many(
        clean.uncertain,
        posterior.layout,
        np.array([_off(clean.log, size).value for size in FINE]),
        np.asarray(posterior.sigma),
        LAWS,
        noise="gaussian",
        starts=np.tile(z, (len(FINE), 1)),
    )
    mass = np.asarray(normal.z)[:, 0]
    sd = float(normal.sd()[0, 0])
    found = [_by_student(clean, _off(clean.log, size)) for size in SIZES]
    student = np.array([at for at, _ in found])
    return Moved(
        (mass - mass[0]) / sd,
        (student - student[0]) / sd,
        np.array([named for _, named in found]),
    )


def _off(log: Observations, size: float) -> Observations:
    value = log.value.copy()
    value[WHICH] += size * SIGMA
    return replace(log, value=value)


def _by_student(clean: SolvedLog, log: Observations) -> tuple[float, bool]:
    """Return ln of the mass, and whether the reading is suspected."""
    found = solve(log, clean.uncertain)
    posterior, z = found.posterior, found.laplace.z
    named = suspected_outliers(
        log, standardised_residuals(posterior, z).residual, posterior.noise
    )
    return float(z[0]), any(o.sensor == log.sensor[WHICH] for o in named)


def outlier_failure() -> FailureMode:
    """Measure from which size of one outlier on the interval loses the mass."""
    by = moved()
    size = np.abs(by.normal)
    boundary = float(np.interp(NORMAL_Q95, size, FINE))
    never = np.flatnonzero(~by.named)
    first = SIZES[never[-1] + 1] if never[-1] + 1 < len(SIZES) else np.inf
    worst = int(np.argmax(np.abs(by.student)))
    return FailureMode(
        area="fits",
        method="least squares, normal errors",
        failure="one outlier of eight readings moves the mass out of its 90 % interval",
        boundary=boundary,
        unit="sd of the reading",
        beyond=f"an outlier of {FAR} sd moves ln mass by "
        f"{np.interp(FAR, FINE, size):.1f} of its sd",
        response=verified("marks", bool(first <= FAR), "an outlier"),
        message=f"Student-t errors: moved by {np.abs(by.student[SIZES == FAR])[0]:.2f} "
        f"sd at {FAR}, at most by {np.abs(by.student[worst]):.2f} (by an outlier of "
        f"{SIZES[worst]:.0f}); named among the suspected outliers from {first:.0f} sd "
        "on",
    )
