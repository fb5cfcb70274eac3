r"""Regressions of recordings on scaled distance and scaled height, with their scatter.

A law is $\ln(y/S) = f(b, \ln Z, x)$ with coefficients $b$ from a fit, $x = h/S_d$ and a
factor $S$ of `scaling.FACTORS`. The scatter of a new shot contains that of the site, of
the shot and of the uncertain coefficients (delta method), because all are common to its
records.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.quantities import unit_suffix
from jblast.registry import Law
from jblast.types import Float, namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.scaling import (
    Span,
    log_sachs_length,
    log_scaled_distance,
    sachs_distance_factor,
    scaled_value,
)
from jblast.waves.tables import Numbers

FittedForm = Callable[[Any, Any, Any], tuple[Any, tuple[Any, ...]]]
r"""$\ln(y/S)$ at coefficients, $\ln Z$ and $x$, and its derivative by each
coefficient."""


@dataclass(frozen=True)
class Regression:
    """Fitted curve of one quantity, with its scatter.

    Attributes:
        form: The curve as a function of its coefficients.
        coefficients: $b_1$, $b_2$, ...
        covariance: Covariance of the coefficients; zero for one that was not fitted.
        site_sd: Scatter in ln shared by all shots of one site.
        shot_sd: Scatter in ln shared by all records of one shot at the surface.
        path_sd: Scatter in ln shared by the records of one path.
        record_sd: Scatter in ln of one record: scale of a Student-t with 4 degrees of
            freedom.
        burial_sd: Additional scatter of a shot per unit of $-x$, in quadrature.
    """

    form: FittedForm
    coefficients: Sequence[float] | Float[np.ndarray, " b"]
    covariance: Sequence[Sequence[float]] | Float[np.ndarray, "b b"]
    site_sd: float
    shot_sd: float
    path_sd: float
    record_sd: float
    burial_sd: float = 0.0

    def at(self, log_range: Numbers, height: Numbers) -> tuple[Any, tuple[Any, ...]]:
        r"""Return $\ln(y/S)$ at $\ln Z$ and $x$, and its derivatives."""
        # numbers of Python take the precision of the arguments, also single
        return self.form([float(each) for each in self.coefficients], log_range, height)

    def scatter(
        self, log_range: Numbers, height: Numbers
    ) -> tuple[Numbers, float, float]:
        """Return the scatter in ln at a new site: of the shot, a path and a record."""
        _, gradient = self.at(log_range, height)
        fitted = sum(
            float(covariance) * (one * other)
            for row, one in zip(self.covariance, gradient, strict=True)
            for covariance, other in zip(row, gradient, strict=True)
        )
        xp = namespace(log_range, height)
        buried = self.burial_sd * xp.maximum(-height, 0.0)
        shared = self.site_sd**2 + self.shot_sd**2 + buried**2
        return xp.sqrt(shared + fitted), self.path_sd, self.record_sd


@cache
def packaged(name: str, form: FittedForm) -> dict[str, Regression]:
    """Return the regression of each quantity in a file of `data/`."""
    data = files("jblast.waves") / "data" / f"{name}.json"
    curves = json.loads(data.read_text(encoding="utf-8"))["curves"]
    return {
        quantity: Regression(form, **numbers) for quantity, numbers in curves.items()
    }


def softplus(x: Numbers) -> Numbers:
    """Return ln(1 + e^x), without overflow."""
    return namespace(x).logaddexp(x, 0.0)


def logistic(x: Numbers) -> Numbers:
    """Return 1/(1 + e^-x), without overflow."""
    return namespace(x).exp(-softplus(-x))


def log_scaled_place(
    slant_range: Number,
    charge_mass: Number,
    height_of_burst: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
) -> tuple[Numbers, Numbers]:
    r"""Return $\ln Z$ and $x$ [m/kg^(1/3)] by Sachs, or Hopkinson."""
    log_range = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    scale = sachs_distance_factor(charge_mass, ambient_pressure)
    return log_range, height_of_burst / scale


def regression_law(
    quantity: str,
    regression: Regression,
    *,
    ranges: Span,
    heights: Span,
    air: bool,
    name: str,
    title: str = "",
    where: str = "",
    source: str,
) -> Law:
    """Return the law of a regression, ready to register.

    Args:
        quantity: Predicted quantity.
        regression: Its fitted curve.
        ranges: Valid range over $W^{1/3}$, in which the source states it [m/kg^(1/3)].
        heights: Valid height of burst over $W^{1/3}$ [m/kg^(1/3)].
        air: Whether the law depends on the air, by Sachs.
        name: Name of the law, and of the script that measured it.
        title: Name in sentences.
        where: Addition to the range in words.
        source: Reference.
    """

    def law(
        slant_range: Number,
        charge_mass: Number,
        height_of_burst: Number,
        ambient_pressure: Number = STANDARD_PRESSURE,
        sound_speed: Number = STANDARD_SOUND_SPEED,
    ) -> Numbers:
        """Return the quantity, in SI."""
        place = slant_range, charge_mass, height_of_burst, ambient_pressure
        log_value, _ = regression.at(*log_scaled_place(*place))
        log_length = log_sachs_length(charge_mass, ambient_pressure)
        others = slant_range, ambient_pressure, sound_speed
        return scaled_value(unit_suffix(quantity), log_value, log_length, *others)

    def scatter(
        slant_range: Number,
        charge_mass: Number,
        height_of_burst: Number,
        ambient_pressure: Number = STANDARD_PRESSURE,
    ) -> tuple[Numbers, float, float]:
        place = slant_range, charge_mass, height_of_burst, ambient_pressure
        return regression.scatter(*log_scaled_place(*place))

    def valid(slant_range: Number, charge_mass: Number, height_of_burst: Number) -> Any:
        scale = sachs_distance_factor(charge_mass)
        reached, height = slant_range / scale, height_of_burst / scale
        reached = (reached >= ranges[0]) & (reached <= ranges[1])
        return reached & (height >= heights[0]) & (height <= heights[1])

    absent = () if air else ("ambient_pressure", "sound_speed")
    span = "Z = {:g} to {:g} m/kg^(1/3), h/W^(1/3) = {:g} to {:g} m/kg^(1/3)"
    return Law(
        quantity=quantity,
        name=name,
        title=title,
        function=checked(law, absent),
        range=span.format(*ranges, *heights) + where,
        source=source,
        valid=valid,
        scatter=checked(scatter, absent),
        scatter_source=f"measured by calibration/{name}.py",
    )
