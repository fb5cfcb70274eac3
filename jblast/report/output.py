"""Answers of commands: their files, and the text or JSON on stdout.

A verb returns an `Answer`, and `deliver` does the rest. Files are written completely or
not at all, numbers before figures. A figure that cannot be drawn is left out with a
warning, as it must not lose the computed numbers.
"""

import sys
import warnings
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.files import PAGE, Content, save, writing
from jblast.progress import clear
from jblast.report.view import Picture, View, terminal
from jblast.results import Document

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROBLEM = 4
"""Exit code of an answer that is computed, but must not be used as it is."""
NOT_FOUND = 3
"""Exit code of a search that found nothing."""
RECORDS = tuple(f"records_{n}.png" for n in range(1, 11))
"""Figures of picked records: ten show 240 records, and nobody reads more."""
FIT_FILES = ("fit.json", "fits.json", "answers.csv", "posterior.nc")
FIT_FILES += ("map.png", "recordings.png", "residuals.png", "corner.png", *RECORDS)
FIT_FILES += ("place.geojson", "place.kml")
"""Files of `jblast fit` besides the page; known here before JAX is imported."""
PICKS = ("picks/picks.json", "picks/picks.csv")
"""Files of `jblast fit --positions`; never removed, as a log to fit may be one."""


@dataclass(frozen=True)
class Answer:
    """The answer of a command.

    Attributes:
        document: Its JSON.
        view: Its text, page and figures.
        files: Content of further files in the output folder, by name; None for those
            that are written already.
        saved: Content of files with an option of their own, by path.
        filed: Its JSON in the output folder, if it has more there.
        code: Exit code; a problem in the view makes 0 to 4.
        after: Lines after the list of written files, such as the next command.
    """

    document: Document
    view: View
    files: Mapping[str, Content | None] = field(default_factory=dict)
    saved: Mapping[str, Content] = field(default_factory=dict)
    filed: Document | None = None
    code: int = 0
    after: Sequence[str] = ()

    @property
    def exit_code(self) -> int:
        """The exit code, which agrees with the text by construction."""
        return self.code or (PROBLEM if self.view.problems else 0)


def deliver(
    answer: Answer,
    options: Namespace,
    *,
    folder: str | None = None,
    names: Sequence[str] = (),
    name: str = "",
) -> int:
    """Write the files of an answer, print it, and return its exit code.

    Args:
        answer: The answer.
        options: Options of the command: `verb`, `json`, and optionally `verbose`.
        folder: Folder for the document, the files, the figures and the page.
        names: Files that an earlier run of the command may have left in the folder;
            those that are not written again are removed.
        name: Name of the document without its suffix (default: that of the verb).
    """
    text = answer.document.to_json()
    written: list[str] = []
    try:
        for path, content in answer.saved.items():
            save(Path(path), content)
        if folder:
            name = name or options.verb
            written = write_answer(answer, Path(folder), name, names=names)
    finally:
        clear()
        # also after an error of writing: nothing computed is lost
        if options.json:
            sys.stdout.write(text)
        else:
            verbose = getattr(options, "verbose", False)
            sys.stdout.write(terminal(answer.view, verbose=verbose))
    if not options.json:
        lines = [f"Written to {folder}: {', '.join(written)}"] if written else []
        lines += [f"Written: {path}" for path in answer.saved]
        lines += answer.after
        sys.stdout.write("".join(f"{line}\n" for line in ["", *lines] if lines))
    return answer.exit_code


def write_answer(
    answer: Answer,
    folder: Path,
    name: str,
    *,
    names: Sequence[str] = (),
) -> list[str]:
    """Write an answer to a folder: document, files, figures and page.

    Args:
        answer: The answer.
        folder: The folder; made if missing.
        name: Name of the document without its suffix.
        names: Files of an earlier answer; those that are not written are removed.

    Returns:
        Names of the written files.

    Raises:
        InputError: A file cannot be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        document = answer.filed or answer.document
        save(folder / f"{name}.json", document.to_json())
        written = [f"{name}.json"]
        for file, content in answer.files.items():
            if content is not None:
                save(folder / file, content)
            written.append(file)
        pictures = [b for b in answer.view.blocks if isinstance(b, Picture)]
        drawn = {}
        for one in pictures:
            if (made := draw(one)) is not None:
                save(folder / one.name, made)
                drawn[one.name] = made
        # imported here, as a template takes a tenth of a second to load
        from jblast.report.page import page

        save(folder / PAGE, page(answer.view, drawn))
        written += [*drawn, PAGE]
        for old in set(names) - set(written):
            (folder / old).unlink(missing_ok=True)
    return written


def page_of(view: View) -> str:
    """Return a view as a page with its figures."""
    from jblast.report.page import page

    pictures = [block for block in view.blocks if isinstance(block, Picture)]
    return page(view, {p.name: made for p in pictures if (made := draw(p))})


def draw(picture: Picture) -> bytes | None:
    """Return a figure as a PNG file; on failure warn and return None."""
    from jblast.report.figures import figure_bytes

    try:
        return figure_bytes(picture.draw())
    except Exception as error:
        warnings.warn(f"{picture.name} was not drawn: {error!r}", stacklevel=2)
        return None


def figure_file(draw: "Callable[[], Figure]", path: str) -> bytes:
    """Return a figure as the content of a file, in the format of its suffix."""
    from jblast.report.figures import figure_bytes

    return figure_bytes(draw(), Path(path).suffix[1:].lower())
