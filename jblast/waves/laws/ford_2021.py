r"""Ford et al. (2021): far-field impulse and duration, with height of burst and burial.

The form was read in Williams, Picard and Anderson (2026), Geophys. J. Int. 245,
ggag125, and in LANL's MultiPEM. With $Z = R/S_d$, $x = h/S_d$ (Sachs, `scaling.py`;
$h < 0$ is buried), $y$ in Pa s or s and $S$ Sachs' factor of it,

$$\ln(y/S) = b_1 + b_2 \ln Z - b_4 \ln(1 + e^{-b_3 x})$$

The printed form has $b_4 = 1$: a charge above the ground would have half the impulse.
The recordings show a reduction by a fifth to a quarter, so $b_4$ is free for the
impulse. Outside its range the curve remains this power law, marked invalid.

Coefficients, their covariance and the scatter of real blasts about the curve are in
`data/ford_2021.json`, written by `calibration/ford_2021.py` from 18 chemical shots of
175 to 744 kg, R/W^(1/3) from 23 to 902 m/kg^(1/3), h/W^(1/3) from -0.61 to 0.81.

The range ends where recordings no longer confirm the law. With each shot left out of
the fit in turn, the 90 % intervals contain the masses of the fifteen shots at h/W^(1/3)
= -0.18 and higher. Of the three from -0.37 to -0.61 one is missed by 0.55 in ln W with
a stated sd of 0.21 (`calibration/leave_out.py`). Three shots are too few to estimate
the growth of the scatter, so the range ends between, although all shots are part of the
fit. Above 0.81 there is no shot; there the ground term has vanished, and at 1 a charge
is free of the ground.
"""

from typing import Any

from jblast.registry import Law, register
from jblast.waves.regression import (
    Regression,
    logistic,
    packaged,
    regression_law,
    softplus,
)
from jblast.waves.tables import Numbers


def ford_2021_form(
    coefficients: Any, log_range: Numbers, height: Numbers
) -> tuple[Numbers, tuple[Numbers, ...]]:
    r"""Return $\ln(y/S)$ at $\ln Z$ and $x$ by the equation above, and derivatives."""
    b1, b2, b3, b4 = coefficients
    above, share = softplus(-b3 * height), logistic(-b3 * height)
    ones = 1.0 + 0.0 * log_range
    slopes = ones, log_range, b4 * height * share, -above
    return b1 + b2 * log_range - b4 * above, slopes


def ford_2021_law(quantity: str, regression: Regression, name: str) -> Law:
    """Return the law of the packaged regression, or of another.

    This makes it possible to leave a shot out of the fit that it is compared with.

    Args:
        quantity: Impulse or duration of the positive phase.
        regression: Fitted curve.
        name: Name of the law, as in `--law NAME`.
    """
    return regression_law(
        quantity,
        regression,
        ranges=(20.0, 1000.0),
        # One of the three deeper shots is missed by far.
        heights=(-0.2, 1.0),
        air=True,
        name=name,
        title=name.replace("_", " ").capitalize(),
        source="form of Ford et al. 2021 (in GJI 245 ggag125), refitted to its "
        "recordings",
    )


ford_2021_impulse, ford_2021_duration = (
    register(ford_2021_law(quantity, regression, "ford_2021")).function
    for quantity, regression in packaged("ford_2021", ford_2021_form).items()
)
