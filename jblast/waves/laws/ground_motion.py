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

from functools import partial
from typing import Any

from jblast.registry import Law, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.regression import Regression, logistic, packaged_curves
from jblast.waves.tables import Numbers


class GroundMotionCurve(Regression):
    """The regression of one quantity."""

    @staticmethod
    def log_curve(coefficients: Any, log_range: Numbers, height: Numbers) -> Numbers:
        r"""Return $\ln(y/S)$ at $\ln Z$ and $x$: the equation above."""
        b1, b2, b3, b4, b5 = coefficients
        return b1 + b2 * log_range + b3 * logistic(b4 * (b5 - height))

    @staticmethod
    def log_gradient(
        coefficients: Any, log_range: Numbers, height: Numbers
    ) -> tuple[Numbers, ...]:
        """Return the derivative of `log_curve` by each coefficient."""
        _, _, b3, b4, b5 = coefficients
        coupled = logistic(b4 * (b5 - height))
        slope = b3 * coupled * (1.0 - coupled)
        ones = 1.0 + 0.0 * log_range
        return ones, log_range, coupled, slope * (b5 - height), slope * b4


def log_scaled_place(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> tuple[Numbers, Numbers]:
    r"""Return $\ln Z$ and $x$ [m/kg^(1/3)] by Hopkinson."""
    xp = namespace(slant_range, charge_mass, height_of_burst)
    log_scale = xp.log(charge_mass) / 3.0
    return xp.log(slant_range) - log_scale, height_of_burst * xp.exp(-log_scale)


def ground_motion_curve(quantity: str) -> GroundMotionCurve:
    """Return the packaged curve of a quantity, from all 22 shots."""
    return GroundMotionCurve(**packaged_curves("ground_motion")[quantity])


@checked
def ground_motion_displacement(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Numbers:
    r"""Return the peak displacement of the ground [m].

    Args:
        slant_range: Distance $R$ from the charge to the ground there [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        height_of_burst: $h$ [m]; negative is buried.
    """
    place = log_scaled_place(slant_range, charge_mass, height_of_burst)
    xp = namespace(*place)
    value = ground_motion_curve("ground_displacement_m").value(*place)
    return value * xp.exp(xp.log(charge_mass) / 3.0)


@checked
def ground_motion_velocity(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Numbers:
    r"""Return the peak particle velocity of the ground [m/s].

    Args:
        slant_range: Distance $R$ from the charge to the ground there [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        height_of_burst: $h$ [m]; negative is buried.
    """
    place = log_scaled_place(slant_range, charge_mass, height_of_burst)
    # By Hopkinson charges of all sizes have one velocity at one Z: S = 1.
    return ground_motion_curve("ground_peak_velocity_m_s").value(*place)


def ground_motion_valid(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Any:
    """Return True within the range of the recordings."""
    log_range, height = log_scaled_place(slant_range, charge_mass, height_of_burst)
    scaled_range = namespace(log_range).exp(log_range)
    # Recorded are Z = 28 to 902 and x = -1.43 to 0.81; the bounds are rounded outward.
    reached = (scaled_range >= 25.0) & (scaled_range <= 1000.0)
    return reached & (height >= -1.5) & (height <= 1.0)


def ground_motion_scatter(
    quantity: str, slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> tuple[Numbers, float, float]:
    """Return the scatter of a quantity at a new site, in ln."""
    place = log_scaled_place(slant_range, charge_mass, height_of_burst)
    return ground_motion_curve(quantity).scatter(*place)


for _quantity, _law in (
    ("ground_displacement_m", ground_motion_displacement),
    ("ground_peak_velocity_m_s", ground_motion_velocity),
):
    register(
        Law(
            quantity=_quantity,
            name="ground_motion",
            function=_law,
            range="Z = 25 to 1000 m/kg^(1/3), h/W^(1/3) = -1.5 to 1 m/kg^(1/3), "
            "along rock",
            source="fitted to P waves recorded by Ford et al. 2021 (units inferred)",
            valid=ground_motion_valid,
            scatter=partial(ground_motion_scatter, _quantity),
            scatter_source="measured by calibration/ground_motion.py",
        )
    )
