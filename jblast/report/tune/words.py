"""Sentences about what was tuned."""

from jblast.inference.tuning.notes import Note
from jblast.inference.tuning.result import POOR, Tuned
from jblast.inference.tuning.tunables import TUNABLES
from jblast.parameter import Key
from jblast.parameter_table import CLOCK_OFFSET
from jblast.report.words import joined, parameter_words
from jblast.scene import parameter_named

TESTS = {
    "spectrum": "the noise in bands of frequency",
    "whiteness": "likeness of neighbours in what is left",
    "blast": "what is left while the blast goes by",
    "error": "size of what is left",
}
"""What was looked at, in words."""


def words_of(name: str) -> str:
    """Return what a sentence calls a number."""
    return TUNABLES[name].words if name in TUNABLES else parameter_words(name)


def unit_of(name: str) -> str:
    """Return the unit of a number; "1" if it has none."""
    return TUNABLES[name].unit if name in TUNABLES else parameter_named(name).unit


def key_of(name: str) -> Key:
    """Return where a number stands in a scene file."""
    return TUNABLES[name].key if name in TUNABLES else parameter_named(name).key


def key_words(name: str, sensor: str | None) -> str:
    """Return where a number stands in a scene file, as a sentence has it."""
    key, label = key_of(name), name.partition(".")[2]
    index = "" if key.index is None else f"[{key.index}]"
    if key.table == "sensor" and not label:
        label = sensor or ""
    table = f"[[{key.table}]]" if label or key.table == "sensor" else f"[{key.table}]"
    of = f" {label!r}" if label else ""
    if name.startswith(CLOCK_OFFSET):
        return f"[[sensor]]{of} clock_offset_s"
    return f"{table}{of} {key.name}{index}"


def warnings_of(tuned: Tuned) -> list[str]:
    """Return what somebody should know who uses the numbers."""
    found = [_note(note) for note in tuned.notes]
    for direction in tuned.null_directions:
        names = list(direction.parameters)
        if len(names) == 1:
            found.append(f"the record says nothing about {names[0]}")
            continue
        found.append(
            f"the record does not tell {joined(names)} apart: together they change "
            "and leave it as it is; give one of them a value"
        )
    for name, one in tuned.numbers.items():
        if one.prior_decides:
            found.append(f"{name}: the record adds next to nothing to its prior")
        if one.at_bound:
            found.append(
                f"{name} ended at its bound, {one.fitted:.4g} {unit_of(name)}: the "
                "record asks for more than it may be"
            )
    poor = [TESTS[name] for name, p in tuned.explained.tests.items() if p < POOR]
    if tuned.explained.is_poor and not poor:
        poor = [TESTS["error"]]
    if poor:
        found.append(
            f"the record is poorly explained ({'; '.join(poor)}): the intervals count "
            "noise, not what the model lacks, and are too narrow"
        )
    if not tuned.converged:
        found.append("the search did not settle")
    return found


def _note(note: Note) -> str:
    about = note.about
    match note.kind:
        case "reading":
            return str(about["text"])
        case "noise_added":
            return (
                "the scene has no noise: noise_pa is looked for beside what was named"
            )
        case "blast_outside":
            return (
                f"no blast is in the record of {about['seconds']:g} s: it tells of "
                "noise alone"
            )
        case "law_invalid":
            return (
                f"{joined(about['quantities'])} come from laws that were not made for "
                "where the sensor stands"
            )
        case "thinned":
            return (
                f"{about['used']:,} of {about['count']:,} {about['what']} were looked "
                "at, evenly chosen"
            )
