"""The keys of answers as tables, from their schemas."""

from collections.abc import Mapping
from typing import Any

from docs.generate import answer_schemas


def fit() -> str:
    """Write the keys of a fit's answer."""
    return keys_of(answer_schemas.fit())


def pick() -> str:
    """Write the keys of what was picked."""
    return keys_of(answer_schemas.pick())


def one_pick() -> str:
    """Write the keys of one pick."""
    return keys_of(answer_schemas.pick()["properties"]["picks"]["items"])


def bound() -> str:
    """Write the keys of a bound's answer."""
    return keys_of(answer_schemas.bound())


def study() -> str:
    """Write the keys of a run of a study."""
    return keys_of(answer_schemas.study())


def one_outcome() -> str:
    """Write the keys of one of its outcomes."""
    return keys_of(answer_schemas.study()["properties"]["outcomes"]["items"])


def choose() -> str:
    """Write the keys of a choice."""
    return keys_of(answer_schemas.choose())


def calc() -> str:
    """Write the keys of a calculation."""
    return keys_of(answer_schemas.calc())


def calc_inputs() -> str:
    """Write the keys of what a calculation was made with."""
    return keys_of(answer_schemas.calc()["properties"]["inputs"])


def detect_film() -> str:
    """Write the keys of what was seen in a film."""
    return keys_of(answer_schemas.detect_film())


def one_flash() -> str:
    """Write the keys of one flash."""
    return keys_of(answer_schemas.detect_film()["properties"]["flashes"]["items"])


def render() -> str:
    """Write the keys of a film."""
    return keys_of(answer_schemas.render())


def events() -> str:
    """Write the keys of the events of frames."""
    return keys_of(answer_schemas.events())


def discover() -> str:
    """Write the keys of a discovery."""
    return keys_of(answer_schemas.discover())


def fly() -> str:
    """Write the keys of flights."""
    return keys_of(answer_schemas.fly())


def fly_mission() -> str:
    """Write the keys of a mission."""
    return keys_of(answer_schemas.fly_mission())


def tune() -> str:
    """Write the keys of what was tuned."""
    return keys_of(answer_schemas.tune())


def one_tuned() -> str:
    """Write the keys of one number that was tuned."""
    estimates = answer_schemas.tune()["properties"]["estimates"]
    return keys_of(estimates["additionalProperties"])


def tune_gains() -> str:
    """Write the keys of tuned gains."""
    return keys_of(answer_schemas.tune_gains())


def tried_gains() -> str:
    """Write the keys of a hold with some gains."""
    return keys_of(answer_schemas.tune_gains()["properties"]["after"])


def world() -> str:
    """Write the keys of a world."""
    return keys_of(answer_schemas.world())


def study_report() -> str:
    """Write the keys of a report on a study."""
    return keys_of(answer_schemas.study_report())


def study_report_outcome() -> str:
    """Write the keys of one outcome of such a report."""
    return keys_of(answer_schemas.study_report()["properties"]["outcomes"]["items"])


def study_report_shares() -> str:
    """Write the keys of what an outcome's scatter comes from."""
    return keys_of(answer_schemas.study_report()["properties"]["sensitivity"]["items"])


def study_report_input() -> str:
    """Write the keys of one number of these."""
    told = answer_schemas.study_report()["properties"]["sensitivity"]["items"]
    return keys_of(told["properties"]["numbers"]["items"])


def serve() -> str:
    """Write the keys of what came of a server."""
    return keys_of(answer_schemas.serve())


def serve_mavlink() -> str:
    """Write the keys of what came of a flight with an autopilot."""
    return keys_of(answer_schemas.serve_mavlink())


def serve_ground_station() -> str:
    """Write the keys of what came of serving a ground station."""
    return keys_of(answer_schemas.serve_ground_station())


def check() -> str:
    """Write the keys of a check's answer."""
    return keys_of(answer_schemas.check())


def stability() -> str:
    """Write the keys of each failure mode."""
    areas = answer_schemas.stability()["properties"]["areas"]
    return keys_of(areas["additionalProperties"]["items"])


def keys_of(schema: Mapping[str, Any]) -> str:
    """Write a row for each key: what it holds, and the keys of what it holds."""
    rows = []
    for key, value in schema["properties"].items():
        if key == "schema":
            rows.append("| `schema` | 1 |")
            continue
        told = value.get("description", "").rstrip(".")
        rows.append(f"| `{key}` | {'; '.join(filter(None, [told, _within(value)]))} |")
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
