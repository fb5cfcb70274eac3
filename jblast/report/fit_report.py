"""The answer of `jblast fit`: JSON, view and files."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from jblast.errors import InputError
from jblast.fidelity import TakenLaw
from jblast.files import check_out
from jblast.inference.design.cramer_rao import BoundSummary
from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.fit_input import log_names
from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.place import OnEarth, on_earth
from jblast.inference.fitting.summary import Summary
from jblast.inference.fitting.wrong import (
    ExchangedSensors,
    SuspectedOutlier,
    WrongClock,
    WrongSensor,
)
from jblast.inference.identify import (
    Cure,
    EstimableCombination,
    NullDirection,
    OtherMode,
    PlaceRegion,
    ResolvingDatum,
    requested,
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
    Printed,
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
    listed,
    printed_p,
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
from jblast.report.output import PAGE, PROBLEM, Answer, Content, write_answer
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
    comma_separated,
    terminal,
)
from jblast.results import ABSENT, AMONG, Document, Note, Words, among
from jblast.scene import parameter_named

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
DRAWS, CSV = "posterior.nc", "answers.csv"
NAMES = ("map.png", "records.png", "recordings.png", "residuals.png", "corner.png")
NAMES += ("place.geojson", "place.kml", DRAWS)
"""Files that a report may contain besides the document and the page."""
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


@dataclass(frozen=True)
class Explanation:
    """A sensor, clock or pair of sensors that explains a log that does not fit.

    Attributes:
        kind: Kind of the explanation.
        named: Its name.
        pair: The second sensor of an exchanged pair.
        clock: The offset of a clock.
        rest: Results of the fit without it.
    """

    kind: Literal["clock", "sensor", "exchange"]
    named: WrongSensor = field(metadata=among("name"))
    pair: ExchangedSensors | None = field(metadata=among("other"))
    clock: WrongClock | None = field(
        metadata=among("offset_s", "offset_sd", "parameter")
    )
    rest: WrongSensor = field(
        metadata=among("chi2", "dof", "p_value", "law_valid_rows", "estimates")
    )


def _ambiguity(of: OtherMode) -> Ambiguity:
    return Ambiguity(of, reason_words(of), datum_words(of.cure))


def _determined(of: EstimableCombination) -> Determined:
    return Determined(of, NEAR_ALONE if of.is_local else None)


def _explanation(of: WrongSensor) -> Explanation:
    # keys of the other kinds are left out of the JSON
    pair = of if isinstance(of, ExchangedSensors) else None
    clock = of if isinstance(of, WrongClock) else None
    kind = "exchange" if pair else "clock" if clock else "sensor"
    return Explanation(kind, of, pair, clock, of)


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
    WrongSensor: _explanation,
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


def problem_lines(fit: Fit) -> list[str]:
    """Return the problems of an answer, the most serious first, with their remedies."""
    found = fit.summary
    details = open_lines(found)
    lines = [
        alarm(problem)
        for problem in found.problems
        # the details contain it, with intervals
        if problem.kind != "not_identifiable" or not details
    ]
    lines += [explanation(wrong) for wrong in found.explained_by]
    lines += [_stated(note) for note in found.warnings if note.kind in REMEDIES]
    return [*lines, *details] if lines or found.problems else []


def open_lines(found: Summary) -> list[str]:
    """Return sentences on a position or other parameters that are not identified."""
    return bearing_lines(found) + region_lines(found) + unidentified_lines(found)


def _stated(note: Note) -> str:
    return f"{capitalised(sentence_of(note))}."


def bearing_lines(found: Summary) -> list[str]:
    """Return the answer of an array that identifies the bearing but not the range."""
    distance = found.derived.get("range_m")
    if distance is None:
        return []
    least = printed_number("range_m", distance.q05)
    bounds = f"at least {least}"
    if math.isfinite(distance.q95):
        bounds = f"{least} to {printed_number('range_m', distance.q95)}"
    several = len(found.bearing_arcs) > 1
    named = [
        f"{arc.bearing_deg.value:.1f} +- {arc.bearing_deg.sd:.1f} degrees"
        + f" ({arc.share:.0%})" * several
        for arc in found.bearing_arcs
    ]
    kind = "bearing_alone" if named else "range_alone"
    return [sentence(kind, bearings=named, bounds=bounds) + "."]


def region_lines(found: Summary) -> list[str]:
    """Return the regions of a position if there are several, the first first."""
    if not found.regions:
        return []
    named = [_region(one) for one in found.regions]
    return [
        f"The position is one of {len(named)}: {'; or '.join(named)}. The estimates "
        "are those of the first."
    ]


def _region(region: PlaceRegion) -> str:
    share = f"{region.share:.0%}"
    if not region.is_place:
        ends = region.range_m.q05, region.range_m.q95
        far = " to ".join(printed_number("range_m", x) for x in ends)
        return f"{far} from the centre of the sensors ({share})"
    place = [
        f"{parameter_words(name)} {printed_estimate(name, estimate).interval}"
        for name, estimate in region.estimates.items()
        if name.partition(".")[0] in CHARGE_POSITION[:2]
    ]
    mass = _mass({n: e for n, e in region.estimates.items() if e.identified})
    return f"{', '.join([*place, *([mass] if mass else [])])} ({share})"


def unidentified_lines(found: Summary) -> list[str]:
    """Return a sentence on the requested parameters that are not identified, or none.

    Coordinates that are all identified, or all not, are called the position.
    """
    known: dict[str, list[tuple[str, Estimate]]] = {}
    unknown: dict[str, list[tuple[str, Estimate]]] = {}
    for name in requested(found.free):
        estimate = found.estimates[name]
        by = known if estimate.identified else unknown
        by.setdefault(_called(name), []).append((name, estimate))
    if not unknown:
        return []
    # of a position with one identified coordinate each coordinate is named
    for word in known.keys() & unknown.keys():
        for by in (known, unknown):
            by |= {parameter_words(one[0]): [one] for one in by.pop(word)}
    parts = [f"{word}{_bounds(of)}" for word, of in unknown.items()]
    verb = "is" if len(parts) == 1 else "are"
    text = f"The {joined(parts)} {verb} not identified"
    if known:
        text += f"; {joined(list(known))} {'is' if len(known) == 1 else 'are'}"
    return [f"{text}."]


def _called(name: str) -> str:
    """Return the short name of a parameter, for headlines."""
    stem, dot, label = name.partition(".")
    short = dict.fromkeys(CHARGE_POSITION, "position") | {"origin_time_s": "time"}
    if stem not in short:
        return parameter_words(name)
    return f"{short[stem]} of {label}" if dot else short[stem]


def _bounds(numbers: list[tuple[str, Estimate]]) -> str:
    """Return the 90 % intervals of unidentified parameters, in brackets."""
    printed = [printed_estimate(*one).interval for one in numbers]
    if "-" in printed:
        return ""
    words = [parameter_words(name) + " " for name, _ in numbers]
    named = words if len(numbers) > 1 else [""]
    return f" ({', '.join(map(str.__add__, named, printed))})"


def _mass(estimates: Mapping[str, Estimate]) -> str:
    """Return the masses among estimates, with their intervals."""
    stem = "charge_mass_kg"
    masses = {n: e for n, e in estimates.items() if n.partition(".")[0] == stem}
    return sentence("{masses:estimates}", masses=masses)


def explanation(wrong: WrongSensor) -> str:
    """Return the result of a fit without a wrong clock or sensor, and the remedy."""
    kind, facts = "without_sensor", {"p": printed_p(wrong.p_value)}
    if isinstance(wrong, ExchangedSensors):
        kind = "exchanged"
    elif isinstance(wrong, WrongClock):
        kind = "without_clock"
        offset, sd = wrong.offset_s, wrong.offset_sd
        # two digits beyond the standard deviation; nine are all that a clock resolves
        digits = 2 + int(math.log10(max(abs(offset) / sd, 1.0)))
        facts["off"] = printed_number("_s", abs(offset), min(digits, 9))
        facts["ahead"] = "ahead" if offset > 0 else "behind"
        facts["sd"] = printed_number("_s", sd, 2)
    text = sentence(kind, wrong, **facts) + "."
    if mass := _mass(wrong.estimates):
        outside = "" if wrong.law_valid_rows else ", outside the laws"
        text += f" {'Then' if kind == 'exchanged' else 'Without it'}: {mass}{outside}."
    if isinstance(wrong, WrongClock) and wrong.parameter:
        return f"{text} To fit its clock: --free {wrong.parameter}."
    remedy = "exchanged_remedy" if kind == "exchanged" else "comment_out"
    return f"{text} {capitalised(sentence(remedy))}."


# Tables and sections of the view


@dataclass(frozen=True)
class EstimateRow:
    """An estimate in print.

    Attributes:
        name: Words of the parameter.
        printed: Value and interval.
        accepted: The accepted value, its source, and whether the interval contains it.
        is_outside: Whether the interval does not contain the accepted value.
        is_derived: Whether the estimate is computed from a mass.
    """

    name: str
    printed: Printed
    accepted: str
    is_outside: bool
    is_derived: bool


ESTIMATES = [
    Column("", lambda row: capitalised(row.name)),
    Column("value", lambda row: row.printed.value_and_beside, right=True),
    Column("90 % interval", lambda row: row.printed.interval, right=True),
    Column("", lambda row: "derived" if row.is_derived else ""),
    Column("accepted", lambda row: row.accepted),
]


def estimate_rows(found: Summary, accepted: Accepted | None) -> list[EstimateRow]:
    """Return a row for each fitted parameter, then for each derived one."""
    rows = []
    for name, estimate in {**found.estimates, **found.derived}.items():
        shown, inside = "", None
        if accepted and name in accepted:
            value, label = accepted[name]
            low, high = finite(estimate.q05), finite(estimate.q95)
            if low is not None and high is not None:
                inside = bool(low <= value <= high)
            verdict = {None: "no interval", True: "inside", False: "outside"}[inside]
            shown = f"{printed_value(name, value)}, {label}: {verdict}"
        words, printed = parameter_words(name), printed_estimate(name, estimate)
        derived = name in found.derived
        rows.append(EstimateRow(words, printed, shown, inside is False, derived))
    return rows


def accepted_not_fitted(found: Summary, accepted: Accepted | None) -> list[str]:
    """Return a sentence for each accepted value of a parameter that was not fitted."""
    return [
        f"The accepted {parameter_words(name)} ({label}) was not fitted."
        for name, (_, label) in (accepted or {}).items()
        if name not in found.estimates and name not in found.derived
    ]


LAW = [
    Column("Quantity", lambda row: quantity_words(row[0])),
    Column("Law", lambda row: row[1]),
    Column("Reason", lambda row: law_reason(row[2]) if row[2] else ""),
    Column("Range of validity", lambda row: row[3].range if row[3] else ""),
    Column("Source", lambda row: row[3].source if row[3] else ""),
    Column("Scatter", lambda row: row[4]),
]


def law_table(found: Summary | BoundSummary, has_scatter: bool) -> Table:
    """Return the law of each quantity of the log, with reason, range and source.

    Args:
        found: Results of a fit, or of a bound.
        has_scatter: Whether the model includes the scatter of the laws.
    """
    rows = []
    for quantity, name in found.law.items():
        law = LAWS.get((quantity, name))
        scatter = law.scatter_words() if law and has_scatter else "no model error"
        reason = found.law_reason.get(quantity)
        rows.append((quantity, name, reason, law, scatter if law else ""))
    return Table(LAW, rows, "Laws", where="page")


def law_facts(found: Summary | BoundSummary, has_scatter: bool) -> Facts:
    """Return law, reason and scatter of each quantity, for a terminal."""
    facts = []
    for row in law_table(found, has_scatter).rows:
        quantity, law, reason, _, _, scatter = (one.cell(row) for one in LAW)
        why = "; ".join(part for part in (reason, scatter) if part)
        facts.append((quantity, f"{law}: {why}" if why else law))
    return Facts(facts, "Laws", where="terminal")


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


def validity_sentence(fit: Fit) -> str:
    """Return a sentence on the range of validity of the laws."""
    if fit.summary.law_valid:
        return "The answer lies within the laws' range of validity."
    table, outside = fit.observations, []
    for band in fit.bands:
        # a band extends past the readings: its validity counts at the readings only
        along = table.time if band.axis == "time_s" else fit.distance
        x = along[np.isin(table.quantity, band.quantity) & np.isfinite(along)]
        nearest = np.abs(band.x[None, :] - x[:, None]).argmin(axis=1)
        if np.any(~band.valid[nearest]):
            outside.append(quantity_words(band.quantity))
    where = f" ({joined(outside)})" if outside else ""
    return (
        f"The answer lies outside the range of a law it uses{where}: it is an "
        "extrapolation, whose error the intervals do not include."
    )


def lower_bound_sentence(fit: Fit) -> str:
    """Return a sentence on the lower bounds and their agreement with the law, or ""."""
    bounds = fit.observations.bounds()
    rows, n = np.flatnonzero(bounds), len(bounds)
    if not len(rows):
        return ""
    sensors = listed(dict.fromkeys(fit.observations.sensor[row] for row in rows))
    missed = int(np.sum(fit.residual[rows] > 0))
    which = "it" if len(rows) == 1 else f"{missed or 'all'} of them"
    kept = f"predicts less than {which}" if missed else f"satisfies {which}"
    # a lower bound alone cannot exclude a large charge
    if len(rows) == n:
        return (
            f"All recordings are lower bounds ({sensors}): they exclude small charges "
            f"only. The law {kept}."
        )
    one = "is a lower bound" if len(rows) == 1 else "are lower bounds"
    return f"{len(rows)} of {n} recordings {one} ({sensors}); the law {kept}."


def outlier_lines(outliers: Iterable[SuspectedOutlier]) -> list[str]:
    """Return one line for each suspected outlier."""
    return [
        f"{o.sensor}, {quantity_words(o.quantity)}: {o.sds:+.1f} sd" for o in outliers
    ]


@dataclass(frozen=True)
class Row:
    """A row of the log with the answer, in print.

    For a lower bound `measured` begins with ">", and `residual` is "satisfied" if the
    law predicts at least that value.
    """

    line: str
    sensor: str
    quantity: str
    range: str
    measured: str
    predicted: str
    sd: str
    residual: str
    suspected: bool


RESIDUALS = [
    Column("Sensor", lambda row: row.sensor),
    Column("", lambda row: "suspected outlier" if row.suspected else ""),
    Column("Line", lambda row: row.line, right=True),
    Column("Quantity", lambda row: row.quantity),
    Column("Range", lambda row: row.range, right=True),
    Column("Measured", lambda row: row.measured, right=True),
    Column("Law", lambda row: row.predicted, right=True),
    Column("Sd", lambda row: row.sd, right=True),
    Column("Residual (sd)", lambda row: row.residual, right=True),
]


def residual_table(fit: Fit) -> Table:
    """Return the rows of the log in order; of a long log the largest residuals."""
    caption = (
        "Sd: the recording's own error and the law's scatter from record to record. "
        "The error that the rows of a shot or a path share is subtracted from the "
        "residuals."
    )
    n = len(fit.observations)
    if n > MAX_ROWS:
        caption = f"The {MAX_ROWS} rows with the largest residuals of {n}. {caption}"
    return Table(
        RESIDUALS,
        residual_rows(fit),
        "Recordings and residuals",
        where="page",
        marked=lambda row: row.suspected,
        caption=caption,
    )


def residual_rows(fit: Fit) -> list[Row]:
    """Return the log's rows in order; for a long log only the largest residuals."""
    rows = np.arange(len(fit.observations))
    if len(rows) > MAX_ROWS:
        # rows without a residual count as the largest: readers search for them
        worst = np.argsort(-np.abs(np.nan_to_num(fit.residual, nan=np.inf)))
        rows = np.sort(worst[:MAX_ROWS])
    suspected = outlier_rows(fit)
    return [_row(fit, int(i), int(i) in suspected) for i in rows]


