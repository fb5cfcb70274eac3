"""The answer of `jblast fit`: JSON, view and files."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jblast.errors import InputError
from jblast.files import check_out, table_text
from jblast.inference.design.cramer_rao import BoundSummary
from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.fit_input import log_names
from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.place import OnEarth, on_earth
from jblast.inference.fitting.summary import Summary
from jblast.inference.identify import (
    Cure,
    EstimableCombination,
    NullDirection,
    OtherMode,
    PlaceRegion,
    ResolvingDatum,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.observations.rows import AT_LEAST
from jblast.observations.table import SAMPLES
from jblast.parameters import CHARGE_POSITION
from jblast.quantities import ADDITIVE, QUANTITIES, TIMED
from jblast.registry import LAWS, law_words
from jblast.report.choice import law_reason
from jblast.report.estimates import (
    Accepted,
    absent_note,
    drawn_parameters,
    log_name,
    outlier_rows,
    printed_estimate,
    printed_value,
)
from jblast.report.messages import (
    alarm,
    alarm_name,
    sentence,
    sentence_of,
    sentences_of,
)
from jblast.report.numbers import (
    capitalised,
    finite,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    rounded,
    significant,
    unit_for,
)
from jblast.report.output import (
    FIT_FILES,
    PROBLEM,
    Answer,
    Content,
    write_answer,
)
from jblast.report.provenance import Provenance, provenance_of
from jblast.report.view import (
    Block,
    Column,
    Facts,
    Lines,
    Picture,
    Table,
    Text,
    View,
    drawn_by,
    terminal,
)
from jblast.results import ABSENT, AMONG, Document, Note, Words, among
from jblast.scene import parameter_named
from jblast.waves.choice import TakenLaw

if TYPE_CHECKING:  # a fit of a table reads no records
    from matplotlib.figure import Figure

    from jblast.report.picks import PickAnswer
    from jblast.signals.picks import PickedFiles

UNIDENTIFIED_LOG_SD = 0.5
"""Standard deviation of ln above which a positive parameter is called practically
unidentified: its 90 % interval spans a factor of five."""
MARGINAL = 0.01
"""p below which a fit is called marginal; below `POOR`, 0.001, it is called poor. One
good fit in a hundred falls below it by chance."""
WHERE = {
    "sensor": "at a sensor of the log",
    "place": "at a new position",
    "aside": "at a new position off the sensors' line",
    "range": "at a new range",
    "later": "at a later time",
}
NEAR_ALONE = "near the answer only: the invariance is curved"
"""Note on a combination that is identified at the answer but not elsewhere."""
REMEDIES = ("more_to_free", "clock_to_free")
"""Warnings that are printed with the problems, as they name what to do."""
MAX_CONVERSIONS = 4
"""Conversions of a log that are printed without `--verbose`: with more of them the
answer of an ordinary fit would not fit one screen of 40 lines."""
MAX_ROWS = 200
"""Largest number of rows in a table of residuals: about four printed pages."""
MAX_TITLE = 4
"""Parameters that the first line names: with more it would not be one line, and the
table below it has their names."""
SAFETY = (
    "For safety engineering, forensics and sensing; it designs no explosives. "
    "Decide nothing that concerns lives from this page alone."
)
OF_LOG = ("converged", "identifiable", "law_valid", "chi2", "dof", "n_observations")
NUMBERS = ("value", "sd", "log_sd", "q05", "q50", "q95", "identified")
COLUMNS: tuple[str, ...] = ("log", "parameter", *NUMBERS, *OF_LOG, "error")


# Documents


@dataclass(frozen=True)
class Ambiguity:
    """Another optimum that the data cannot rule out.

    Attributes:
        mode: The optimum.
        reason: Parameters in which it differs.
        cure: Datum that would distinguish the two best.
    """

    mode: OtherMode = field(metadata=among("parameters"))
    reason: str
    cure: str


@dataclass(frozen=True)
class Determined:
    """An identified combination of unidentified parameters.

    Attributes:
        of: The combination.
        note: Limitation, if it is identified near the answer only.
    """

    of: EstimableCombination = field(metadata=among("combination", "value", "sd"))
    note: str | None = field(metadata=ABSENT)


def _ambiguity(of: OtherMode) -> Ambiguity:
    return Ambiguity(of, reason_words(of), datum_words(of.cure))


def _determined(of: EstimableCombination) -> Determined:
    return Determined(of, NEAR_ALONE if of.is_local else None)


def cure_words(cure: Cure) -> str:
    """Return the priors, measurements or data that resolve a null direction."""
    known = f"a prior on, or a measurement of, {' or '.join(cure.parameters)}"
    added = "; ".join(datum_words(datum) for datum in cure.data)
    return f"{known}; or {added}" if added else known


def datum_words(datum: ResolvingDatum) -> str:
    """Return the quantity to record, with its location."""
    quantity = QUANTITIES[datum.quantity].with_article()
    bang = " (of the bang: range = sound speed times the delay after the flash)"
    clock = ", on a correct clock" if datum.on_right_clock else ""
    return f"{quantity}{bang if datum.is_bang else ''} {WHERE[datum.where]}{clock}"


def reason_words(other: OtherMode) -> str:
    """Return the parameters in which another optimum differs, and its chi2."""
    kind = "position" if set(CHARGE_POSITION) & set(other.differ) else "solution"
    names = ", ".join(sorted(other.differ)) or "all"
    return (
        f"another {kind} in {names} explains the log nearly as well (chi squared "
        f"differs by {other.delta_chi2:.2g})"
    )


WORDED: Words = {
    Cure: cure_words,
    EstimableCombination: _determined,
    Note: sentence_of,
    OtherMode: _ambiguity,
    TakenLaw: law_reason,
}
"""Results of inference that documents contain as text."""


@dataclass(frozen=True)
class FitAnswer(Document):
    """The answer of `jblast fit` for one log.

    Attributes:
        summary: Results of the fit.
        on_earth: Positions and times on the Earth.
        picks: Picks of the records, where records were picked.
        provenance: Provenance, in a file; standard output has none, so that the same
            run prints the same.
    """

    words = WORDED
    summary: Summary = field(metadata=AMONG)
    on_earth: OnEarth = field(metadata=AMONG)
    picks: "Sequence[PickAnswer] | None" = field(default=None, metadata=ABSENT)
    provenance: Provenance | None = field(default=None, metadata=ABSENT)


@dataclass(frozen=True)
class FailedLog:
    """The answer of `jblast fit` for one of several logs that cannot be fitted.

    Attributes:
        error: Message of the error.
        provenance: Provenance, in a file.
    """

    error: str
    provenance: Provenance | None = field(default=None, metadata=ABSENT)


@dataclass(frozen=True)
class FitsAnswer(Document):
    """The answers of `jblast fit` for several logs.

    Attributes:
        logs: Answers by name of the log.
        picks: Picks of the records, where records were picked.
    """

    logs: Mapping[str, FailedLog | FitAnswer]
    picks: "Sequence[PickAnswer] | None" = field(default=None, metadata=ABSENT)


def fit_document(fit: Fit) -> dict[str, Any]:
    """Return the document of `jblast fit --json`, null for non-finite numbers."""
    return fit_answer(fit).to_dict()


def fit_answer(
    fit: Fit, made: Provenance | None = None, picks: Sequence[Any] | None = None
) -> FitAnswer:
    """Return the document of one log.

    Args:
        fit: The fit.
        made: Provenance, for a file.
        picks: Picks of the log, if it was picked, as `jblast pick` prints them.
    """
    return FitAnswer(fit.summary, on_earth(fit), picks, made)


def fits_answer(
    answers: Mapping[str, Fit | InputError],
    made: Mapping[str, Provenance] | None = None,
    picks: Sequence[Any] | None = None,
) -> FitsAnswer:
    """Return the document of several logs; arguments by log as for `fit_answer`."""
    made = made or {}
    logs = {
        name: FailedLog(str(fit), made.get(name))
        if isinstance(fit, InputError)
        else fit_answer(fit, made.get(name))
        for name, fit in answers.items()
    }
    return FitsAnswer(logs, picks)


# Identified and unidentified parameters


def determined_lines(determined: Iterable[EstimableCombination]) -> list[str]:
    """Return one line for each identified combination of parameters."""
    lines = []
    for entry in determined:
        value, sd = finite(entry.value), finite(entry.sd)
        # without an sd there are no significant digits to round to
        shown = "" if value is None else f" = {significant(value, 4)}"
        if value is not None and sd:
            note = f" ({NEAR_ALONE})" if entry.is_local else ""
            shown = f" = {rounded(value, sd)} ± {rounded(sd, sd)}{note}"
        lines.append(entry.combination + shown)
    return lines


def not_identified(
    found: Summary | BoundSummary, estimates: Mapping[str, Estimate]
) -> list[str]:
    """Return a line for each unidentified parameter, null direction or other mode."""
    lines = [f"{parameter_words(n)}: not identified" for n in found.unidentified]
    for name, estimate in estimates.items():
        # a parameter that can be negative has no sd of ln: it is never listed
        log_sd = finite(estimate.log_sd) or 0.0
        if estimate.identified and log_sd > UNIDENTIFIED_LOG_SD:
            words = parameter_words(name)
            lines.append(f"{words}: practically unidentified (sd of ln {log_sd:.2f})")
    for null in found.null_directions:
        lines += [null_direction_sentence(null), f"Add: {cure_words(null.cure)}."]
    for mode in found.ambiguities:
        values = [
            f"{parameter_words(name)} {printed_value(name, value)}"
            for name, value in mode.parameters.items()
            if finite(value) is not None
        ]
        lines += [
            f"Another solution fits nearly as well: {joined(values)}. "
            f"{capitalised(reason_words(mode))}.",
            f"Add: {datum_words(mode.cure)}.",
        ]
    return lines


def null_direction_sentence(direction: NullDirection) -> str:
    """Return the joint change of parameters that leaves every recording unchanged."""
    steps = {n: float(step) for n, step in direction.parameters.items() if step}
    names = [parameter_words(name) for name in steps]
    # one parameter alone is not a combination
    if len(steps) == 1:
        return f"The recordings do not depend on the {names[0]}."

    def in_ln(name: str) -> bool:
        return direction.space != "linear" and parameter_named(name).positive

    # the step is scaled so that the largest change in ln is a factor of two; without a
    # parameter in ln, so that the largest change is one unit
    factors = [abs(step) for name, step in steps.items() if in_ln(name)]
    pace = max(factors, default=max(abs(step) for step in steps.values()))
    moved = math.log(2.0) if factors else 1.0
    changes = [
        f"{parameter_words(name)} times {significant(2.0 ** (step / pace), 3)}"
        if in_ln(name)
        else f"{parameter_words(name)} by {'+' if step > 0 else ''}"
        f"{printed_number(name, moved * step / pace, 3)}"
        for name, step in steps.items()
    ]
    return (
        f"The recordings do not separate the {joined(names)}: {joined(changes)} "
        "together change no recording."
    )


# Problems


def problem_lines(found: Summary) -> list[str]:
    """Return the problems of an answer, the most serious first, with their remedies."""
    remedies = [note for note in found.warnings if note.kind in REMEDIES]
    return [
        *map(alarm, found.problems),
        *(
            f"{capitalised(sentence(f'wrong.{wrong.kind}', wrong))}."
            for wrong in found.explained_by
        ),
        *(f"{capitalised(text)}." for text in sentences_of(remedies)),
    ]


# Tables and sections of the view


def estimate_table(found: Summary, accepted: Accepted | None) -> Table:
    """Return a row for each fitted parameter, then for each derived one."""
    known = accepted or {}

    def is_outside(row: tuple[str, Estimate]) -> bool:
        low, high = row[1].q05, row[1].q95
        return row[0] in known and not (low <= known[row[0]][0] <= high)

    def published(row: tuple[str, Estimate]) -> str:
        if row[0] not in known:
            return ""
        value, label = known[row[0]]
        verdict = "outside" if is_outside(row) else "inside"
        return f"{printed_value(row[0], value)}, {label}: {verdict}"

    columns = [
        Column("", lambda row: capitalised(parameter_words(row[0]))),
        Column(
            "value", lambda row: printed_estimate(*row).value_and_beside, right=True
        ),
        Column(
            "90 % interval", lambda row: printed_estimate(*row).interval, right=True
        ),
        Column("", lambda row: "derived" if row[0] in found.derived else ""),
        Column("accepted", published),
    ]
    rows = [*found.estimates.items(), *found.derived.items()]
    return Table(columns, rows, "Estimates", marked=is_outside)


def region_table(found: Summary) -> Table:
    """Return the regions of a position, if there are several."""
    names = dict.fromkeys(
        name
        for region in found.regions
        for name in region.estimates
        if name.partition(".")[0] in (*CHARGE_POSITION[:2], "charge_mass_kg")
    )

    def interval(name: str, region: PlaceRegion) -> str:
        # without a position only the range is limited
        if not region.is_place or name not in region.estimates:
            return ""
        return printed_estimate(name, region.estimates[name]).interval

    def distance(region: PlaceRegion) -> str:
        return (
            "" if region.is_place else printed_estimate("_m", region.range_m).interval
        )

    return Table(
        [
            Column("share", lambda region: f"{region.share:.0%}", right=True),
            *(Column(parameter_words(n), partial(interval, n)) for n in names),
            Column("from the centre of the sensors", distance),
        ],
        found.regions,
        "Regions of the position",
        caption="The estimates are those of the first." if found.regions else "",
    )


def law_table(found: Summary | BoundSummary, has_scatter: bool) -> Table:
    """Return the law of each quantity of the log, with reason, range and source.

    Args:
        found: Results of a fit, or of a bound.
        has_scatter: Whether the model includes the scatter of the laws.
    """

    def reason(quantity: str) -> str:
        taken = found.law_reason.get(quantity)
        return law_reason(taken) if taken else ""

    def note(quantity: str) -> str:
        law = LAWS.get((quantity, found.law[quantity]))
        if law is None:
            return ""
        scatter = law.scatter_words() if has_scatter else "no model error"
        return "; ".join((law.range, scatter, law.source))

    columns = [
        Column("quantity", quantity_words),
        Column("law", lambda quantity: found.law[quantity]),
        Column("reason", reason),
    ]
    return Table(columns, list(found.law), "Laws", where="detail", note=note)


def quantities_by_law(law: Mapping[str, str], has_scatter: bool) -> str:
    """Return the quantities of each law: "air arrival by Wu-Hao; ..."."""
    by_law: dict[str, list[str]] = {}
    for quantity, name in law.items():
        by_law.setdefault(name, []).append(quantity_words(quantity))
    clauses = [f"{joined(of)} by {law_words(name)}" for name, of in by_law.items()]
    return "; ".join(clauses) + ("" if has_scatter else ", without model error")


def goodness_p(found: Summary) -> float | None:
    """Return the p value of the chi2; None without degrees of freedom."""
    chi2 = finite(found.chi2)
    return None if chi2 is None else p_value(chi2, found.dof)


def goodness_sentence(found: Summary) -> str:
    """Return a sentence on the chi2 of the fit."""
    p = goodness_p(found)
    if p is None:
        kind = "no_chi2" if found.dof > 0 else "no_freedom"
    elif p < MARGINAL:
        kind = "fits_poorly" if p < POOR else "fits_marginally"
    else:
        # as improbable as a poor fit, on the other side
        kind = "fits_too_well" if p > 1 - POOR else "fits"
    return capitalised(sentence(kind, p=p)) + "."


def reliability_lines(fit: Fit) -> list[str]:
    """Return sentences on goodness of fit, validity and identifiability."""
    found, table = fit.summary, fit.observations
    rows = np.flatnonzero(table.bounds())
    bounds = sentence(
        "lower_bounds",
        bounds=len(rows),
        of=len(table),
        sensors=dict.fromkeys(table.sensor[row] for row in rows),
        kept=int(np.sum(fit.residual[rows] <= 0)),
    )
    return [
        goodness_sentence(found),
        f"{capitalised(sentence('valid' if found.law_valid else 'not_valid'))}.",
        f"{bounds}." if len(rows) else "",
        *(
            not_identified(found, found.estimates)
            or ["All fitted parameters are identified."]
        ),
    ]


RESIDUALS = {
    "Sensor": False,
    "": False,
    "Line": True,
    "Quantity": False,
    "Range": True,
    "Measured": True,
    "Law": True,
    "Sd": True,
    "Residual (sd)": True,
}
"""Columns of the residuals, and whether they are aligned right."""


def residual_table(fit: Fit) -> Table:
    """Return the rows of the log in order; of a long log the largest residuals.

    A measured lower bound begins with ">", and its residual is "satisfied" if the law
    predicts at least that value.
    """
    rows = np.arange(len(fit.observations))
    caption = RESIDUAL_CAPTION
    if len(rows) > MAX_ROWS:
        caption = f"The {MAX_ROWS} largest residuals of {len(rows)} rows. {caption}"
        # rows without a residual count as the largest: readers search for them
        worst = np.argsort(-np.abs(np.nan_to_num(fit.residual, nan=np.inf)))
        rows = np.sort(worst[:MAX_ROWS])
    suspected = outlier_rows(fit)
    return Table(
        [
            Column(head, itemgetter(n), right=right)
            for n, (head, right) in enumerate(RESIDUALS.items())
        ],
        [_cells(fit, int(i), int(i) in suspected) for i in rows],
        "Recordings and residuals",
        where="detail",
        marked=itemgetter(1),
        caption=caption,
    )


def _cells(fit: Fit, i: int, suspected: bool) -> tuple[str, ...]:
    """Return the cells of a row of the log, in the order of `RESIDUALS`."""
    table = fit.observations
    quantity, value, sd = table.quantity[i], float(table.value[i]), float(fit.sd[i])
    residual, distance = float(fit.residual[i]), float(fit.distance[i])
    # errors of positive quantities are shares of the value
    of_value = quantity not in ADDITIVE
    in_unit = abs(value) * sd if of_value else sd

    def show(number: float) -> str:
        # beside a measured value, so that both have its unit and digits
        unit = unit_for(quantity, value)
        if not np.isfinite(number):
            return "-"
        if not (np.isfinite(in_unit) and in_unit > 0.0):
            return f"{significant(number / unit.size, 4)} {unit.symbol}"
        return f"{rounded(number / unit.size, in_unit / unit.size)} {unit.symbol}"

    is_bound = bool(table.bounds()[i])
    # the residual of a lower bound is exactly 0 where the law predicts at least it
    is_satisfied = is_bound and residual == 0.0
    # radii at a time have no range; next to a charge it may be 0
    has_range = np.isfinite(distance) and quantity not in TIMED
    return (
        table.sensor[i],
        "suspected outlier" if suspected else "",
        str(table.line[i]) if i < len(table.line) else str(i + 1),
        quantity_words(quantity),
        printed_number("_m", distance) if has_range else "",
        (AT_LEAST if is_bound else "") + show(value),
        show(float(fit.predicted[i])),
        f"{significant(100 * sd)} %" if of_value else printed_number(quantity, sd, 2),
        "satisfied" if is_satisfied else f"{residual:+.2f}",
    )


# The view


def fit_view(
    fit: Fit,
    accepted: Accepted | None = None,
    made: Provenance | None = None,
    more: Sequence[Block] = (),
) -> View:
    """Return the view of a fit.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source; shown next
            to the estimates, inside or outside the interval.
        made: Provenance, for a page.
        more: Blocks after the estimates, as those of picks.
    """
    # imported here, as it loads what a map needs
    from jblast.report.fit_map import earth_lines

    found, name = fit.summary, log_name(fit)
    fitted = list(map(parameter_words, found.free))
    names = joined(fitted) or "nothing"
    if len(fitted) > MAX_TITLE:
        names = f"{len(fitted)} parameters"
    # they name the path of the log: a page may be passed on, and a path can be private
    commands = [note for note in found.warnings if note.kind == "look_closer"]
    hidden = ("look_closer", *REMEDIES)
    warnings = [note for note in found.warnings if note.kind not in hidden]
    laws = quantities_by_law(found.law, fit.scene.scatter)
    assumptions = [f"laws used: {laws}", *sentences_of(found.assumptions)]
    reason = fit.posterior_reason
    outliers = [sentence("outlier", one) for one in found.suspected_outliers]
    return View(
        f"Fit of {name}" if name else "Fit",
        [
            Lines("Place and time", earth_lines(fit)),
            estimate_table(found, accepted),
            region_table(found),
            *more,
            Lines("Reliability", reliability_lines(fit)),
            Lines("Identified combinations", determined_lines(found.determined)),
            Lines("Suspected outliers", outliers),
            Lines("Warnings", list(map(capitalised, sentences_of(warnings)))),
            Lines("", list(map(capitalised, sentences_of(commands))), where="terminal"),
            *pictures(fit, accepted),
            Lines("Assumptions", list(map(capitalised, assumptions))),
            Lines(
                "Conversions of the log",
                sentences_of(found.understood),
                most=MAX_CONVERSIONS,
            ),
            law_table(found, fit.scene.scatter),
            Facts(
                [
                    ("Goodness of fit", sentence("chi2", found)),
                    ("Intervals", capitalised(sentence_of(reason)) if reason else ""),
                ],
                where="detail",
            ),
            residual_table(fit),
            Text("Comments of the log", "\n".join(fit.observations.comments)),
        ],
        subtitle=sentence(
            "{n_observations:recording}; fitted: {names}", found, names=names
        ),
        problems=problem_lines(found),
        made=made,
        footer=SAFETY,
    )


RESIDUAL_CAPTION = (
    "Sd: the recording's own error and the law's scatter from record to record. The "
    "error that the rows of a shot or a path share is subtracted from the residuals."
)
POSTERIOR = (
    "Draws of the posterior: histograms with the value and the shaded 90 % interval; "
    "the areas of a pair contain 50 and 90 % of the draws. Orange: accepted value."
)
RECORDINGS = (
    "The band is the posterior uncertainty, in still air and without model error. "
    "Error bars include the recording's error and the law's scatter from record to "
    "record. The scatter that a shot or path shares shifts all its points to one side."
)


def pictures(fit: Fit, accepted: Accepted | None = None) -> list[Block]:
    """Return the figures of a fit, and the reason for each that is missing."""
    from jblast.report.fit_map import absent_map_note, map_alt, map_caption

    # only shock radii are readings at a time; next to any other quantity the range is
    # the axis
    along = "time" if list(fit.summary.law) == ["shock_radius_m"] else "range"
    has_map = np.isfinite(fit.observations.position).all(axis=1)
    has_map &= ~np.isfinite(fit.observations.slant_range)
    blocks: list[Block] = [
        Picture(
            "map.png",
            partial(_map, fit, accepted),
            "Map",
            map_caption(fit),
            map_alt(fit),
        )
        if has_map.any()
        else Lines("", [absent_map_note(fit)], where="page"),
        Picture(
            "recordings.png",
            drawn_by("fit_figures.recordings_figure", fit),
            f"Recordings against {along}",
            RECORDINGS,
            "Recordings with error bars, the law at the answer and its 90 % band.",
        ),
        Picture(
            "residuals.png",
            drawn_by("fit_figures.residuals_figure", fit),
            "Residuals",
            "About 95 % should lie between the dashed lines, without a trend.",
            f"Residuals in standard deviations against {along}.",
        ),
        Lines("", [absent_note(fit)], where="page"),
    ]
    if drawn_parameters(fit):
        draw = drawn_by("fit_figures.corner_figure", fit, accepted)
        alt = "Histograms of the draws of each parameter, and of each pair."
        blocks.insert(-1, Picture("corner.png", draw, "Posterior", POSTERIOR, alt))
    return blocks


def _map(fit: Fit, accepted: Accepted | None) -> "Figure":
    from jblast.report.fit_map import map_of_fit
    from jblast.report.map_figures import map_figure

    shown = map_of_fit(fit, accepted)
    assert shown is not None
    return map_figure(shown)


def summary(
    fit: Fit, accepted: Accepted | None = None, *, verbose: bool = False
) -> str:
    """Return the answer for the terminal: estimates, reliability, assumptions.

    Args:
        fit: The fit.
        accepted: As for `fit_view`.
        verbose: Whether to add the reasons for the laws, the computation of the
            intervals and all conversions of the log.
    """
    return terminal(fit_view(fit, accepted), verbose=verbose)


def fit_report(
    fit: Fit,
    accepted: Accepted | None = None,
    made: Provenance | None = None,
    of: "PickedFiles | None" = None,
) -> Answer:
    """Return the answer of one log: document, view and files.

    Args:
        fit: The fit.
        accepted: As for `fit_view`.
        made: Provenance.
        of: Picks of the log, if it was picked.
    """
    picks, more, files = _picks(of)
    own: dict[str, Content | None] = {}
    if (ensemble := fit.ensemble) is not None:

        def draws(path: Path) -> None:
            from jblast.inference.arviz_file import inference_data, write_inference_data

            notes = sentences_of(ensemble.notes)
            write_inference_data(
                inference_data(ensemble, fit.observations, notes), path
            )

        own["posterior.nc"] = draws
    if fit.observations.frame is not None:
        from jblast.report.fit_map import place_files

        own |= place_files(fit, accepted)
    return Answer(
        fit_answer(fit, picks=picks),
        fit_view(fit, accepted, made, more),
        files=own | files,
        filed=fit_answer(fit, made, picks),
        code=fit.exit_code,
    )


def _picks(
    of: "PickedFiles | None",
) -> tuple[Sequence[Any] | None, list[Block], dict[str, Content | None]]:
    """Return document, blocks and files of the picks of a log."""
    if of is None:
        return None, [], {}
    from jblast.report.picks import picks_answer, picks_blocks, picks_title

    document = picks_answer(of.found, of.log)
    blocks = picks_blocks(of, title=picks_title(of.found))
    # the log is written by the command, before the fit
    files: dict[str, Content | None] = {
        "picks/picks.json": document.to_json(),
        "picks/picks.csv": None,
    }
    return document.picks, blocks, files


def made_each(
    made: Provenance | None, logs: Mapping[str, Any], files: Sequence[str]
) -> dict[str, Provenance]:
    """Return the provenance of the answer of each log, with its own files only.

    Args:
        made: Provenance of all logs together; None gives none.
        logs: Logs or their errors, as `fit_input` returns them.
        files: Files of the logs; empty if all files form one set of records.
    """
    if made is None:
        return {}
    found = {}
    for log, of in logs.items():
        named = zip(log_names(files), files, strict=True) if files else ()
        # `fit_input` names a shot of one of several files FILE: SHOT
        own = [f for name, f in named if log == name or log.startswith(f"{name}: ")]
        digests = provenance_of(own).logs if own else made.logs
        if not isinstance(of, InputError):
            # a row of samples names its file relative to the folder of the log
            samples = [
                Path(of.source).parent / name
                for quantity, name in zip(of.quantity, of.records(), strict=True)
                if quantity == SAMPLES
            ]
            digests = (*digests, *provenance_of(samples).logs)
        found[log] = replace(made, logs=digests)
    return found


def write_report(
    fit: Fit,
    directory: str | Path,
    accepted: Accepted | None = None,
    force: bool = False,
    made: Provenance | None = None,
) -> list[Path]:
    """Write a fit's answer, figures and page, the answer first.

    A figure that cannot be drawn is left out, with a warning. There is no corner.png
    without a posterior, no map.png without positions of sensors, and no place.geojson
    and place.kml without a position on the Earth.

    Args:
        fit: The fit.
        directory: Output directory; created if missing.
        accepted: Published values by parameter name, each with its source.
        force: Whether files of an earlier report are replaced; other files stay.
        made: Provenance; None stands for the log's file and no command.

    Returns:
        The files written.

    Raises:
        InputError: The directory has files of a report and `force` is not set, or it
            cannot be written.
    """
    directory = Path(directory)
    check_out(directory, FIT_FILES, force=force)
    made = made or provenance_of([fit.observations.source])
    report = fit_report(fit, accepted, made)
    written = write_answer(report, directory, "fit", names=FIT_FILES)
    return [directory / name for name in written]


# Several logs


def fits_view(
    answers: Mapping[str, Fit | InputError],
    more: Sequence[Block] = (),
    made: Provenance | None = None,
) -> View:
    """Return the view of several logs: a row each, and the logs that failed."""
    fits = {name: fit for name, fit in answers.items() if isinstance(fit, Fit)}
    failed = [f"{n}: {e}" for n, e in answers.items() if isinstance(e, InputError)]
    rows = [
        (name, fit.summary, parameter, estimate)
        for name, fit in fits.items()
        for parameter, estimate in fit.summary.estimates.items()
    ]

    def of_log(cell: Callable[[str, Summary], str]) -> Callable[[Any], str]:
        # name and quality of a fit stand beside its first parameter
        return lambda row: (
            cell(row[0], row[1]) if row[2] == next(iter(row[1].estimates)) else ""
        )

    columns = [
        Column("log", of_log(lambda name, found: name)),
        Column("", lambda row: parameter_words(row[2])),
        Column("value", lambda row: printed_estimate(*row[2:]).value, right=True),
        Column(
            "90 % interval", lambda row: printed_estimate(*row[2:]).interval, right=True
        ),
        Column("chi2 (chance)", of_log(lambda name, found: _chance(found))),
        Column("", of_log(lambda name, found: _faults(found))),
    ]
    return View(
        f"{len(fits)} of {len(answers)} logs fitted",
        [Table(columns, rows), Lines("Not fitted", failed), *more],
        made=made,
        footer=SAFETY,
    )


def _chance(found: Summary) -> str:
    p = goodness_p(found)
    return f"{found.chi2:.3g}/{found.dof} ({'-' if p is None else significant(p)})"


def _faults(found: Summary) -> str:
    outside = [] if found.law_valid else ["outside its law's range"]
    outliers = ["outliers"] if found.suspected_outliers else []
    return ", ".join([*map(alarm_name, found.problems), *outside, *outliers])


def answers_csv(answers: Mapping[str, Fit | InputError]) -> str:
    """Return a tidy table: one row a log and parameter, one for a log that failed."""
    rows: list[dict[str, Any]] = []
    for name, fit in answers.items():
        if isinstance(fit, InputError):
            rows.append({"log": name, "error": str(fit)})
            continue
        of_log = {k: getattr(fit.summary, k) for k in OF_LOG}
        for parameter, estimate in fit.summary.estimates.items():
            # a cell without a number is empty in CSV, not "nan"
            numbers = {k: x for k, x in asdict(estimate).items() if not math.isnan(x)}
            rows.append({"log": name, "parameter": parameter} | numbers | of_log)
    return table_text([COLUMNS, *([row.get(c) for c in COLUMNS] for row in rows)])


def fits_report(
    answers: Mapping[str, Fit | InputError],
    made: Mapping[str, Provenance] | None = None,
    of: "PickedFiles | None" = None,
    together: Provenance | None = None,
) -> Answer:
    """Return the answer of several logs.

    Args:
        answers: Fits or errors by log.
        made: Provenance by log, for the document.
        of: As for `fit_report`.
        together: Provenance of all logs, for the page.

    Raises:
        InputError: No log could be fitted.
    """
    fits = [fit for fit in answers.values() if isinstance(fit, Fit)]
    # one bad log must not hide the answers of the others
    if not fits:
        why = "; ".join(map(str, answers.values()))
        raise InputError(f"none of {len(answers)} logs could be fitted: {why}")
    # the worst code of all fits, so that one doubtful answer is visible to a script
    worst = max(fit.exit_code for fit in fits)
    picks, more, files = _picks(of)
    return Answer(
        fits_answer(answers, picks=picks),
        fits_view(answers, more, together),
        files={"answers.csv": answers_csv(answers), **files},
        filed=fits_answer(answers, made, picks),
        code=PROBLEM if len(fits) < len(answers) else worst,
    )
