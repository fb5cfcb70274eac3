"""The report as files: the answer, the figures, and one page with all of it."""

import os
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.errors import InputError
from jblast.files import write_bytes, write_text
from jblast.inference.fitting.fit import Fit
from jblast.inference.mcmc import Ensemble
from jblast.observations import Observations
from jblast.report.estimates import Accepted
from jblast.report.fit.document import fit_answer
from jblast.report.messages import sentences_of
from jblast.report.provenance import Provenance, provenance_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWS = "posterior.nc"
NAMES = ("fit.json", "recordings.png", "residuals.png", "corner.png", "report.html")
NAMES += ("map.png", "records.png", "place.geojson", "place.kml", DRAWS)
"""Files that a report may contain."""


def write_report(
    fit: Fit,
    directory: str | Path,
    accepted: Accepted | None = None,
    force: bool = False,
    records: "Callable[[], Figure] | None" = None,
    made: Provenance | None = None,
    picks: Sequence[Any] | None = None,
) -> list[Path]:
    """Write a fit's answer, figures and page, the answer first.

    A figure that cannot be drawn is left out, with a warning here and on the page.
    There is no corner.png without a posterior, no map.png without positions of sensors,
    and no place.geojson and place.kml without a position on the Earth.

    Args:
        fit: The fit.
        directory: Output directory; created if missing.
        accepted: Published values by parameter name, each with its source.
        force: Whether to write into a directory that contains files. Files of an
            earlier report are replaced or removed, other files stay.
        records: Function that draws the records from which the log was picked.
        made: Provenance; None stands for the log's file and no command.
        picks: Picks of the log, if it was picked, as `jblast pick` prints them.

    Returns:
        The files written.

    Raises:
        InputError: The directory contains files and `force` is not set, or is a file.
    """
    # imported here, so that an answer without figures does not load Matplotlib
    from jblast.report.figure_files import Picture, picture_of
    from jblast.report.fit.figures import (
        corner_figure,
        recordings_figure,
        residuals_figure,
    )
    from jblast.report.fit.page import report_page
    from jblast.report.fit.place import fit_map, place_files
    from jblast.report.maps import map_figure

    directory = Path(directory)
    check_directory(directory, force)
    directory.mkdir(parents=True, exist_ok=True)
    for name in NAMES:  # a stale corner plot would look like this fit's
        (directory / name).unlink(missing_ok=True)
    made = made or provenance_of([fit.observations.source])
    written = [directory / "fit.json"]
    write_text(written[0], fit_answer(fit, made, picks).to_json())
    failures: list[str] = []
    if fit.ensemble is not None:
        try:
            draws = _write_draws(fit.ensemble, fit.observations, directory / DRAWS)
            written.append(draws)
        except Exception as error:
            failures.append(f"{DRAWS} was not written: {error!r}")
    try:
        for name, text in place_files(fit, accepted).items():
            write_text(directory / name, text)
            written.append(directory / name)
    except Exception as error:
        failures.append(f"place.geojson was not written: {error!r}")
    pictures: dict[str, Picture] = {}
    # functions, so that each figure is drawn inside the try below
    drawings: dict[str, Callable[[], Figure | None]] = {
        "map": lambda: map_figure(shown) if (shown := fit_map(fit, accepted)) else None,
        "records": lambda: records() if records else None,
        "recordings": lambda: recordings_figure(fit),
        "residuals": lambda: residuals_figure(fit),
        "corner": lambda: corner_figure(fit, accepted),
    }
    for kind, draw in drawings.items():
        try:
            figure = draw()
            if figure is not None:
                picture = picture_of(figure)
                path = directory / f"{kind}.png"
                write_bytes(path, picture.png)
                written.append(path)
                pictures[kind] = picture
        except Exception as error:
            # the answer may have taken hours: no failure of a figure may lose it
            failures.append(f"{kind}.png was not written: {error!r}")
    try:
        page = directory / "report.html"
        write_text(page, report_page(fit, pictures, made, accepted, failures))
        written.append(page)
    except Exception as error:
        failures.append(f"report.html was not written: {error!r}")
    for failure in failures:
        warnings.warn(failure, stacklevel=2)
    return written


def _write_draws(ensemble: Ensemble, log: Observations, path: Path) -> Path:
    """Write the MCMC draws as NetCDF in the schema of ArviZ."""
    from jblast.inference.arviz_file import inference_data, write_inference_data

    tree = inference_data(ensemble, log, sentences_of(ensemble.notes))
    write_inference_data(tree, path)
    return path


def check_directory(
    directory: str | Path, force: bool = False, what_for: str = "the report"
) -> None:
    """Check that a directory may be written to; call it before a long computation.

    Args:
        directory: Output directory.
        force: Whether its contents may be overwritten.
        what_for: Name of the output, for the message.

    Raises:
        InputError: It contains files and `force` is not set, it is or lies in a file,
            or its parent is not writable.
    """
    directory = Path(directory)
    # the nearest existing parent decides: the folders below it are created
    there = next(p for p in (directory, *directory.absolute().parents) if p.exists())
    if not there.is_dir():
        what = "got a file" if there == directory else f"but {there} is a file"
        raise InputError(f"{directory}: expected a directory for {what_for}, {what}")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(
            f"{directory}: expected a writable directory; {there} is not writable"
        )
    if not force and directory.is_dir() and any(directory.iterdir()):
        raise InputError(
            f"{directory}: already holds files; expected a new or empty directory for "
            f"{what_for}, or --force to overwrite"
        )
