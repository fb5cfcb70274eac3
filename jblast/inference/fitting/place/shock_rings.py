"""How far a shock went: where its peak overpressure has fallen to a few values."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.inference.fitting.result import Fit
from jblast.registry import Law
from jblast.scene import Scene
from jblast.sensors.calculator import (
    SCALED_DISTANCES,
    calculated_laws,
    evaluate,
    scene_path,
)

PEAK = "peak_overpressure_pa"
LEVELS = (1e3, 5e3, 20e3, 100e3)
"""Where no one says otherwise [Pa]."""


@dataclass(frozen=True)
class ShockRing:
    """Where a peak overpressure is reached, on level ground at the height 0.

    Attributes:
        peak_overpressure_pa: The value.
        range_m: How far from the charge along the ground, at the answer [m].
        range_q05_m: By the 5 % quantile of the mass, the law taken as exact [m].
        range_q95_m: By its 95 % quantile [m].
        law: Name of the law.
        valid: Whether it holds there.
    """

    peak_overpressure_pa: float
    range_m: float
    range_q05_m: float
    range_q95_m: float
    law: str
    valid: bool


def shock_rings(
    fit: Fit, shot: int = 0, levels: Sequence[float] = LEVELS
) -> tuple[ShockRing, ...]:
    """Return where a charge's shock falls to some peaks, by the answer's law and mass.

    The law is the one that read the log's peak overpressures; without any, one of the
    same source as another of the log's. No ring where there is no such law, where
    the mass is not identified, or where the charge stands higher than it is wide.

    Args:
        fit: The fit.
        shot: Which of the scene's charges.
        levels: Peak overpressures [Pa].
    """
    law = peak_law(fit)
    charge = fit.scene.charges[shot]
    mass = f"charge_mass_kg{fit.scene.label(charge)}"
    masses = [float(charge.mass_kg)] * 3
    if mass in fit.summary.free:
        estimate = fit.summary.estimates[mass]
        if not estimate.identified:
            return ()
        masses = [estimate.q05, float(charge.mass_kg), estimate.q95]
    if law is None or not np.isfinite(masses).all() or not min(masses) > 0.0:
        return ()
    alone = replace(fit.scene, charge=charge, others=())
    ranges, valid = ranges_at(alone, law, masses, levels)
    height = float(np.asarray(charge.position_m)[2])
    along = np.sqrt(np.maximum(ranges**2 - height**2, 0.0))
    return tuple(
        ShockRing(
            peak_overpressure_pa=level,
            range_m=float(along[1, i]),
            range_q05_m=float(along[0, i]),
            range_q95_m=float(along[2, i]),
            law=law.name,
            valid=bool(ok),
        )
        for i, (level, ok) in enumerate(zip(levels, valid[1], strict=True))
        if np.isfinite(along[:, i]).all() and along[1, i] > 0.0
    )


def peak_law(fit: Fit) -> Law | None:
    """Return the law of the peak that goes with an answer; None where there is none.

    The one that read the log's peaks, else that of the same source as another law of
    the answer.
    """
    by_name = {law.name: law for law in calculated_laws(PEAK)}
    used = fit.summary.law
    for name in (used.get(PEAK), *used.values()):
        if name in by_name:
            return by_name[name]
    return None


def ranges_at(
    scene: Scene, law: Law, masses: Sequence[float], levels: Sequence[float]
) -> tuple[Float[np.ndarray, "mass level"], Bool[np.ndarray, "mass level"]]:
    r"""Return how far from a charge a law's peak last passes each level.

    The law is looked at where the calculator's `roots` looks, all masses at once; one
    of several roots is the outermost. Between two points, 0.4 % apart, $\ln p$ runs
    straight in $\ln R$: the range is off by 1e-5 of itself where the slope is smooth.

    Args:
        scene: Charge, air and ground; the mass of its charge is not used.
        law: Of the peak overpressure.
        masses: Of the explosive [kg], positive.
        levels: Peak overpressures [Pa].

    Returns:
        Slant ranges [m], NaN where a level is not reached; and whether the law holds
        on both sides.
    """
    ambient = float(scene_path(scene).ambient_pressure)
    scale = (
        float(scene.charge.tnt_factor_for(law.quantity)) * STANDARD_PRESSURE / ambient
    )
    log_range = (
        np.log(SCALED_DISTANCES) + np.log(scale * np.asarray(masses))[:, None] / 3
    )
    count = log_range.shape[1]
    mass = np.repeat(np.asarray(masses, float), count)
    value, holds = evaluate(scene, np.exp(log_range.ravel()), mass, (law,))
    with np.errstate(divide="ignore", invalid="ignore"):
        log_peak = np.log(value[0].reshape(log_range.shape))
    holds = holds[0].reshape(log_range.shape)
    ranges = np.full((len(masses), len(levels)), np.nan)
    valid = np.zeros(ranges.shape, bool)
    for i, j in np.ndindex(ranges.shape):
        above = log_peak[i] - np.log(levels[j])
        last = np.flatnonzero((above[:-1] >= 0.0) & (above[1:] < 0.0))
        if last.size:
            k = last[-1]
            part = above[k] / (above[k] - above[k + 1])
            ranges[i, j] = np.exp(
                log_range[i, k] + part * (log_range[i, k + 1] - log_range[i, k])
            )
            valid[i, j] = holds[i, k] and holds[i, k + 1]
    return ranges, valid
