"""The answer of `jblast tune --gains`."""

import textwrap
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from jblast.report.words import WIDTH, aligned
from jblast.results import Document
from jblast.study.gains import EvaluatedGains, TunedGains, known_peaks
from jblast.vehicle import STEP_S, Gains, vehicle_of
from jblast.vehicle.control.stability import LOOPS

WORDS = {
    "kp_pos": "position [1/s2]",
    "kd_pos": "velocity [1/s]",
    "ki_pos": "integral [1/s3]",
    "kp_att": "attitude [1/s2]",
    "kd_att": "body rate [1/s]",
}


@dataclass(frozen=True)
class LoopMargins:
    """Stability margins of one loop; null is an infinite margin.

    Attributes:
        gain_up_db: Largest increase of the rotors' gain.
        gain_down_db: Largest decrease of the rotors' gain.
        phase_deg: Largest additional phase lag.
        distance: Least distance of the loop's frequency response from -1.
    """

    gain_up_db: float
    gain_down_db: float
    phase_deg: float
    distance: float


@dataclass(frozen=True)
class Peaks:
    """Peak deviations from the target over the unseen blasts [m]; null is infinite.

    Attributes:
        q50: Median.
        q90: 90 % quantile.
        worst: The largest.
    """

    q50: float
    q90: float
    worst: float


@dataclass(frozen=True)
class TriedGains:
    """A position controller with some gains.

    Attributes:
        gains: Gains by the names of `[vehicle] control`.
        gain_margin_db: Least gain margin of all loops, upwards and downwards.
        phase_margin_deg: Least phase margin of all loops.
        margins: Margins by loop.
        peak_deviation_m: Peak deviations over the unseen blasts.
        error_after_m: Root mean square of the path error from the first blast to the
            end of the flight; median over the unseen blasts.
        flies_on_share: Share of the unseen blasts after which the vehicle flies on.
    """

    gains: Mapping[str, float | tuple[float, ...]]
    gain_margin_db: float
    phase_margin_deg: float
    margins: Mapping[str, LoopMargins]
    peak_deviation_m: Peaks
    error_after_m: float
    flies_on_share: float


@dataclass(frozen=True)
class GainsAnswer(Document):
    """The answer of `jblast tune --gains`.

    Attributes:
        scene: The scene's file.
        vehicle: Model of the vehicle.
        seed: Seed of the blasts.
        vehicles: Number of blasts for tuning.
        unseen: Number of blasts for validation.
        margin_db: Required gain margin.
        margin_deg: Required phase margin.
        motor_lag_s: Time constant of the motors.
        dead_time_s: Dead time of the loops, included in the margins.
        before: Gains of the scene.
        after: Tuned gains.
        cut: Relative reduction of the median peak deviation.
        flights_of_the_search: Number of times all blasts were flown, with derivatives.
        converged: Whether the search converged.
        warnings: Warnings, as sentences.
        files: Files that were written.
    """

    scene: str
    vehicle: str
    seed: int
    vehicles: int
    unseen: int
    margin_db: float
    margin_deg: float
    motor_lag_s: float
    dead_time_s: float
    before: TriedGains
    after: TriedGains
    cut: float
    flights_of_the_search: int
    converged: bool
    warnings: tuple[str, ...]
    files: tuple[str, ...]


def gains_text(answer: GainsAnswer) -> str:
    """Return the gains before and after with their results, for the terminal."""
    lines = textwrap.wrap(
        f"{answer.vehicle}: gains tuned by gradient over {answer.vehicles} blasts, "
        f"validated with {answer.unseen} unseen blasts",
        WIDTH,
    )
    lines += ["", *aligned(_rows(answer), right=(1, 2, 3)), ""]
    for warning in answer.warnings:
        lines += textwrap.wrap(f"Warning: {warning}.", WIDTH)
    lines += textwrap.wrap(
        f"Required margins: {answer.margin_db:g} dB and {answer.margin_deg:g} degrees, "
        f"each loop opened at the rotors. Motor lag {answer.motor_lag_s:g} s, dead "
        f"time {answer.dead_time_s:.3g} s.",
        WIDTH,
    )
    found = answer.after.gains
    entries = [f"integral = {'true' if 'ki_pos' in found else 'false'}"]
    # str of a float and of a list of floats is valid TOML
    entries += [
        f"{key} = {list(value) if isinstance(value, tuple) else value}"
        for key, value in found.items()
    ]
    control = f"control = {{ {', '.join(entries)} }}"
    lines += ["", "Line for the scene's [vehicle]:", "", control]
    return "\n".join(lines) + "\n"


