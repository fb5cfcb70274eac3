"""Tables of the log and of the scene file, from those that their readers go by."""

from jblast.observations.table import COLUMNS, NEEDED
from jblast.parameters import PARAMETERS, UNBOUNDED
from jblast.quantities import ADDITIVE, DERIVED_QUANTITIES, QUANTITIES, TIMED
from jblast.scene.camera import MOUNTS
from jblast.scene.charge import EXPLOSIVES
from jblast.scene.random_blasts import ABOUT, WORLD_NUMBERS
from jblast.scene.reader.tables import (
    GROUND_PATHS,
    KEYS,
    LATER,
    LISTS,
    SATURATIONS,
    VEHICLE_MODELS,
    keys_of,
)
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.units import SUFFIXES


def quantities() -> str:
    """Write what a row of a log may hold, and what laws give besides."""
    rows = []
    for name, one in QUANTITIES.items():
        error = "in its unit" if name in ADDITIVE else "in ln, as a share"
        needs = "`time_s`" if name in TIMED else ""
        rows.append(f"| `{name}` | {one.meaning} | {error} | {needs} |")
    derived = ", ".join(f"`{name}`" for name in DERIVED_QUANTITIES)
    head = ["| quantity | what it is | its error counts | needs |", "|---|---|---|---|"]
    return "\n".join(
        [*head, *rows, "", f"Laws also give {derived}: no row holds them."]
    )


def columns() -> str:
    """Write the columns of a log."""
    needed = ", ".join(f"`{name}`" for name in NEEDED)
    further = ", ".join(f"`{name}`" for name in COLUMNS if name not in NEEDED)
    return f"Needed: {needed}. Known besides: {further}."


def units() -> str:
    """Write the units that names of columns and quantities may end in."""
    made = {
        "impulse": "one of pressure, `_`, one of time: `psi_ms`",
        "speed": "one of length, `_`, one of time: `mm_s`, `mph`, `kmh`, `kn`",
    }
    rows = [
        f"| {of} | {made.get(of) or ', '.join(f'`{unit}`' for unit in endings)} |"
        for of, endings in SUFFIXES.items()
    ]
    return "\n".join(["| of | endings |", "|---|---|", *rows])


def numbers() -> str:
    """Write every number that may be fixed, free or uncertain."""
    rows = []
    for name, one in PARAMETERS.items():
        key, bounds = one.key, one.bounds
        at = key.name if key.index is None else f"{key.name}[{key.index}]"
        rows.append(
            f"| `{name}` | {one.words} | `[{key.table}] {at}` | "
            f"{'' if bounds == UNBOUNDED else bounds.words()} | "
            f"{one.default:g} | {'ln' if one.positive else 'itself'} |"
        )
    head = ["| number | is the | key | has to be | a fit starts at | fitted in |"]
    return "\n".join([*head, "|---|---|---|---|---:|---|", *rows])


def world_numbers() -> str:
    """Write the numbers of random blasts."""
    rows = []
    for key, one in WORLD_NUMBERS.items():
        bounds = "" if one.bounds == UNBOUNDED else one.bounds.words()
        rows.append(f"| `{key}` | {one.words} | {one.unit} | {bounds} |")
    head = ["| key | is the | unit | has to be |", "|---|---|---|---|"]
    return "\n".join([*head, *rows])


def keys_of_tables() -> str:
    """Write the keys of every table."""
    rows = []
    for table in KEYS:
        names = keys_of(table)
        title = f"`[{table}]`" if table else "the file"
        later = ", ".join(f"`{name}`" for name in LATER.get(table, ()))
        rows.append(f"| {title} | {', '.join(f'`{n}`' for n in names)} | {later} |")
    return "\n".join(["| table | keys | not supported yet |", "|---|---|---|", *rows])


def lists() -> str:
    """Write the keys that hold lists."""
    rows = [f"| `{key}` | `{form}` |" for key, form in LISTS.items()]
    return "\n".join(["| key | is written |", "|---|---|", *rows])


def words() -> str:
    """Write the keys that take one of a few words."""
    rows = {
        "`[[sensor]] kind`": tuple(SENSOR_KINDS),
        "`[[sensor]] saturation`": SATURATIONS,
        "`[ground] path`": GROUND_PATHS,
        "`[vehicle] model`": VEHICLE_MODELS,
        "`mount` of a sensor, of the camera": MOUNTS,
        "`[world] about`": ABOUT,
    }
    lines = [
        f"| {key} | {', '.join(f'`{w}`' for w in ws)} |" for key, ws in rows.items()
    ]
    return "\n".join(["| key | one of |", "|---|---|", *lines])


def sensor_kinds() -> str:
    """Write what each kind of sensor records, perceives and needs."""
    rows = []
    for name, kind in SENSOR_KINDS.items():
        columns = ", ".join(f"`{column}`" for column in kind.columns)
        file = f"{kind.file[1:].upper()}: {columns}" if columns else ""
        senses = ", ".join(sense for _, sense in kind.senses)
        carried = "no" if kind.unmounted else "yes"
        rows.append(f"| `{name}` | {kind.words} | {file} | {senses} | {carried} |")
    head = "| kind | is | samples: file and columns | perceives | on a vehicle |"
    return "\n".join([head, "|---|---|---|---|---|", *rows])


def explosives() -> str:
    """Write what explosives are worth in TNT."""
    rows = [
        f"| `{name}` | {x.pressure:g} | {x.impulse:g} | {x.energy:g} | {x.source} |"
        for name, x in EXPLOSIVES.items()
    ]
    head = "| explosive | by pressure | by impulse | by energy of the front | source |"
    return "\n".join([head, "|---|---:|---:|---:|---|", *rows])
