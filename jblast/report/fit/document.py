"""The answer of a fit as JSON, and sentences on unidentified parameters."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from jblast.errors import InputError
from jblast.fidelity import TakenLaw
from jblast.inference.fitting.fit import Fit
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
    ResolvingDatum,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.parameters import CHARGE_POSITION
from jblast.quantities import QUANTITIES
from jblast.report.choice import law_reason
from jblast.report.messages import sentence_of
from jblast.report.provenance import Provenance
from jblast.report.words import (
    capitalised,
    finite,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    rounded,
    significant,
)
from jblast.results import ABSENT, AMONG, Document, Note, Words, among
from jblast.scene import parameter_named

if TYPE_CHECKING:  # a fit of a table reads no records
    from jblast.report.picks import PickAnswer

UNIDENTIFIED_LOG_SD = 0.5
"""Standard deviation of ln above which a positive parameter is called practically
unidentified: its 90 % interval spans a factor of five."""
RANGING = "range = sound speed times the delay after the flash"
WHERE = {
    "sensor": "at a sensor of the log",
    "place": "at a new position",
    "aside": "at a new position off the sensors' line",
    "range": "at a new range",
    "later": "at a later time",
}
NEAR_ALONE = "near the answer only: the invariance is curved"
"""Note on a combination that is identified at the answer but not elsewhere."""


def practically_unidentified(estimates: Mapping[str, Estimate]) -> list[str]:
    """Return the parameters with a value that is too uncertain to be used."""
    return [
        name
        for name, estimate in estimates.items()
        if estimate.identified
        # a parameter that can be negative has no sd of ln: it is never listed
        and (finite(estimate.log_sd) or 0.0) > UNIDENTIFIED_LOG_SD
    ]


def null_direction_sentence(direction: NullDirection) -> str:
    """Return the joint change of parameters that leaves every recording unchanged."""
    steps = {n: float(step) for n, step in direction.parameters.items() if step}
    names = [parameter_words(name) for name in steps]
    # one parameter alone is not a combination
    if len(steps) == 1:
        return f"The recordings do not depend on the {names[0]}."
    # the step is scaled so that the largest change in ln is a factor of two; without a
    # parameter in ln, so that the largest change is one unit
    space = direction.space
    in_ln = [abs(step) for name, step in steps.items() if _in_ln(name, space)]
    pace = max(in_ln, default=max(abs(step) for step in steps.values()))
    moved = math.log(2.0) if in_ln else 1.0
    changes = [
        f"{parameter_words(name)} times {significant(2.0 ** (step / pace), 3)}"
        if _in_ln(name, space)
        else f"{parameter_words(name)} by {'+' if step > 0 else ''}"
        f"{printed_number(name, moved * step / pace, 3)}"
        for name, step in steps.items()
    ]
    return (
        f"The recordings do not separate the {joined(names)}: {joined(changes)} "
        "together change no recording."
    )


def _in_ln(name: str, space: str) -> bool:
    return space != "linear" and parameter_named(name).positive


def cure_words(cure: Cure) -> str:
    """Return the priors, measurements or data that resolve a null direction."""
    known = f"a prior on, or a measurement of, {' or '.join(cure.parameters)}"
    added = "; ".join(datum_words(datum) for datum in cure.data)
    return f"{known}; or {added}" if added else known


def datum_words(datum: ResolvingDatum) -> str:
    """Return the quantity to record, with its location."""
    quantity = QUANTITIES[datum.quantity].with_article()
    bang = f" (of the bang: {RANGING})" if datum.is_bang else ""
    clock = ", on a correct clock" if datum.on_right_clock else ""
    return f"{quantity}{bang} {WHERE[datum.where]}{clock}"


def reason_words(other: OtherMode) -> str:
    """Return the parameters in which another optimum differs, and its chi2."""
    kind = "position" if set(CHARGE_POSITION) & set(other.differ) else "solution"
    names = ", ".join(sorted(other.differ)) or "all"
    return (
        f"another {kind} in {names} explains the log nearly as well (chi squared "
        f"differs by {other.delta_chi2:.2g})"
    )


def ambiguity_sentence(other: OtherMode) -> str:
    """Return the parameters of another solution, and its difference in chi2."""
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
    """Return the data that would resolve a null direction or an ambiguity."""
    is_null = isinstance(entry, NullDirection)
    cure = cure_words(entry.cure) if is_null else datum_words(entry.cure)
    return f"Add: {cure}."


def determined_lines(determined: Sequence[EstimableCombination]) -> list[str]:
    """Return one line for each identified combination of parameters."""
    lines = []
    for entry in determined:
        value, sd = finite(entry.value), finite(entry.sd)
        if value is None:
            lines.append(entry.combination)
        # without an sd there are no significant digits to round to
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
    """Return the answer for one log.

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
    """Return the answers for several logs.

    Args:
        answers: Answers by name of the log.
        made: Provenance of each, for a file.
        picks: Picks of the logs, if they were picked, as `jblast pick` prints them.
    """
    made = made or {}
    logs = {
        name: FailedLog(str(fit), made.get(name))
        if isinstance(fit, InputError)
        else fit_answer(fit, made.get(name))
        for name, fit in answers.items()
    }
    return FitsAnswer(logs, picks)