def _row(fit: Fit, i: int, suspected: bool) -> Row:
    table = fit.observations
    quantity, value, sd = table.quantity[i], float(table.value[i]), float(fit.sd[i])
    predicted, residual = float(fit.predicted[i]), float(fit.residual[i])
    # errors of positive quantities are shares of the value
    in_unit = sd if quantity in ADDITIVE else abs(value) * sd
    unit = unit_for(quantity, value, predicted if np.isfinite(predicted) else None)

    def show(number: float) -> str:
        if not np.isfinite(number):
            return "-"
        if not (np.isfinite(in_unit) and in_unit > 0.0):
            return f"{significant(number / unit.size, 4)} {unit.symbol}"
        return f"{rounded(number / unit.size, in_unit / unit.size)} {unit.symbol}"

    shown_sd = "-"
    if np.isfinite(sd):
        of_value = f"{significant(100.0 * sd)} %"
        shown_sd = printed_number(quantity, sd, 2) if quantity in ADDITIVE else of_value
    shown_residual = f"{residual:+.2f}" if np.isfinite(residual) else "-"
    distance, is_bound = float(fit.distance[i]), bool(table.bounds()[i])
    # radii at a time have no range; next to a charge it may be 0
    has_range = np.isfinite(distance) and quantity not in TIMED
    # the residual of a lower bound is exactly 0 where the law predicts at least it
    is_satisfied = is_bound and residual == 0.0
    return Row(
        line=str(table.line[i]) if i < len(table.line) else str(i + 1),
        sensor=table.sensor[i],
        quantity=quantity_words(quantity),
        range=printed_number("_m", distance) if has_range else "",
        measured=(AT_LEAST if is_bound else "") + show(value),
        predicted=show(predicted),
        sd=shown_sd,
        residual="satisfied" if is_satisfied else shown_residual,
        suspected=suspected,
    )


