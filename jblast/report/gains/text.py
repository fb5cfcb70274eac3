"""Tuned gains in words, and as lines of a scene."""

import textwrap

from jblast.report.gains.answer import GainsAnswer, TriedGains
from jblast.report.lines import WIDTH
from jblast.report.tables import aligned

WORDS = {
    "kp_pos": "position [1/s2]",
    "kd_pos": "velocity [1/s]",
    "ki_pos": "integral [1/s3]",
    "kp_att": "attitude [1/s2]",
    "kd_att": "body rate [1/s]",
    "motor_lead": "motors' lead [-]",
}


def gains_text(answer: GainsAnswer) -> str:
    """Return what the terminal shows."""
    lines = textwrap.wrap(
        f"{answer.vehicle}: gains tuned by gradient through {answer.vehicles} blasts, "
        f"judged by {answer.unseen} unseen ones; motors lag by {answer.motor_lag_s:g} "
        f"s, dead time {answer.dead_time_s:.3g} s",
        WIDTH,
    )
    lines += ["", *aligned(_rows(answer), right=(1, 2, 3)), ""]
    lines += textwrap.wrap(
        f"Asked for: margins of {answer.margin_db:g} dB and {answer.margin_deg:g} "
        "degrees and more, each loop broken at the rotors.",
        WIDTH,
    )
    for warning in answer.warnings:
        lines += textwrap.wrap(f"Beware: {warning}.", WIDTH)
    lines += ["", "Into the scene, as one line:", "", control_line(answer.after)]
    return "\n".join(lines) + "\n"


def control_line(tried: TriedGains) -> str:
    """Return the gains as a scene's `[vehicle]` takes them, on one line."""
    integral = "ki_pos" in tried.gains
    entries = [f"integral = {'true' if integral else 'false'}"]
    entries += [f"{key} = {_toml(value)}" for key, value in tried.gains.items()]
    return f"control = {{ {', '.join(entries)} }}"


def _rows(answer: GainsAnswer) -> list[list[str]]:
    before, after = answer.before, answer.after
    rows = [["", "before", "after", "change"]]
    for key, words in WORDS.items():
        if key not in after.gains:
            continue
        old, new = before.gains.get(key, 1.0), after.gains[key]
        if not isinstance(old, tuple) or not isinstance(new, tuple):
            rows.append([words, f"{old:.4g}", f"{new:.4g}", ""])
            continue
        for name, n in (("sideways", 0), ("upwards", 2)):
            rows.append([f"{words}, {name}", f"{old[n]:.4g}", f"{new[n]:.4g}", ""])
    rows.append(["gain margin [dB]", *_both(before, after, "gain_margin_db"), ""])
    rows.append(["phase margin [deg]", *_both(before, after, "phase_margin_deg"), ""])
    for key, words in (("q50", "median"), ("q90", "90 %"), ("worst", "worst")):
        old, new = (getattr(x.peak_deviation_m, key) for x in (before, after))
        change = f"{100 * (new / old - 1):+.1f} %"
        rows.append(
            [f"peak deviation, {words} [m]", f"{old:.3g}", f"{new:.3g}", change]
        )
    old, new = before.error_after_m, after.error_after_m
    change = f"{100 * (new / old - 1):+.1f} %"
    rows.append(["path error after, median [m]", f"{old:.3g}", f"{new:.3g}", change])
    shares = (f"{100 * x.flies_on_share:.4g}" for x in (before, after))
    rows.append(["fly on [%]", *shares, ""])
    return rows


def _both(before: TriedGains, after: TriedGains, name: str) -> list[str]:
    return [f"{getattr(x, name):.3g}" for x in (before, after)]


def _toml(value: float | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(repr, value))}]"
    return repr(value)
