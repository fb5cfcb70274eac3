"""The report as one HTML page without external files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jblast
from jblast.inference.fitting.fit import Fit
from jblast.report.estimates import printed_estimate
from jblast.report.figure_files import Picture
from jblast.report.fit.document import determined_lines
from jblast.report.fit.figures import absent_note
from jblast.report.fit.goodness import goodness_numbers, goodness_sentence
from jblast.report.fit.place import absent_map_note, map_alt, map_caption
from jblast.report.fit.rows import (
    Accepted,
    estimate_rows,
    fitted_words,
    log_name,
    residual_rows,
)
from jblast.report.fit.terminal import (
    SAFETY,
    accepted_not_fitted,
    conclusion,
    laws_used,
    limits,
    validity_sentence,
    warnings_of,
)
from jblast.report.messages import sentences_of
from jblast.report.pages import page
from jblast.report.picks import RECORDS_ALT, RECORDS_CAPTION
from jblast.report.provenance import Provenance, provenance_lines
from jblast.report.words import joined, parameter_words, quantity_words


@dataclass(frozen=True)
class Shown:
    """A figure of the page: source of its pixels, alternative text and caption."""

    heading: str
    source: str
    alt: str
    caption: str
    width: int


def report_page(
    fit: Fit,
    pictures: Mapping[str, Picture],
    made: Provenance,
    accepted: Accepted | None = None,
    extra_warnings: Sequence[str] = (),
) -> str:
    """Return the page.

    Args:
        fit: The fit.
        pictures: The figures by name: "map", "recordings", "residuals", "corner".
        made: Provenance of the answer.
        accepted: Published values by parameter name, each with its source.
        extra_warnings: Failures since the fit, such as a figure that was not drawn.
    """
    found, name = fit.summary, log_name(fit)
    used = laws_used(found, fit.scene.scatter)
    return page(
        "templates/fit.html",
        title=f"Blast fit: {name}" if name else "Blast fit",
        subtitle="{}; fitted: {}".format(*fitted_words(found)),
        conclusion=conclusion(fit, accepted),
        doubtful=bool(found.problems) or not found.law_valid,
        estimates=estimate_rows(found, accepted),
        has_accepted=bool(accepted),
        not_fitted=accepted_not_fitted(fit, accepted),
        determined=determined_lines(found.determined),
        pictures=[_shown(fit, kind, picture) for kind, picture in pictures.items()],
        has_corner="corner" in pictures,
        absent_note=absent_note(fit),
        absent_map_note="" if "map" in pictures else absent_map_note(fit),
        laws=used,
        registered=any(law.source for law in used),
        validity=validity_sentence(fit),
        goodness_numbers=goodness_numbers(found),
        goodness=goodness_sentence(found),
        rows=residual_rows(fit),
        n_rows=len(fit.observations),
        warnings=[*_warnings(fit), *extra_warnings],
        understood=sentences_of(found.understood),
        limits=limits(fit),
        provenance=provenance_lines(made),
        scene_text=made.scene_text,
        comments="\n".join(fit.observations.comments),
        safety=SAFETY,
        version=jblast.__version__,
    )


def _warnings(fit: Fit) -> list[str]:
    """Return the warnings with the log's name instead of its path.

    The page may be passed on, and a path can contain private names.
    """
    source = fit.observations.source
    texts = warnings_of(fit.summary)
    return [t.replace(source, log_name(fit)) if source else t for t in texts]


def _shown(fit: Fit, kind: str, picture: Picture) -> Shown:
    quantities = joined([quantity_words(q) for q in fit.summary.law])
    # only shock radii are readings at a time; next to any other quantity the range is
    # the axis
    along = "time" if list(fit.summary.law) == ["shock_radius_m"] else "range"
    values = "; ".join(
        f"{parameter_words(name)} {printed.value} (90 %: {printed.interval})"
        for name in fit.summary.free
        for printed in [printed_estimate(name, fit.summary.estimates[name])]
    )
    heading, alt, caption = {
        "map": ("Map", map_alt(fit), map_caption(fit)),
        "records": ("Records", RECORDS_ALT, RECORDS_CAPTION),
        "recordings": (
            f"Recordings against {along}",
            f"Plot of {quantities} against {along}: recordings with error bars, the "
            "law at the answer and its 5 to 95 % band.",
            "The band is the posterior uncertainty, without model error. Error bars "
            "include the recording's error and the law's scatter from record to "
            "record. The scatter that a shot or path shares shifts all its points to "
            "one side.",
        ),
        "residuals": (
            "Residuals",
            f"Plot of residuals in standard deviations against {along}, with lines at "
            "plus and minus 2. " + goodness_sentence(fit.summary),
            "About 95 % should lie between the dashed lines, without a trend.",
        ),
        "corner": (
            "Posterior",
            f"Posterior of the fitted parameters: {values}. {absent_note(fit)}".strip(),
            "Draws of the posterior: the uncertainty of each parameter, and the "
            "correlations between parameters.",
        ),
    }[kind]
    return Shown(heading, picture.source, alt, caption, picture.width)