# The view


def fit_view(
    fit: Fit,
    accepted: Accepted | None = None,
    made: Provenance | None = None,
    more: Sequence[Block] = (),
    *,
    verbose: bool = False,
) -> View:
    """Return the view of a fit.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source; shown next
            to the estimates, inside or outside the interval.
        made: Provenance, for a page.
        more: Blocks after the estimates, as those of picks.
        verbose: Whether a terminal shows the laws with their reasons.
    """
    # imported here, as it loads what a map needs
    from jblast.report.fit_map import earth_lines

    found, name = fit.summary, log_name(fit)
    n, fitted = found.n_observations, list(map(parameter_words, found.free))
    count = f"{len(fitted)} parameters"
    names = count if len(fitted) > MAX_TITLE else joined(fitted) or "nothing"
    problems = problem_lines(fit)
    # beside ranges the origin, where a charge is assumed, is only a convention
    has_places = np.isfinite(fit.observations.position).all()
    assumed = [
        _stated(note)
        for note in found.assumptions
        if has_places and note.kind == "no_scene_nor_place"
    ]
    reliability = [
        goodness_sentence(found),
        validity_sentence(fit),
        lower_bound_sentence(fit),
        *(
            not_identified(found, found.estimates)
            or ["All fitted parameters are identified."]
        ),
    ]
    laws = quantities_by_law(found.law, fit.scene.scatter)
    warnings = sentences_of(n for n in found.warnings if n.kind not in REMEDIES)
    warnings = list(map(capitalised, warnings))
    # a page may be passed on, and a path can contain private names
    source = fit.observations.source or name
    private = [text.replace(source, name) if source else text for text in warnings]
    assumptions = [f"laws used: {laws}", *sentences_of(found.assumptions)]
    chi2 = "unknown" if finite(found.chi2) is None else f"{found.chi2:.1f}"
    p = goodness_p(found)
    goodness = f"chi2 = {chi2} on {found.dof} degrees of freedom"
    goodness += "" if p is None else f", p {printed_p(p)}"
    reason = fit.posterior_reason
    return View(
        f"Fit of {name}" if name else "Fit",
        [
            Lines("", assumed),
            Lines("", [] if problems else open_lines(found)),
            Lines("Place and time", earth_lines(fit)),
            Table(
                ESTIMATES,
                estimate_rows(found, accepted),
                "Estimates",
                marked=lambda row: row.is_outside,
            ),
            Lines("", accepted_not_fitted(found, accepted)),
            *more,
            Lines("Reliability", reliability),
            Lines("Identified combinations", determined_lines(found.determined)),
            Lines("Suspected outliers", outlier_lines(found.suspected_outliers)),
            Lines("Warnings", warnings, where="terminal"),
            Lines("Warnings", private, where="page"),
            *pictures(fit, accepted),
            Lines("Assumptions", list(map(capitalised, assumptions))),
            Lines(
                "Conversions of the log",
                sentences_of(found.understood),
                most=MAX_CONVERSIONS,
            ),
            law_table(found, fit.scene.scatter),
            *([law_facts(found, fit.scene.scatter)] if verbose else []),
            Facts(
                [
                    (
                        "Goodness of fit",
                        goodness,
                    ),
                    ("Intervals", capitalised(sentence_of(reason)) if reason else ""),
                ],
                where="detail",
            ),
            residual_table(fit),
            Text("Comments of the log", "\n".join(fit.observations.comments)),
        ],
        subtitle=f"{n} recording{'s' * (n != 1)}; fitted: {names}",
        problems=problems,
        made=made,
        footer=SAFETY,
    )


