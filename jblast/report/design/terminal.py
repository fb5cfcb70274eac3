"""What a planned layout could tell, as the terminal shows it."""

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import numpy as np

from jblast.inference.design.cramer_rao import Bound
from jblast.inference.design.summary import BoundSummary
from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.inference.posterior.estimate import Estimate
from jblast.registry import LAWS
from jblast.report.choice.reason import law_reason
from jblast.report.design.added_datum import NOT, data_lines, shown_sd
from jblast.report.estimates import printed_estimate
from jblast.report.fit.findings import all_words
from jblast.report.fit.identifiability import determined_lines
from jblast.report.fit.terminal import cannot_tell, section
from jblast.report.lines import hanging
from jblast.report.numbers import printed_number
from jblast.report.tables import aligned
from jblast.report.words import joined, parameter_words, quantity_words

SAID_OF_THE_MASS = {"air_arrival_s": "the air shock's travel time"}


def bound_text(bound: Bound, plot: str | Path | None = None) -> str:
    """Return what a layout could tell for the terminal.

    Args:
        bound: The layout.
        plot: Where the map was drawn, if it was.
    """
    found, estimates = bound.summary, _estimates(bound.summary)
    lines = [*hanging(_title(bound), indent=0), "", *_table(found, estimates)]
    lines += ["", "Laws", *_laws(bound)]
    nothing = ["nothing: the recordings, or a prior, identify every open number"]
    untold = cannot_tell(found, estimates) or nothing
    lines += section("What the recordings cannot tell", untold)
    lines += section("What they do tell", determined_lines(found.determined))
    lines += section("What it leans on", _leans(found))
    lines += data_lines(found.help, found.parameters)
    lines += section("Warnings", all_words(found.warnings))
    if plot is not None:
        lines += ["", f"Map: {plot}"]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _title(bound: Bound) -> str:
    found, log = bound.summary, bound.log
    name = PurePosixPath(log.source.replace("\\", "/")).name
    sensors, n = len(set(log.sensor)), found.n_observations
    return (
        f"Bound of {name}: {n} recording{'s' * (n > 1)} planned of {sensors} "
        f"sensor{'s' * (sensors > 1)}, "
        f"{joined([parameter_words(name) for name in found.free])} open, "
        f"{found.noise.capitalize()} errors".replace("Student", "Student-t")
    )


def _estimates(found: BoundSummary) -> dict[str, Estimate]:
    """Return the bounds as a fit of the expected log would print its estimates."""
    estimates = {}
    for name, spread in found.parameters.items():
        if not spread.is_known:
            estimates[name] = Estimate()
            continue
        value, sd, log_sd = found.at[name], spread.sd, spread.log_sd
        step = NORMAL_Q95 * np.array([-1.0, 1.0])
        with np.errstate(over="ignore"):
            ends = (
                value + step * sd if np.isnan(log_sd) else value * np.exp(step * log_sd)
            )
        q05, q95 = map(float, ends)
        estimates[name] = Estimate(value, sd, log_sd, q05, value, q95)
    return estimates


def _table(found: BoundSummary, estimates: Mapping[str, Estimate]) -> list[str]:
    rows = [("Parameters", "taken as", "sd", "90 % interval")]
    for name, estimate in estimates.items():
        sd = shown_sd(name, estimate.spread)
        rows.append(
            (
                f"  {parameter_words(name)}",
                printed_number(name, found.at[name]),
                sd,
                printed_estimate(name, estimate).interval,
            )
        )
    return aligned(rows)


def _laws(bound: Bound) -> list[str]:
    found, lines = bound.summary, []
    scatter = bound.posterior.parameters.scene.scatter
    column = max(len(quantity_words(q)) for q in found.law) + 2
    for quantity, name in found.law.items():
        law = LAWS[quantity, name]
        words = law.scatter_words() if scatter else "taken as exact"
        text = "; ".join(
            p for p in (law_reason(found.law_reason[quantity]), words) if p
        )
        lines += hanging(
            f"{quantity_words(quantity).ljust(column)}{name}: {text}", column
        )
    slopes = [
        f"{SAID_OF_THE_MASS.get(quantity, quantity_words(quantity))} as W^"
        + " to W^".join(dict.fromkeys(f"{end:.2g}" for end in ends))
        for quantity, ends in found.mass_exponents.items()
    ]
    if slopes:
        lines += hanging(f"With the mass W here go {joined(slopes)}.")
    if not found.law_valid:
        lines += hanging("Some recordings lie outside the range of their law.")
    return lines


def _leans(found: BoundSummary) -> list[str]:
    said = []
    for entry in found.leans_on:
        name, on = entry.parameter, parameter_words(entry.on)
        words, now = parameter_words(name), found.parameters[name]
        known, without = entry.if_known, entry.without_prior
        if not now.is_known:
            sd = shown_sd(name, known)
            said.append(f"Were the {on} known, the {words} would be told: sd {sd}.")
            continue
        text = f"The {words} (sd {shown_sd(name, now)}) leans on the "
        if without is None:
            text += f"{on}: were that known, sd {shown_sd(name, known)}."
        else:
            left = shown_sd(name, without)
            left = left if left == NOT else f"sd {left}"
            text += (
                f"prior of the {on}: without it {left}; were that known, sd "
                f"{shown_sd(name, known)}."
            )
        said.append(text)
    return said
