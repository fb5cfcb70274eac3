"""What the recordings cannot tell, in words."""

import math
from collections.abc import Iterable, Mapping, Sequence

from jblast.inference.fitting.findings import SuspectedOutlier
from jblast.inference.identifiability.findings import (
    EstimableCombination,
    NullDirection,
    OtherMode,
)
from jblast.inference.posterior.estimate import Estimate
from jblast.report.fit.cures import cure_words, datum_words, reason_words
from jblast.report.fit.document import NEAR_ALONE
from jblast.report.numbers import finite, printed_number, rounded, significant
from jblast.report.words import capitalised, joined, parameter_words, quantity_words
from jblast.scene import parameter_named

UNIDENTIFIED_LOG_SD = 0.5
"""A positive parameter with a larger sd in ln is called practically unidentified."""


def practically_unidentified(estimates: Mapping[str, Estimate]) -> list[str]:
    """Return the parameters that have a value, but one nobody should rely on."""
    return [
        name
        for name, estimate in estimates.items()
        if estimate.identified
        and (finite(estimate.log_sd) or 0.0) > UNIDENTIFIED_LOG_SD
    ]


def null_direction_sentence(direction: NullDirection) -> str:
    """Say which changes together leave every recording as it is."""
    steps = {n: float(step) for n, step in direction.parameters.items() if step}
    names = [parameter_words(name) for name in steps]
    if len(steps) == 1:
        return f"The recordings do not depend on the {names[0]}."
    # what is fitted in ln sets the pace: it doubles; else the widest moves by one unit
    space = direction.space
    in_ln = [abs(step) for name, step in steps.items() if _in_ln(name, space)]
    pace = max(in_ln, default=max(abs(step) for step in steps.values()))
    moved = math.log(2.0) if in_ln else 1.0
    changes = [
        f"{parameter_words(name)} times {significant(2.0 ** (step / pace), 3)}"
        if _in_ln(name, space)
        else f"{parameter_words(name)} by {_signed(name, moved * step / pace)}"
        for name, step in steps.items()
    ]
    return (
        f"The recordings cannot tell the {joined(names)} apart: {joined(changes)} "
        "together change no recording."
    )


def _in_ln(name: str, space: str) -> bool:
    return space != "linear" and parameter_named(name).positive


def _signed(name: str, step: float) -> str:
    return ("+" if step > 0 else "") + printed_number(name, step, 3)


def ambiguity_sentence(other: OtherMode) -> str:
    """Say where the other solution lies, and why there is one."""
    values = joined(
        [
            f"{parameter_words(name)} {printed_number(name, value)}"
            for name, value in other.parameters.items()
            if finite(value) is not None
        ]
    )
    reason = capitalised(reason_words(other))
    return f"Another solution fits nearly as well: {values}. {reason}."


def cure_sentence(entry: NullDirection | OtherMode) -> str:
    """Return what would cure a null direction or an ambiguity."""
    is_null = isinstance(entry, NullDirection)
    cure = cure_words(entry.cure) if is_null else datum_words(entry.cure)
    return f"Cure: {cure}."


def determined_lines(determined: Sequence[EstimableCombination]) -> list[str]:
    """Return one line for each combination that the recordings do determine."""
    lines = []
    for entry in determined:
        value, sd = finite(entry.value), finite(entry.sd)
        if value is None:
            lines.append(entry.combination)
        elif not sd:
            lines.append(f"{entry.combination} = {significant(value, 4)}")
        else:
            shown = f"{rounded(value, sd)} ± {rounded(sd, sd)}"
            note = f" ({NEAR_ALONE})" if entry.is_local else ""
            lines.append(f"{entry.combination} = {shown}{note}")
    return lines


def outlier_lines(outliers: Iterable[SuspectedOutlier]) -> list[str]:
    """Return one line for each suspected outlier."""
    return [
        f"{o.sensor}, {quantity_words(o.quantity)}: {o.sds:+.1f} sd" for o in outliers
    ]
