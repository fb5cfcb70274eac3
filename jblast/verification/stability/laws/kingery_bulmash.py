"""Where the printed polynomials of Kingery and Bulmash break: joins, ends, beyond."""

import math

import jax.numpy as jnp
import numpy as np

from jblast.registry import LAWS
from jblast.scene.charge import Burst
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.threshold import switching_point
from jblast.waves import shock_kinematics_pressure
from jblast.waves.curves import BLEND_WIDTH, LogCurve, Segment
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve

CURVES = {
    "peak_overpressure_pa": "incident_pressure",
    "positive_impulse_pa_s": "incident_impulse",
    "positive_duration_s": "positive_phase_duration",
    "air_arrival_s": "arrival_time",
}
"""Curve of the table by the quantity it gives."""
NEAR, FAR, FARTHEST = 0.01, 100.0, 1e3
"""Scaled distances beyond the ends at which it is looked [m/kg^(1/3)]."""


def kingery_bulmash_failures() -> list[FailureMode]:
    """Measure the joins of both bursts, and the ends of the surface's curves."""
    bursts: tuple[Burst, ...] = ("surface", "free-air")
    joins = [
        mode
        for quantity in CURVES
        for burst in bursts
        for mode in _joins(quantity, burst)
    ]
    return [*joins, *(mode for quantity in CURVES for mode in _ends(quantity))]


def printed_value(curve: LogCurve, z: float) -> float:
    """Return what the printed polynomials give, beyond the table too.

    On a join it is the later one; past the ends the first and the last.
    """
    segment = curve.segments[0]
    for later in curve.segments[1:]:
        if z >= later.z_min:
            segment = later
    with np.errstate(over="ignore"):
        return float(np.exp(segment.log_value(np.float64(math.log(z)))))


def kept_value(curve: LogCurve, z: float) -> float:
    """Return what jblast makes of the curve."""
    return float(jnp.exp(curve.log_value(jnp.asarray(math.log(z)))))


def _joins(quantity: str, burst: Burst) -> list[FailureMode]:
    curve = kingery_bulmash_curve(CURVES[quantity], burst)
    method = f"{quantity} by kingery_bulmash"
    return [
        _join(method, burst, curve, before, after)
        for before, after in zip(curve.segments, curve.segments[1:], strict=False)
    ]


def _join(method, burst, curve, before: Segment, after: Segment) -> FailureMode:
    join = after.z_min
    at = math.log(join)
    jump = math.expm1(after.log_value(at) - before.log_value(at))
    half = math.sqrt(1.0 + BLEND_WIDTH)
    around = np.geomspace(join / half**2, join * half**2, 2001)
    kept = np.array(curve.log_value(jnp.log(around)))
    printed = np.log([printed_value(curve, z) for z in around])
    left = np.expm1(np.abs(kept - printed)).max()
    step = np.abs(np.diff(kept)).max()
    smooth = step < 0.2 * abs(jump) and abs(kept[0] - printed[0]) < 1e-12
    return FailureMode(
        area="laws",
        method=method,
        failure=f"printed curve jumps ({burst})",
        boundary=join,
        unit="m/kg^(1/3)",
        beyond=f"value by {100 * jump:+.2f} %, slope d ln y/d ln Z from "
        f"{before.log_slope(at):.2f} to {after.log_slope(at):.2f}",
        response=verified("holds", bool(smooth), f"{method}, Z = {join:g}"),
        message=f"blended over {100 * BLEND_WIDTH:g} % in Z: no jump, at most "
        f"{100 * left:.2f} % from the print",
    )


def _ends(quantity: str) -> list[FailureMode]:
    law = LAWS[quantity, "kingery_bulmash"]
    curve = kingery_bulmash_curve(CURVES[quantity], "surface")
    method = f"{quantity} by kingery_bulmash"

    def valid(z):
        return bool(law.valid(z, 1.0))

    near, far = switching_point(valid, NEAR, 1.0), switching_point(valid, 1.0, FARTHEST)
    high = law.function(jnp.asarray([FAR, FARTHEST]), 1.0)
    goes_on = bool(jnp.all(jnp.isfinite(high) & (high > 0))) and _is_power_law(law, far)
    said = "power law with the end slope, law_valid false"
    if quantity == "peak_overpressure_pa":
        weak = float(shock_kinematics_pressure(FARTHEST, 1.0))
        said += (
            f": {float(high[1]):.3g} Pa at Z = {FARTHEST:g}, where shock_kinematics "
            f"has {weak:.3g}"
        )

    def lie(z):
        ratio = printed_value(curve, z) / kept_value(curve, z)
        return f"{'overflows' if math.isinf(ratio) else f'{ratio:.3g}'} at Z = {z:g}"

    return [
        FailureMode(
            area="laws",
            method=method,
            failure="table ends near the charge",
            boundary=near,
            unit="m/kg^(1/3)",
            beyond=f"polynomial over power law: {lie(NEAR)}",
            response=verified("marks", _is_power_law(law, near), method),
            message="power law with the end slope, law_valid false",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="table ends far out",
            boundary=far,
            unit="m/kg^(1/3)",
            beyond=f"polynomial over power law: {lie(FAR)}, {lie(FARTHEST)}",
            response=verified("marks", goes_on, method),
            message=said,
        ),
    ]


def _is_power_law(law, end: float) -> bool:
    """Whether a law beyond an end of its table has one slope, and is not valid."""
    out = 2.0 if end > 1.0 else 0.5
    z = end * np.array([1.001 if out > 1.0 else 0.999, out, out**2])
    value = np.log(np.asarray(law.function(z, 1.0)))
    slopes = np.diff(value) / np.diff(np.log(z))
    straight = math.isclose(slopes[0], slopes[1], rel_tol=1e-6)
    return straight and not np.any(law.valid(z, 1.0))