RECORDINGS = (
    "The band is the posterior uncertainty, without model error. Error bars include "
    "the recording's error and the law's scatter from record to record. The scatter "
    "that a shot or path shares shifts all its points to one side."
)


def pictures(fit: Fit, accepted: Accepted | None = None) -> list[Block]:
    """Return the figures of a fit, and the reason for each that is missing."""
    from jblast.report.fit_map import absent_map_note, map_alt, map_caption

    found, absent = fit.summary, absent_note(fit)
    quantities = joined([quantity_words(q) for q in found.law])
    # only shock radii are readings at a time; next to any other quantity the range is
    # the axis
    along = "time" if list(found.law) == ["shock_radius_m"] else "range"
    printed = {n: printed_estimate(n, found.estimates[n]) for n in found.free}
    values = "; ".join(
        f"{parameter_words(name)} {one.value} (90 %: {one.interval})"
        for name, one in printed.items()
    )
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
            partial(_figure, "recordings_figure", fit),
            f"Recordings against {along}",
            RECORDINGS,
            f"Plot of {quantities} against {along}: recordings with error bars, the "
            "law at the answer and its 5 to 95 % band.",
        ),
        Picture(
            "residuals.png",
            partial(_figure, "residuals_figure", fit),
            "Residuals",
            "About 95 % should lie between the dashed lines, without a trend.",
            f"Plot of residuals in standard deviations against {along}, with lines at "
            f"plus and minus 2. {goodness_sentence(found)}",
        ),
    ]
    if drawn_parameters(fit):
        corner = Picture(
            "corner.png",
            partial(_figure, "corner_figure", fit, accepted),
            "Posterior",
            "Draws of the posterior: the uncertainty of each parameter, and the "
            "correlations between parameters.",
            f"Posterior of the fitted parameters: {values}. {absent}".strip(),
        )
        return [*blocks, corner]
    return [*blocks, Lines("", [f"No posterior plot. {absent}".strip()], where="page")]


