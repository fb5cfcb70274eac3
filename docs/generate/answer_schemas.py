"""JSON Schemas of answers, from the dataclasses that hold them.

An answer's fields are its keys, their types the schema, and what its docstring says of
them the description. Where a document words an entry otherwise than the class has it,
`WORDED` says so; a test holds documents of real answers against all of it.
"""

import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Union, get_args, get_origin, get_type_hints

from docs.generate.attributes import attributes
from jblast.fidelity import Choice, TakenLaw
from jblast.inference.design.cramer_rao import AddedDatum, BoundSummary
from jblast.inference.fitting.findings import WrongSensor
from jblast.inference.fitting.place import OnEarth
from jblast.inference.fitting.summary import Summary
from jblast.inference.identifiability import (
    Cure,
    EstimableCombination,
    OtherMode,
)
from jblast.inference.posterior.parameters import Finding
from jblast.observations.table import Understood
from jblast.report.autopilot import LockstepAnswer, WatchedAnswer
from jblast.report.calculator.answer import CalculatorAnswer, InverseAnswer
from jblast.report.check import CheckAnswer
from jblast.report.choice import ChoiceAnswer
from jblast.report.discovery import DiscoveryAnswer
from jblast.report.film import EventsAnswer, FilmAnswer
from jblast.report.flash import DirectionSeen, FlashAnswer
from jblast.report.flights import FlightsAnswer
from jblast.report.gains import GainsAnswer
from jblast.report.missions import MissionAnswer
from jblast.report.picks import PicksAnswer
from jblast.report.provenance import Provenance
from jblast.report.study_results import StudyReportAnswer
from jblast.report.study_run import StudyAnswer
from jblast.report.tune import TuneAnswer
from jblast.report.world import ServedAnswer, WorldAnswer
from jblast.verification.stability.failure import KEYS as FAILURE_KEYS, FailureMode

DIALECT = "https://json-schema.org/draft/2020-12/schema"
NUMBER = {"type": ["number", "null"]}
"""What is infinite or unknown is null."""
NULL = {"type": "null"}
SIMPLE: dict[Any, dict[str, Any]] = {
    float: NUMBER,
    int: {"type": "integer"},
    bool: {"type": "boolean"},
    str: {"type": "string"},
    Any: {},
}
Schema = dict[str, Any]
LAZY = {"Choice": Choice, "DirectionSeen": DirectionSeen}
"""Types that classes name and import for checkers alone."""


def fit() -> Schema:
    """Return the schema of what `jblast fit --json` prints of one log, and of fit.json.

    What it was made of stands in the file alone, picks where records were picked.
    """
    both = schema_of(Summary)["properties"] | schema_of(OnEarth)["properties"]
    told = _document("An answer of jblast fit", _object(both))
    told["properties"]["provenance"] = schema_of(Provenance)
    told["properties"]["picks"] = schema_of(PicksAnswer)["properties"]["picks"]
    return told


def fits() -> Schema:
    """Return the schema of what `jblast fit --json` prints of several logs."""
    one = fit()
    picks = one["properties"].pop("picks")
    failed = _object({"error": {"type": "string"}})
    failed["properties"]["provenance"] = one["properties"]["provenance"]
    logs = {"type": "object", "additionalProperties": {"anyOf": [failed, one]}}
    told = _document("Answers of jblast fit", _object({"logs": logs}))
    told["properties"]["picks"] = picks
    return told


def pick() -> Schema:
    """Return the schema of what `jblast pick --json` prints."""
    return _document("An answer of jblast pick", schema_of(PicksAnswer))


def bound() -> Schema:
    """Return the schema of what `jblast bound --json` prints."""
    return _document("An answer of jblast bound", schema_of(BoundSummary))


def study() -> Schema:
    """Return the schema of what `jblast study --json` prints."""
    return _titled("An answer of jblast study", schema_of(StudyAnswer))


def choose() -> Schema:
    """Return the schema of what `jblast choose --json` prints."""
    return _titled("An answer of jblast choose", schema_of(ChoiceAnswer))


def calc() -> Schema:
    """Return the schema of what `jblast calc --json` prints of quantities at ranges."""
    return _titled("An answer of jblast calc", schema_of(CalculatorAnswer))


def calc_inverse() -> Schema:
    """Return the schema of what it prints where a range or a mass is asked for."""
    return _titled("A range or a mass by jblast calc", schema_of(InverseAnswer))


def detect_film() -> Schema:
    """Return the schema of what `jblast detect --json` prints of film or events."""
    return _document("Film seen by jblast detect", schema_of(FlashAnswer))


def render() -> Schema:
    """Return the schema of what `jblast render --json` prints."""
    return _titled("An answer of jblast render", schema_of(FilmAnswer))


def events() -> Schema:
    """Return the schema of what `jblast events --json` prints."""
    return _titled("An answer of jblast events", schema_of(EventsAnswer))


def discover() -> Schema:
    """Return the schema of what `jblast discover --json` prints."""
    return _document("An answer of jblast discover", schema_of(DiscoveryAnswer))


def fly() -> Schema:
    """Return the schema of what `jblast fly --json` prints."""
    return _document("An answer of jblast fly", schema_of(FlightsAnswer))


def tune() -> Schema:
    """Return the schema of what `jblast tune --json` prints, and of tune.json."""
    return _document("An answer of jblast tune", schema_of(TuneAnswer))


def tune_gains() -> Schema:
    """Return the schema of what `jblast tune --gains --json` prints, and tune.json."""
    return _document("Gains tuned by jblast tune", schema_of(GainsAnswer))


def fly_mission() -> Schema:
    """Return the schema of what `jblast fly --json` prints of a mission."""
    return _document("A mission of jblast fly", schema_of(MissionAnswer))


