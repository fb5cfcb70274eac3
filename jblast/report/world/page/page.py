"""A world as one HTML page that needs nothing beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from matplotlib.figure import Figure

from jblast.report.figure_files import picture_of
from jblast.report.numbers import printed_number
from jblast.report.pages import page
from jblast.report.words import capitalised
from jblast.report.world.page.answers import ShotAnswer
from jblast.report.world.page.folder import RunFolder
from jblast.report.world.page.map_figure import map_figure
from jblast.report.world.page.timeline import timeline_figure
from jblast.scene import Scene

ALT_MAP = "Map of blasts, sensors and the vehicle's path."
ALT_TIMELINE = "Flight, samples and events against time on one axis."


@dataclass(frozen=True)
class Table:
    """A table of the page.

    Attributes:
        title: Above it.
        head: Titles of the columns.
        rows: Cells.
        numbers: Columns that end below one another.
        marked: Rows that are to be looked at.
        lines: What is said below.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()
    marked: Sequence[int] = ()
    lines: list[str] = field(default_factory=list)


def world_page(run: RunFolder, scene: Scene, answers: Sequence[ShotAnswer] = ()) -> str:
    """Return the page.

    Args:
        run: The world.
        scene: Where its sensors stand.
        answers: What its readings tell of each blast, if that was asked.
    """
    document = run.document
    count = len(document["blasts"])
    tables = [_blasts(document), _perceived(document)]
    tables += [_answers(answers)] if answers else []
    tables += [_recovery(document["flight"])] if document["flight"] else []
    shown = [
        (timeline_figure(run), ALT_TIMELINE, "Every sense on the common clock."),
        (map_figure(run, scene, answers), ALT_MAP, "Seen from above; north is up."),
    ]
    versions = ", ".join(f"{name} {of}" for name, of in document["versions"].items())
    return page(
        "world/page/template.html",
        title=f"{count} blast{'' if count == 1 else 's'} in {document['seconds']:g} s",
        subtitle=f"{document['scene']}, seed {document['seed']}",
        mark=_mark(document.get("preset")),
        tables=tables,
        pictures=[_picture(*one) for one in shown if one[0] is not None],
        warnings=document["warnings"],
        made=[
            f"Command: {document['command']}",
            f"Made {document['date']} by {versions}.",
            f"Scene: SHA-256 {document['scene_sha256']}",
        ],
    )


def _mark(preset: dict[str, Any] | None) -> str:
    """Return what a run by a preset is; a run of an older jblast has none."""
    return f"Preset {preset['name']}: {preset['mark']}." if preset else ""


def _blasts(document: dict[str, Any]) -> Table:
    rows = [
        [
            blast["shot"],
            f"{blast['time_s']:.4f}",
            *(f"{x:.2f}" for x in blast["position_m"]),
            f"{blast['mass_kg']:.4g}",
        ]
        for blast in document["blasts"]
    ]
    head = ["Blast", "Time [s]", "East [m]", "North [m]", "Up [m]", "Mass [kg]"]
    return Table("Blasts", head, rows, range(1, 6))


def _perceived(document: dict[str, Any]) -> Table:
    """Return a row for each sense of everyone, a column for each blast."""
    shots = [blast["shot"] for blast in document["blasts"]]
    times: dict[tuple[str, str], dict[str, float]] = {}
    for one in document["perceived"]:
        who = times.setdefault((one["entity"], one["sense"]), {})
        who[one["shot"]] = one["time_s"]
    rows = [
        [*who, *(f"{of[shot]:.4f}" if shot in of else "-" for shot in shots)]
        for who, of in sorted(times.items())
    ]
    head = ["Who", "Perceived", *(f"Blast {shot} [s]" for shot in shots)]
    return Table("Who perceived what, and when", head, rows, range(2, len(head)))


def _answers(answers: Sequence[ShotAnswer]) -> Table:
    rows = [
        [of.shot, name, truth, value, interval]
        for of in answers
        for name, truth, value, interval, _ in of.rows
    ]
    held = [row[-1] for of in answers for row in of.rows]
    said = [f"Blast {of.shot}: {of.said}" for of in answers if of.said]
    said.append(
        f"{sum(held)} of {len(held)} 90 % intervals hold the truth; others are marked."
    )
    head = ["Blast", "Parameter", "Truth", "Answer", "90 % interval"]
    missed = [n for n, inside in enumerate(held) if not inside]
    return Table("What the readings tell", head, rows, (2, 3, 4), missed, said)


def _recovery(flight: dict[str, Any]) -> Table:
    keys = (
        "peak_deviation_m",
        "peak_time_s",
        "recovery_time_s",
        "peak_overpressure_pa",
    )
    rows = [
        [
            capitalised(name.replace("_", " ")),
            *(
                "-" if of[key] is None else printed_number(key, of[key], 3)
                for key in keys
            ),
            "yes" if of["flies_on"] else "no",
        ]
        for name, of in flight["holds"].items()
    ]
    head = ["Hold", "Peak deviation", "after", "Recovery after", "Peak overpressure"]
    head.append("Flies on")
    lines = [
        "Times count from the first arrival at the vehicle; a dash: not within the "
        f"tolerance of {printed_number('tolerance_m', flight['tolerance_m'])} "
        "when it ended."
    ]
    title = f"The {flight['vehicle'].capitalize()}"
    return Table(title, head, rows, (1, 2, 3, 4), lines=lines)


def _picture(figure: Figure, alt: str, caption: str) -> dict[str, Any]:
    picture = picture_of(figure)
    return {
        "source": picture.source,
        "alt": alt,
        "caption": caption,
        "width": picture.width,
    }