def _figure(name: str, *args: Any) -> "Figure":
    # imported here, so that an answer without figures does not load Matplotlib
    from jblast.report import fit_figures

    return getattr(fit_figures, name)(*args)


def _map(fit: Fit, accepted: Accepted | None) -> "Figure":
    from jblast.report.fit_map import fit_map
    from jblast.report.map_figures import map_figure

    shown = fit_map(fit, accepted)
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
    return terminal(fit_view(fit, accepted, verbose=verbose), verbose=verbose)


def fit_report(
    fit: Fit,
    accepted: Accepted | None = None,
    made: Provenance | None = None,
    of: "PickedFiles | None" = None,
    *,
    verbose: bool = False,
) -> Answer:
    """Return the answer of one log: document, view and files.

    Args:
        fit: The fit.
        accepted: As for `fit_view`.
        made: Provenance.
        of: Picks of the log, if it was picked.
        verbose: As for `fit_view`.
    """
    picks, more, files = _picks(of)
    own: dict[str, Content] = {}
    if (ensemble := fit.ensemble) is not None:

        def draws(path: Path) -> None:
            from jblast.inference.arviz_file import inference_data, write_inference_data

            notes = sentences_of(ensemble.notes)
            write_inference_data(
                inference_data(ensemble, fit.observations, notes), path
            )

        own[DRAWS] = draws
    if fit.observations.frame is not None:
        from jblast.report.fit_map import place_files

        own |= place_files(fit, accepted)
    return Answer(
        fit_answer(fit, picks=picks),
        fit_view(fit, accepted, made, more, verbose=verbose),
        files=own | files,
        filed=fit_answer(fit, made, picks),
        code=fit.exit_code,
    )


