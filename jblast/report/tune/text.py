"""What `jblast tune` says on a terminal."""

import math

from jblast.inference.tuning.tunables import TUNABLES
from jblast.parameter_table import CLOCK, PARAMETERS
from jblast.report.lines import hanging
from jblast.report.numbers import rounded
from jblast.report.tables import aligned
from jblast.report.tune.answer import TuneAnswer
from jblast.report.tune.words import TESTS, words_of

NOT_TOLD = "not told"


def tune_text(answer: TuneAnswer) -> str:
    """Return numbers with intervals, how well the record is explained, and doubts."""
    rows = [["", "value", "90 % interval", "unit", "before", ""]]
    for name, one in answer.estimates.items():
        value, interval = NOT_TOLD, ""
        if one.value is not None and one.sd is not None:
            sd = max(one.sd, 1e-12 * abs(one.value))
            value = rounded(one.value, sd)
            ends = [rounded(end, sd) for end in (one.q05, one.q95) if end is not None]
            interval = " to ".join(ends)
        unit = "" if one.unit == "1" else one.unit
        rows.append([name, value, interval, unit, f"{one.before:.4g}", one.key])
    lines = [f"{answer.recorded}: {_who(answer)}", *aligned(rows, right=(1, 4))]
    if decibels := _decibels(answer):
        lines.append(decibels)
    lines.append(_fixed(answer))
    worst = min(answer.tests.items(), key=lambda item: item[1], default=None)
    if answer.error is not None and answer.error_allowed is not None:
        what = "steps of 8 bits" if answer.kind == "frames" else "thresholds"
        lines.append(
            f"what is left: {answer.error:.2g} {what}; up to "
            f"{answer.error_allowed:.2g} it is well explained"
        )
    explained = f"chi2 {answer.chi2:.6g} of {answer.dof:,} expected"
    if worst is not None:
        explained += f"; least likely: {TESTS[worst[0]]}, p = {worst[1]:.2g}"
    lines.append(explained)
    for warning in answer.warnings:
        lines += hanging(f"Note: {warning}")
    return "\n".join(line for line in lines if line) + "\n"


def list_text() -> str:
    """Return every name that can be tuned, with unit, default, and where it stands."""
    rows = [["name", "unit", "default", "told by", "in the scene file"]]
    for name, row in TUNABLES.items():
        default = "by the record" if math.isnan(row.start) else f"{row.start:g}"
        rows.append([name, row.unit, default, ", ".join(row.told_by), _place(row.key)])
    for name, one in {**PARAMETERS, f"{CLOCK.name}.NAME": CLOCK}.items():
        rows.append([name, one.unit, f"{one.default:g}", "beside", _place(one.key)])
    return "\n".join(aligned(rows)) + "\n"


def _place(key) -> str:
    table = f"[[{key.table}]]" if key.table == "sensor" else f"[{key.table}]"
    return f"{table} {key.name}" + ("" if key.index is None else f"[{key.index}]")


def _who(answer: TuneAnswer) -> str:
    if answer.sensor is None:
        return f"{answer.kind} of the camera of {answer.scene}"
    return f"{answer.kind} of sensor {answer.sensor!r} of {answer.scene}"


def _decibels(answer: TuneAnswer) -> str:
    """Return levels of sound as they are mostly told."""
    levels = []
    for name in ("ambient_level_pa", "noise_pa"):
        one = answer.estimates.get(name)
        if one is not None and one.value is not None and one.value > 0:
            level = 20.0 * math.log10(one.value / 20e-6)
            levels.append(f"{words_of(name)} {level:.1f} dB")
    return f"{', '.join(levels)} re 20 µPa" if levels else ""


def _fixed(answer: TuneAnswer) -> str:
    said = [
        f"{name} {value:.4g}"
        for name, value in answer.fixed.items()
        if value is not None
    ]
    return f"taken as the scene has it: {', '.join(said)}" if said else ""