def _rows(answer: GainsAnswer) -> list[list[str]]:
    before, after = answer.before, answer.after
    rows = [["", "before", "after", "change"]]
    for key, words in WORDS.items():
        if key not in after.gains:
            continue
        old, new = before.gains[key], after.gains[key]
        if not isinstance(old, tuple) or not isinstance(new, tuple):
            rows.append([words, f"{old:.4g}", f"{new:.4g}", ""])
            continue
        for name, n in (("sideways", 0), ("upwards", 2)):
            rows.append([f"{words}, {name}", f"{old[n]:.4g}", f"{new[n]:.4g}", ""])
    rows.append(["gain margin [dB]", *_both(before, after, "gain_margin_db"), ""])
    rows.append(["phase margin [deg]", *_both(before, after, "phase_margin_deg"), ""])
    lengths = [
        (f"peak deviation, {words} [m]", was, now)
        for words, was, now in zip(
            ("median", "90 %", "worst"),
            astuple(before.peak_deviation_m),
            astuple(after.peak_deviation_m),
            strict=True,
        )
    ]
    path = "path error after, median [m]"
    for words, was, now in (
        *lengths,
        (path, before.error_after_m, after.error_after_m),
    ):
        change = f"{100 * (now / was - 1):+.1f} %"
        rows.append([words, f"{was:.3g}", f"{now:.3g}", change])
    shares = (f"{100 * x.flies_on_share:.4g}" for x in (before, after))
    rows.append(["fly on [%]", *shares, ""])
    return rows


def _both(before: TriedGains, after: TriedGains, name: str) -> list[str]:
    return [f"{getattr(x, name):.3g}" for x in (before, after)]


def gains_answer(
    tuned: TunedGains, scene: str, files: tuple[str, ...] = ()
) -> GainsAnswer:
    """Return the answer on tuned gains.

    Args:
        tuned: The tuned gains.
        scene: The scene's file.
        files: Files that were written.
    """
    settings = tuned.settings
    return GainsAnswer(
        scene=scene,
        vehicle=tuned.vehicle.model,
        seed=settings.seed,
        vehicles=settings.vehicles,
        unseen=settings.unseen,
        margin_db=settings.margin_db,
        margin_deg=settings.margin_deg,
        motor_lag_s=float(vehicle_of(tuned.vehicle).motor_lag_s),
        # a command is held for a whole step: it is half a step late on average
        dead_time_s=STEP_S / 2 + settings.delay_s,
        before=_tried(tuned.before),
        after=_tried(tuned.after),
        cut=tuned.cut(),
        flights_of_the_search=len(tuned.ln_peaks),
        converged=tuned.converged,
        warnings=tuple(warnings_of(tuned)),
        files=files,
    )


def keys_of_gains(gains: Gains) -> dict[str, float | tuple[float, ...]]:
    """Return gains by the names of `[vehicle] control`, rounded to four digits."""

    # far finer than any effect on the margins, and short in a scene file
    def few(value: Any) -> float:
        return float(f"{float(value):.4g}")

    keys: dict[str, float | tuple[float, ...]] = {
        "kp_pos": tuple(map(few, gains.position)),
        "kd_pos": tuple(map(few, gains.velocity)),
    }
    if np.any(np.asarray(gains.integral) > 0):
        keys["ki_pos"] = tuple(map(few, gains.integral))
    keys |= {"kp_att": few(gains.attitude), "kd_att": few(gains.body_rate)}
    if gains.motor_lead is not None:
        keys["motor_lead"] = few(gains.motor_lead)
    return keys


def warnings_of(tuned: TunedGains) -> list[str]:
    """Return warnings on tuned gains."""
    warnings = list(tuned.notes)
    before, after = tuned.before, tuned.after
    short = [
        f"{margin:.3g} {unit}"
        for margin, required, unit in (
            (before.gain_margin_db, tuned.settings.margin_db, "dB"),
            (before.phase_margin_deg, tuned.settings.margin_deg, "degrees"),
        )
        if margin < required
    ]
    if short:
        warnings.append(
            f"the scene's gains have margins of {' and '.join(short)}, below the "
            "required ones"
        )
    fewer = np.mean(before.outcomes.flies_on) - np.mean(after.outcomes.flies_on)
    if fewer > 0:
        warnings.append(
            f"{100 * fewer:.3g} % fewer flights fly on than with the scene's gains"
        )
    if tuned.cut(1.0) < 0 < tuned.cut():
        warnings.append("the largest peak deviation is larger than before")
    if tuned.cut() <= 0:
        warnings.append(
            "the median peak deviation is not less than with the scene's gains"
        )
    error = [
        float(np.nanmedian(x.outcomes.metrics.error_after_m)) for x in (before, after)
    ]
    if error[1] > error[0]:
        warnings.append(
            "the path error after the blast is larger than with the scene's gains: "
            "recovery is slower"
        )
    if not tuned.converged:
        warnings.append("the search did not converge: other gains may be better")
    return warnings


def _tried(tried: EvaluatedGains) -> TriedGains:
    margins, peaks = tried.margins, known_peaks(tried)
    each = zip(LOOPS, *(np.asarray(x).tolist() for x in margins), strict=True)
    half, most, worst = (float(np.quantile(peaks, q)) for q in (0.5, 0.9, 1.0))
    return TriedGains(
        gains=keys_of_gains(tried.gains),
        gain_margin_db=tried.gain_margin_db,
        phase_margin_deg=tried.phase_margin_deg,
        margins={name: LoopMargins(*values) for name, *values in each},
        peak_deviation_m=Peaks(half, most, worst),
        error_after_m=float(np.nanmedian(tried.outcomes.metrics.error_after_m)),
        flies_on_share=float(np.mean(tried.outcomes.flies_on)),
    )
