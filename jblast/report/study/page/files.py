"""The files of a report on a study: page, figures, document."""

import json
from pathlib import Path

from jblast.files import write_bytes, write_text
from jblast.report.study.page.page import StudyReport


def write_report(report: StudyReport, directory: Path) -> None:
    """Write report.html, report.json and a PNG of each figure.

    Raises:
        OSError: One cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report.document(), indent=2, allow_nan=False)
    write_text(directory / "report.json", text + "\n")
    for name, picture in report.pictures.items():
        write_bytes(directory / f"{name}.png", picture.png)
    write_text(directory / "report.html", report.page())
