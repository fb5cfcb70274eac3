r"""Regressions of recordings on scaled distance and scaled height, with their scatter.

A law is $\ln(y/S) = f(b, \ln Z, x)$ with coefficients $b$ from a fit, $x = h/S_d$ and a
factor $S$. The scatter of a new shot contains that of the site, of the shot and of the
uncertain coefficients (delta method), because all are common to its records.
"""

import json
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from jblast.types import Float, namespace
from jblast.waves.tables import Numbers


@dataclass(frozen=True)
class Regression:
    """Fitted curve of one quantity, with its scatter.

    Attributes:
        coefficients: $b_1$, $b_2$, ...
        covariance: Covariance of the coefficients; zero for one that was not fitted.
        site_sd: Scatter in ln shared by all shots of one site.
        shot_sd: Scatter in ln shared by all records of one shot at the surface.
        path_sd: Scatter in ln shared by the records of one path.
        record_sd: Scatter in ln of one record: scale of a Student-t with 4 degrees of
            freedom.
        burial_sd: Additional scatter of a shot per unit of $-x$, in quadrature.
    """

    coefficients: Sequence[float] | Float[np.ndarray, " b"]
    covariance: Sequence[Sequence[float]] | Float[np.ndarray, "b b"]
    site_sd: float
    shot_sd: float
    path_sd: float
    record_sd: float
    burial_sd: float = 0.0

    @staticmethod
    @abstractmethod
    def log_curve(coefficients: Any, log_range: Numbers, height: Numbers) -> Numbers:
        r"""Return $\ln(y/S)$ at $\ln Z$ and $x$."""

    @staticmethod
    @abstractmethod
    def log_gradient(
        coefficients: Any, log_range: Numbers, height: Numbers
    ) -> tuple[Numbers, ...]:
        """Return the derivative of `log_curve` by each coefficient."""

    def value(self, log_range: Numbers, height: Numbers) -> Numbers:
        r"""Return $y/S$ at $\ln Z$ and $x$."""
        xp = namespace(log_range, height)
        return xp.exp(self.log_curve(self._numbers(), log_range, height))

    def scatter(
        self, log_range: Numbers, height: Numbers
    ) -> tuple[Numbers, float, float]:
        """Return the scatter in ln at a new site: of the shot, a path and a record."""
        gradient = self.log_gradient(self._numbers(), log_range, height)
        fitted = sum(
            float(covariance) * (one * other)
            for row, one in zip(self.covariance, gradient, strict=True)
            for covariance, other in zip(row, gradient, strict=True)
        )
        xp = namespace(log_range, height)
        buried = self.burial_sd * xp.maximum(-height, 0.0)
        shared = self.site_sd**2 + self.shot_sd**2 + buried**2
        return xp.sqrt(shared + fitted), self.path_sd, self.record_sd

    def _numbers(self) -> list[float]:
        # Python numbers take the precision of the arguments, also single.
        return [float(each) for each in self.coefficients]


@cache
def packaged_curves(name: str) -> dict[str, dict[str, Any]]:
    """Return the numbers of each quantity's regression in a file of `data/`."""
    data = files("jblast.waves") / "data" / f"{name}.json"
    return json.loads(data.read_text(encoding="utf-8"))["curves"]


def softplus(x: Numbers) -> Numbers:
    """Return ln(1 + e^x), without overflow."""
    return namespace(x).logaddexp(x, 0.0)


def logistic(x: Numbers) -> Numbers:
    """Return 1/(1 + e^-x), without overflow."""
    return namespace(x).exp(-softplus(-x))