def world() -> Schema:
    """Return the schema of what `jblast world --json` prints, and of run.json."""
    told = _document("An answer of jblast world", schema_of(WorldAnswer))
    flight = told["properties"]["flight"]
    flown = {"schema": {"const": 1}} | schema_of(FlightsAnswer)["properties"]
    flight["anyOf"] = [_object(flown), NULL]
    return told


def study_report() -> Schema:
    """Return the schema of what `jblast study report --json` prints, and its file."""
    return _document("A report on a study", schema_of(StudyReportAnswer))


def serve() -> Schema:
    """Return the schema of what `jblast serve --json` prints when it is stopped."""
    return _document("What came of jblast serve", schema_of(ServedAnswer))


def serve_mavlink() -> Schema:
    """Return the schema of what `jblast serve --mavlink --json` prints at the end."""
    title = "What came of jblast serve --mavlink"
    return _document(title, schema_of(LockstepAnswer))


def serve_ground_station() -> Schema:
    """Return the schema of what `jblast serve --ground-station --json` prints."""
    title = "What came of jblast serve --ground-station"
    return _document(title, schema_of(WatchedAnswer))


def check() -> Schema:
    """Return the schema of what `jblast check --json` prints."""
    return _document("An answer of jblast check", schema_of(CheckAnswer))


def stability() -> Schema:
    """Return the schema of what `jblast stability --json` prints."""
    areas = {"type": "array", "items": schema_of(FailureMode)}
    properties = {"areas": {"type": "object", "additionalProperties": areas}}
    return _document("Failure modes, by jblast stability", _object(properties))


def schema_of(hint: Any) -> Schema:
    """Return the schema of a type: of a dataclass, or of what a field of one holds."""
    if hint in SIMPLE:
        return SIMPLE[hint]
    if is_dataclass(hint) and isinstance(hint, type):
        return WORDED.get(hint, lambda schema: schema)(_of_class(hint))
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return {"anyOf": [schema_of(one) for one in inner]}
    if hint is type(None):
        return NULL
    if origin is Mapping:
        return {"type": "object", "additionalProperties": schema_of(inner[1])}
    if origin is tuple:
        items = {"type": "array", "items": schema_of(inner[0])}
        if inner[1] is ...:
            return items
        return items | {"minItems": len(inner), "maxItems": len(inner)}
    if str(origin) == "typing.Literal":
        return {"enum": list(inner)}
    return {"type": "array", "items": NUMBER}  # an array, by its shape


def _of_class(cls: type) -> Schema:
    """Return the schema of what `json_values.entries` makes of a dataclass."""
    hints = get_type_hints(cls, localns=LAZY)
    told = attributes(cls.__doc__ or "")
    properties: dict[str, Schema] = {}
    others, required = False, []
    for field in fields(cls):
        if field.metadata.get("hidden"):
            continue
        schema = schema_of(hints[field.name])
        held = _without_null(schema)
        if not field.metadata.get("among"):
            is_absent = field.metadata.get("absent")
            one = held if is_absent else schema
            properties[field.name] = one | {"description": told[field.name]}
            required += [] if is_absent else [field.name]
        elif "properties" in held:
            properties |= held["properties"]
            required += held["required"] if held is schema else []
        else:
            others = held["additionalProperties"]
    whole = _object(properties)
    return whole | {"additionalProperties": others, "required": required}


def _without_null(schema: Schema) -> Schema:
    if NULL not in schema.get("anyOf", ()):
        return schema
    held = [one for one in schema["anyOf"] if one != NULL]
    return held[0] if len(held) == 1 else {"anyOf": held}


def _object(properties: dict[str, Schema]) -> Schema:
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _titled(title: str, schema: Schema) -> Schema:
    return {"$schema": DIALECT, "title": title} | schema


def _document(title: str, schema: Schema) -> Schema:
    properties = {"schema": {"const": 1}} | schema["properties"]
    return _titled(title, _object(properties))


def _without(schema: Schema, *names: str) -> dict[str, Schema]:
    return {k: v for k, v in schema["properties"].items() if k not in names}


def _other_mode(schema: Schema) -> Schema:
    words = {"type": "string"}
    told = _without(schema, "differ", "delta_chi2", "cure")
    return _object(told | {"reason": words, "cure": words})


def _combination(schema: Schema) -> Schema:
    told = _object(_without(schema, "is_local"))
    told["properties"]["note"] = {"type": "string"}  # where it holds nearby alone
    return told


def _wrong(schema: Schema) -> Schema:
    told = _object(
        {"kind": {"enum": ["clock", "sensor", "exchange"]}, **schema["properties"]}
    )
    told["properties"] |= {
        "offset_s": NUMBER,
        "offset_sd": NUMBER,
        "parameter": {"type": ["string", "null"]},
        "other": {"type": "string"},
    }
    return told


def _added(schema: Schema) -> Schema:
    told = _without(schema, "sensor", "position", "charge", "is_default", "left")
    return _object(
        told
        | {
            "where": {"type": "string"},
            "position_m": schema["properties"]["position"],
            "charge": {"type": ["string", "null"]},
            "sigma_from": {"enum": ["default", "layout"]},
        }
        | schema["properties"]["left"]["properties"]
    )


WORDED: dict[type, Callable[[Schema], Schema]] = {
    Cure: lambda _: {"type": "string"},
    Finding: lambda _: {"type": "string"},
    TakenLaw: lambda _: {"type": "string"},
    Understood: lambda _: {"type": "string"},
    OtherMode: _other_mode,
    EstimableCombination: _combination,
    WrongSensor: _wrong,
    AddedDatum: _added,
    FailureMode: lambda schema: _object(
        {key: schema["properties"][of] for key, of in FAILURE_KEYS.items()}
    ),
}
"""Entries that a document words otherwise than their class has them."""
