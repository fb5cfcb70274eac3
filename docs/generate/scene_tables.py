"""Tables of the log and of the scene file, from those of their readers."""

from collections.abc import Iterable

from jblast.observations.table import COLUMNS, NEEDED
from jblast.parameters import PARAMETERS, UNBOUNDED, Bounds
from jblast.quantities import ADDITIVE, DERIVED_QUANTITIES, QUANTITIES, TIMED
from jblast.scene.charge import EXPLOSIVES
from jblast.scene.keys import KEYS, SEVERAL, WITHIN, keys_of
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.scene.values import SceneKey
from jblast.units import SUFFIXES


def table(head: str, rows: Iterable[Iterable[object]]) -> str:
    """Return a Markdown table; columns of `head` are separated by |."""
    rule = "|".join("---" for _ in head.split("|"))
    lines = [" | ".join(map(str, row)) for row in rows]
    return "\n".join([f"| {head} |", f"|{rule}|", *(f"| {line} |" for line in lines)])


def code(words: Iterable[str]) -> str:
    """Return words as code, with commas."""
    return ", ".join(f"`{word}`" for word in words)


def required(bounds: Bounds) -> str:
    """Return bounds as text; "" for none."""
    return "" if bounds == UNBOUNDED else bounds.words()


def quantities() -> str:
    """Return the quantities of a log, and the derived quantities of laws."""
    rows = (
        (
            code([name]),
            one.meaning,
            "in its unit" if name in ADDITIVE else "in ln, as a share",
            "`time_s`" if name in TIMED else "",
        )
        for name, one in QUANTITIES.items()
    )
    derived = f"Laws also give {code(DERIVED_QUANTITIES)}: no row holds them."
    head = "quantity | what it is | its error counts | needs"
    return f"{table(head, rows)}\n\n{derived}"


def columns() -> str:
    """Return the columns of a log."""
    further = code(name for name in COLUMNS if name not in NEEDED)
    return f"Needed: {code(NEEDED)}. Known besides: {further}."


def units() -> str:
    """Return the units at the end of names of columns and quantities."""
    made = {
        "impulse": "one of pressure, `_`, one of time: `psi_ms`",
        "speed": "one of length, `_`, one of time: `mm_s`, `mph`, `kmh`, `kn`",
    }
    rows = ((of, made.get(of) or code(endings)) for of, endings in SUFFIXES.items())
    return table("of | endings", rows)


def numbers() -> str:
    """Return every number that may be fixed, free or uncertain."""
    rows = []
    for name, one in PARAMETERS.items():
        index = "" if one.key.index is None else f"[{one.key.index}]"
        key = code([f"[{one.key.table}] {one.key.name}{index}"])
        scale = "ln" if one.positive else "itself"
        bounds = required(one.bounds)
        rows.append((code([name]), one.words, key, bounds, f"{one.default:g}", scale))
    return table(
        "number | is the | key | has to be | a fit starts at | fitted in", rows
    )


def keys() -> str:
    """Return the keys of every table, with their values and relations."""
    rows = []
    for name in KEYS:
        heading = f"[[{name}]]" if name in SEVERAL[1:] else f"[{name}]"
        heading = WITHIN.get(name, heading)
        for key, of in keys_of(name).items():
            others = " or ".join(of.instead)
            relations = [
                "required" * of.needed
                + f" (or {others})" * (of.needed and bool(others)),
                f"instead of {others}" if others and not of.needed else "",
                f"with {' and '.join(of.needs)}" if of.needs else "",
            ]
            rows.append(
                (
                    code([heading]),
                    code([key]),
                    written(of),
                    ", ".join(filter(None, relations)),
                )
            )
    return table("table | key | value | relations", rows)


def written(key: SceneKey) -> str:
    """Return the form of the value of a key."""
    one = getattr(key.value, "of", key.value)
    form, bounds = key.value.form, getattr(one, "bounds", UNBOUNDED)
    each = f", each {bounds.words()}" if bounds != UNBOUNDED else ""
    each = "" if bounds.that_is() in form else each
    return f"{code([form])}{each}" if form[0] in "[{" else f"{form}{each}"


def sensor_kinds() -> str:
    """Return records, perceived quantities and requirements of each kind of sensor."""
    rows = []
    for name, kind in SENSOR_KINDS.items():
        file = f"{kind.file[1:].upper()}: {code(kind.columns)}" if kind.columns else ""
        senses = ", ".join(sense for _, sense in kind.senses)
        carried = "no" if kind.unmounted else "yes"
        rows.append((code([name]), kind.words, file, senses, carried))
    head = "kind | is | samples: file and columns | perceives | on a vehicle"
    return table(head, rows)


def explosives() -> str:
    """Return the TNT equivalents of explosives."""
    rows = (
        (code([name]), *(f"{v:g}" for v in (x.pressure, x.impulse, x.energy)), x.source)
        for name, x in EXPLOSIVES.items()
    )
    head = "explosive | by pressure | by impulse | by energy of the front | source"
    return table(head, rows)
