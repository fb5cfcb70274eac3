r"""Peak displacement and velocity of the ground in the P wave of a charge.

With $Z = R/W^{1/3}$ and $x = h/W^{1/3}$ (Hopkinson; $h < 0$ is buried), a quantity $y$
over its factor $S$ ($W^{1/3}$ for a displacement in m, 1 for a velocity in m/s), and no
dependence on the air:

$$\ln(y/S) = b_1 + b_2 \ln Z + \frac{b_3}{1 + e^{b_4 (x - b_5)}}$$

A buried charge moves the ground $e^{b_3}$ times as much as one above it; in between,
at $x = b_5$, ln of the coupling is at the mean of both. Coefficients, their covariance
and the scatter are in `data/ground_motion.json`, from `calibration/ground_motion.py`,
from the P waves of 22 chemical shots of 74 to 744 kg at four sites (S. R. Ford et al.
2021, as LANL's MultiPEM distributes them), Z from 28 to 902 m/kg^(1/3), x from -1.43 to
0.81.

The units of the recordings, metres and metres a second, are inferred from the axes of a
figure (Williams, Picard and Anderson 2026, Geophys. J. Int. 245, ggag125, fig. 4), with
medium confidence; their component is not specified. Rocks differ: one of the four sites
moves a twentieth as far as the others, and in wet rock two equal charges at one site
differ by 2.5 in ln of the velocity. The scatter of the law contains both: the variance
of a site and of a shot is its posterior mean over what four sites and 22 shots allow.
"""

from typing import Any

from jblast.registry import register
from jblast.waves.regression import logistic, packaged, regression_law
from jblast.waves.tables import Numbers


def ground_motion_form(
    coefficients: Any, log_range: Numbers, height: Numbers
) -> tuple[Numbers, tuple[Numbers, ...]]:
    r"""Return $\ln(y/S)$ at $\ln Z$ and $x$ by the equation above, and derivatives."""
    b1, b2, b3, b4, b5 = coefficients
    coupled = logistic(b4 * (b5 - height))
    slope = b3 * coupled * (1.0 - coupled)
    ones = 1.0 + 0.0 * log_range
    slopes = ones, log_range, coupled, slope * (b5 - height), slope * b4
    return b1 + b2 * log_range + b3 * coupled, slopes


GROUND_MOTION = packaged("ground_motion", ground_motion_form)
"""Regression of each quantity, from all 22 shots."""
ground_motion_displacement, ground_motion_velocity = (
    register(
        regression_law(
            quantity,
            GROUND_MOTION[quantity],
            # Recorded are Z = 28 to 902 and x = -1.43 to 0.81, rounded outward.
            ranges=(25.0, 1000.0),
            heights=(-1.5, 1.0),
            air=False,
            name="ground_motion",
            where=", along rock",
            source="fitted to P waves recorded by Ford et al. 2021 (units inferred)",
        )
    ).function
    # By Hopkinson charges of all sizes have one velocity at one Z.
    for quantity in ("ground_displacement_m", "ground_peak_velocity_m_s")
)