def _picks(
    of: "PickedFiles | None",
) -> tuple[Sequence[Any] | None, list[Block], dict[str, Content]]:
    """Return document, blocks and files of the picks of a log."""
    if of is None:
        return None, [], {}
    from jblast.report.picks import picks_answer, picks_blocks, picks_title

    document = picks_answer(of.found, of.log)
    blocks = picks_blocks(of, title=picks_title(of.found))
    return document.picks, blocks, {"picks/picks.json": document.to_json()}


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
    check_out(directory, ("fit.json", *NAMES, PAGE), force=force)
    made = made or provenance_of([fit.observations.source])
    report = fit_report(fit, accepted, made)
    return [directory / n for n in write_answer(report, directory, "fit", names=NAMES)]


# Several logs


def fits_view(
    answers: Mapping[str, Fit | InputError], more: Sequence[Block] = ()
) -> View:
    """Return the view of several logs: a row each, and the logs that failed."""
    fits = {name: fit for name, fit in answers.items() if isinstance(fit, Fit)}
    failed = [f"{n}: {e}" for n, e in answers.items() if isinstance(e, InputError)]
    # a row for each parameter; name and quality of the fit stand in the first
    rows = [
        (name, fit.summary, parameter, nth == 0)
        for name, fit in fits.items()
        for nth, parameter in enumerate(fit.summary.estimates)
    ]

    def printed(row) -> Printed:
        return printed_estimate(row[2], row[1].estimates[row[2]])

    columns = [
        Column("log", lambda row: row[0] if row[3] else ""),
        Column("", lambda row: parameter_words(row[2])),
        Column("value", lambda row: printed(row).value, right=True),
        Column("90 % interval", lambda row: printed(row).interval, right=True),
        Column("chi2 (chance)", lambda row: _chance(row[1]) if row[3] else ""),
        Column("", lambda row: _faults(row[1]) if row[3] else ""),
    ]
    return View(
        f"{len(fits)} of {len(answers)} logs fitted",
        [Table(columns, rows), Lines("Not fitted", failed), *more],
        footer=SAFETY,
    )


