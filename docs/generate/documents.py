"""JSON Schemas of answers, and tables of their keys, from the types that hold them."""

from collections.abc import Mapping
from typing import Any

from jblast.fidelity import Choice
from jblast.report.calculator.answer import CalculatorAnswer, InverseAnswer
from jblast.report.check import CheckAnswer
from jblast.report.choice import ChoiceAnswer
from jblast.report.design import BoundAnswer
from jblast.report.detect import DetectionAnswer
from jblast.report.discovery import DiscoveryAnswer
from jblast.report.film import EventsAnswer, FilmAnswer
from jblast.report.fit.document import FitAnswer, FitsAnswer
from jblast.report.flash import ClipsAnswer, FlashAnswer
from jblast.report.flights import FlightsAnswer, MissionAnswer
from jblast.report.gains import GainsAnswer
from jblast.report.listen import ListenAnswer
from jblast.report.picks import PickAnswer, PicksAnswer
from jblast.report.study import (
    MergeAnswer,
    OutcomesAnswer,
    StudyAnswer,
    StudyReportAnswer,
)
from jblast.report.tune import TuneAnswer
from jblast.report.world import WorldAnswer
from jblast.results import DIALECT, schema_of
from jblast.study.mavlink_servers import LockstepAnswer, WatchedAnswer
from jblast.world.remote.serving import ServedAnswer

DOCUMENTS: dict[str, tuple[type, str]] = {
    "fit": (FitAnswer, "An answer of jblast fit"),
    "fits": (FitsAnswer, "Answers of jblast fit"),
    "pick": (PicksAnswer, "An answer of jblast pick"),
    "bound": (BoundAnswer, "An answer of jblast bound"),
    "check": (CheckAnswer, "An answer of jblast check"),
    "calc": (CalculatorAnswer, "An answer of jblast calc"),
    "calc_inverse": (InverseAnswer, "A range or a mass by jblast calc"),
    "detect": (DetectionAnswer, "Sound searched by jblast detect"),
    "detect_film": (FlashAnswer, "Film seen by jblast detect"),
    "detect_clips": (ClipsAnswer, "Several videos seen by jblast detect"),
    "render": (FilmAnswer, "An answer of jblast render"),
    "events": (EventsAnswer, "An answer of jblast events"),
    "listen": (ListenAnswer, "An answer of jblast listen"),
    "study": (StudyAnswer, "An answer of jblast study"),
    "choose": (ChoiceAnswer, "An answer of jblast choose"),
    "fly": (FlightsAnswer, "An answer of jblast fly"),
    "fly_mission": (MissionAnswer, "A mission of jblast fly"),
    "discover": (DiscoveryAnswer, "An answer of jblast discover"),
    "tune": (TuneAnswer, "An answer of jblast tune"),
    "tune_gains": (GainsAnswer, "Gains tuned by jblast tune"),
    "world": (WorldAnswer, "An answer of jblast world"),
    "study_report": (StudyReportAnswer, "A report on a study"),
    "study_list": (OutcomesAnswer, "The outcomes of jblast study"),
    "study_merge": (MergeAnswer, "Merged stores of a study"),
    "serve": (ServedAnswer, "What came of jblast serve"),
    "serve_mavlink": (LockstepAnswer, "What came of jblast serve --mavlink"),
    "serve_ground_station": (
        WatchedAnswer,
        "What came of jblast serve --ground-station",
    ),
}
"""Types and titles of documents."""
PARTS = {
    "one_pick": ("pick", "picks"),
    "calc_inputs": ("calc", "inputs"),
    "one_arrival": ("detect", "arrivals"),
    "one_array": ("detect", "arrays"),
    "one_flash": ("detect_film", "flashes"),
    "one_record": ("listen", "sensors"),
    "one_outcome": ("study", "outcomes"),
    "one_tuned": ("tune", "estimates"),
    "tried_gains": ("tune_gains", "after"),
    "study_report_outcome": ("study_report", "outcomes"),
    "study_report_shares": ("study_report", "sensitivity"),
    "study_report_input": ("study_report", "sensitivity", "numbers"),
}
"""Parts of documents that have a table of their own: the keys that lead to them."""
TYPES = {"Choice": Choice, "PickAnswer": PickAnswer}
"""Types that classes import for type checkers alone."""


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a document."""
    cls, title = DOCUMENTS[name]
    return {"$schema": DIALECT, "title": title} | schema_of(cls, names=TYPES)


def table(name: str) -> str:
    """Write a row for each key of a document, or of a part of one."""
    document, *keys = PARTS.get(name, (name,))
    of = schema(document)
    for key in keys:
        of = of["properties"][key]
        while "properties" not in of:
            of = of.get("items") or of["additionalProperties"]
    rows = []
    for key, value in of["properties"].items():
        cells = value.get("description", value.get("const")), _within(value)
        rows.append(f"| `{key}` | {'; '.join(str(one) for one in cells if one)} |")
    return "\n".join(["| key | what it holds |", "|---|---|", *rows])


def _within(schema: Mapping[str, Any]) -> str:
    """Name the keys of entries: of one, of each of a list, or of each by its name."""
    if "properties" in schema:
        return ", ".join(f"`{key}`" for key in schema["properties"])
    for word, how in (("items", "each with "), ("additionalProperties", "by name ")):
        inner = schema.get(word)
        if isinstance(inner, Mapping) and (keys := _within(inner)):
            return keys if keys.startswith(how) else how + keys
    return next(filter(None, map(_within, schema.get("anyOf", ()))), "")
