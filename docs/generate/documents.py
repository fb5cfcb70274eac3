"""JSON Schemas of answers, and tables of their keys, from the types that hold them."""

from collections.abc import Mapping
from typing import Any

from jblast.report.calc import CalculatorAnswer, InverseAnswer
from jblast.report.check import CheckAnswer
from jblast.report.choice import ChoiceAnswer
from jblast.report.design import BoundAnswer
from jblast.report.detect import ClipsAnswer, DetectionAnswer, FlashAnswer
from jblast.report.discovery import DiscoveryAnswer
from jblast.report.film import EventsAnswer, FilmAnswer
from jblast.report.fit_report import FitAnswer, FitsAnswer
from jblast.report.flights import FlightsAnswer, MissionAnswer
from jblast.report.listen import ListenAnswer
from jblast.report.picks import PickAnswer, PicksAnswer
from jblast.report.study import (
    OutcomesAnswer,
    StudyAnswer,
    StudyReportAnswer,
)
from jblast.report.tune import GainsAnswer, TuneAnswer
from jblast.report.world import WorldAnswer
from jblast.results import DIALECT, schema_of
from jblast.study.mavlink_servers import LockstepAnswer, WatchedAnswer
from jblast.waves.choice import Choice
from jblast.world.serve.service import ServedAnswer

DOCUMENTS: dict[str, type] = {
    "fit": FitAnswer,
    "fits": FitsAnswer,
    "pick": PicksAnswer,
    "bound": BoundAnswer,
    "check": CheckAnswer,
    "calc": CalculatorAnswer,
    "calc_inverse": InverseAnswer,
    "detect": DetectionAnswer,
    "detect_film": FlashAnswer,
    "detect_clips": ClipsAnswer,
    "render": FilmAnswer,
    "events": EventsAnswer,
    "listen": ListenAnswer,
    "study": StudyAnswer,
    "choose": ChoiceAnswer,
    "fly": FlightsAnswer,
    "fly_mission": MissionAnswer,
    "discover": DiscoveryAnswer,
    "tune": TuneAnswer,
    "tune_gains": GainsAnswer,
    "world": WorldAnswer,
    "study_report": StudyReportAnswer,
    "study_list": OutcomesAnswer,
    "serve": ServedAnswer,
    "serve_mavlink": LockstepAnswer,
    "serve_ground_station": WatchedAnswer,
}
"""Types of documents, by name."""
TYPES = {"Choice": Choice, "PickAnswer": PickAnswer}
"""Types that classes import for type checkers alone."""


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a document."""
    cls = DOCUMENTS[name]
    title = (cls.__doc__ or "").partition("\n")[0].rstrip(".").replace("`", "")
    return {"$schema": DIALECT, "title": title} | schema_of(cls, names=TYPES)


def table(name: str) -> str:
    """Return a row for each key of a document, or of a part: `study.outcomes`."""
    document, *keys = name.split(".")
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