def _chance(found: Summary) -> str:
    p = goodness_p(found)
    return f"{found.chi2:.3g}/{found.dof} ({'-' if p is None else significant(p)})"


def _faults(found: Summary) -> str:
    warnings = [alarm_name(problem) for problem in found.problems]
    if not found.law_valid and found.law_valid_rows and not found.extrapolated:
        warnings.append("outside its law's range")
    if found.suspected_outliers:
        warnings.append("outliers")
    return ", ".join(warnings)


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
    return comma_separated([COLUMNS, *([row.get(c) for c in COLUMNS] for row in rows)])


def fits_report(
    answers: Mapping[str, Fit | InputError],
    made: Mapping[str, Provenance] | None = None,
    of: "PickedFiles | None" = None,
) -> Answer:
    """Return the answer of several logs; provenance by log, else as for `fit_report`.

    Raises:
        InputError: No log could be fitted.
    """
    fits = [fit for fit in answers.values() if isinstance(fit, Fit)]
    # one bad log must not hide the answers of the others
    if not fits:
        raise InputError(f"none of {len(answers)} logs could be fitted")
    # the worst code of all fits, so that one doubtful answer is visible to a script
    worst = max(fit.exit_code for fit in fits)
    picks, more, files = _picks(of)
    return Answer(
        fits_answer(answers, picks=picks),
        fits_view(answers, more),
        files={CSV: answers_csv(answers), **files},
        filed=fits_answer(answers, made, picks),
        code=PROBLEM if len(fits) < len(answers) else worst,
    )
