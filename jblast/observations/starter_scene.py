"""A first scene for a log: what it says already, and what the user may know better."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from jblast.observations.grouping import some_rows
from jblast.observations.starter_earth import (
    air_table,
    clock_tables,
    place_tables,
    toml_text,
)
from jblast.observations.table import (
    CLOCK_TIMES,
    OF_SAMPLES,
    SAMPLES,
    Observations,
)
from jblast.quantities import ADDITIVE, BY_CAMERA, PLACELESS, TIMED, made_with
from jblast.scene.reader.records import share_text

_SEEN_AND_HEARD = {"flash_time_s", "air_arrival_s", "bearing_rad"}
_OF_GROUND = set(made_with("ground_arrival_s"))


def starter_scene(observations: Observations) -> str:
    """Return a commented scene file for a log.

    The mass is free. The place is free too if at least three sensors that do not stand
    in a line, and four rows, can tell it, or a bearing, a flash and an arrival; the
    origin time then if three rows are clock readings, and always if a flash was seen.
    In a log in degrees, or with dates, place and time are always free: its origin, and
    its time zero, mean nothing. Clocks that a flash and a bang set are free.

    Args:
        observations: The log.
    """
    recorders = {
        name
        for name, quantity in zip(
            observations.sensor, observations.quantity, strict=True
        )
        if quantity == SAMPLES
    }
    observations = _readings(observations)
    rows: dict[str, list[int]] = {}
    for row, name in enumerate(observations.sensor):
        rows.setdefault(name, []).append(row)
    logs = [_Log(name, observations, np.array(rows[name])) for name in rows]
    shots = list(dict.fromkeys(observations.shot))
    parts = [
        _head(observations),
        *(_charge(observations, logs, shot) for shot in shots),
        air_table(observations),
        *([_CAMERA] if set(BY_CAMERA) & set(observations.quantity) else []),
        *([_GROUND] if set(observations.quantity) & _OF_GROUND else []),
        *(_sensor(log, sampled=log.name in recorders) for log in logs),
        *clock_tables(observations),
        *place_tables(observations),
        _LAW,
    ]
    return "\n".join(parts)


class _Log:
    """What one sensor wrote down.

    Attributes:
        name: The sensor.
        sigmas: Median sigma by quantity, as `records` wants it; NaN if there is none.
        places: The positions the log gives it, each once.
        ranges: The slant ranges the log gives it, each once.
        needs_distance: Whether any of its rows depends on where it stands.
        times: When it took what has a time, by its clock [s].
    """

    def __init__(self, name: str, observations: Observations, rows: np.ndarray):
        self.name = name
        quantity = np.array([observations.quantity[row] for row in rows])
        value, sigma = observations.value[rows], observations.sigma[rows]
        with np.errstate(over="ignore"):  # what overflows counts as not given
            relative = sigma / np.where(np.isin(quantity, ADDITIVE), 1.0, value)
        given = np.isfinite(relative)
        self.sigmas = {
            q: float(np.median(relative[given & (quantity == q)]))
            if np.any(given & (quantity == q))
            else math.nan
            for q in dict.fromkeys(quantity.tolist())
        }
        places = [tuple(place) for place in observations.position[rows].tolist()]
        self.places = [p for p in dict.fromkeys(places) if not any(map(math.isnan, p))]
        ranges = dict.fromkeys(observations.slant_range[rows].tolist())
        self.ranges = [r for r in ranges if not math.isnan(r)]
        self.needs_distance = bool(np.any(~np.isin(quantity, PLACELESS)))
        timed = np.isin(quantity, TIMED)
        self.times = np.unique(observations.time[rows][timed]).tolist()


def _head(observations: Observations) -> str:
    source = Path(observations.source).name if observations.source else ""
    made_for = f" for {json.dumps(source)}" if source else ""
    return f"""\
# A starter scene{made_for}: say here what you know.
# SI units, metres east, north, up. A number may be fixed (15.0), "free", or a prior:
# {{ lognormal = [median, factor] }}, {{ normal = [mean, sd] }},
# {{ uniform = [lo, hi] }}, {{ loguniform = [lo, hi] }}.
schema = 1
"""


def _charge(observations: Observations, logs: list[_Log], shot: str) -> str:
    logs = [log for log in logs if log.needs_distance]
    lines = ["[charge]"]
    if len(set(observations.shot)) > 1:
        lines = ["[[charge]]", f"name = {toml_text(shot)}  # as the log's shot"]
    quantities = [
        quantity
        for quantity, of in zip(observations.quantity, observations.shot, strict=True)
        if of == shot
    ]
    lines.append('mass_kg = "free"  # of the explosive; or a value, or a prior')
    lines.append('explosive = "TNT"  # or "C4", "ANFO", ...; or tnt_factor = 1.1')
    places = {place for log in logs for place in log.places}
    ranges = {slant_range for log in logs for slant_range in log.ranges}
    seen = places and not ranges and set(quantities) >= _SEEN_AND_HEARD
    free = len(quantities) >= 4 and not ranges and _in_no_line(places)
    on_earth = bool(places) and observations.frame is not None and not ranges
    if free or seen or on_earth:
        lines.append('position_m = ["free", "free", 0.0]  # or where it was')
    elif len(logs) == 1 and len(ranges) == 1:
        lines.append(f"range_m = {ranges.pop()!r}  # as the log says")
    elif len(logs) == 1 and not ranges and not places:
        lines.append('range_m = "free"  # slant range to the one sensor')
    else:
        lines.append("position_m = [0.0, 0.0, 0.0]  # the log cannot tell it")
        lines.append('# position_m = ["free", "free", 0.0]  # or a prior of each')
    clocks = sum(quantity in CLOCK_TIMES for quantity in quantities)
    dated = bool(clocks) and (on_earth or observations.epoch is not None)
    if (free and clocks >= 3) or "flash_time_s" in quantities or dated:
        since = ""
        if observations.epoch is not None:
            since = f", in seconds since {observations.epoch:%Y-%m-%dT%H:%M:%SZ}"
        lines.append(f'time_s = "free"  # on the clock of the sensors{since}')
    else:
        lines.append('time_s = 0.0  # on the clock of the sensors; or "free"')
    lines.append(
        '# burst = "surface"  # or "free-air"; if not said, the height decides'
    )
    return "\n".join(lines) + "\n"


def _in_no_line(places: set[tuple[float, ...]]) -> bool:
    """Return whether at least three places span a plane, seen from above."""
    if len(places) < 3:
        return False
    plan = np.array(sorted(places))[:, :2]
    spread = np.linalg.svd(plan - plan.mean(axis=0), compute_uv=False)
    return bool(spread[1] > 1e-3 * spread[0])


_CAMERA = """\
# [camera]  # that saw fireball_radius_px: it is needed, and the log does not tell it
# position_m = [EAST, NORTH, UP]
# look_at_m = [0.0, 0.0, 0.0]
# width = 1280
# height = 720
# focal_px = 1000.0
"""

_GROUND = """\
[ground]
p_speed_m_s = 5660.0  # granite; "free" or a prior if it was not measured
# path = "thesis"  # to a raised sensor: along the ground, then up as the air shock
"""

_LAW = """\
# [law]
# air_arrival_s = "kingery_bulmash"  # one line a quantity; "auto" chooses
# scatter = true  # false: the laws are exact
"""


def _readings(observations: Observations) -> Observations:
    """Return a log with what is read off records of samples in place of these."""
    sampled = np.isin(observations.quantity, SAMPLES)
    if not sampled.any():
        return observations
    rows = np.repeat(
        np.arange(len(observations)), np.where(sampled, len(OF_SAMPLES), 1)
    )
    quantities = [
        name
        for quantity in observations.quantity
        for name in (OF_SAMPLES if quantity == SAMPLES else (quantity,))
    ]
    return replace(some_rows(observations, rows), quantity=tuple(quantities))


def _sensor(log: _Log, *, sampled: bool) -> str:
    lines = ["[[sensor]]", f"name = {toml_text(log.name)}"]
    if len(log.places) == 1:
        lines.append(f"position_m = [{', '.join(map(repr, log.places[0]))}]")
    elif log.places:
        lines.append("# it moves, so its places are left to the log")
    elif log.needs_distance and not log.ranges:
        lines.append("# position_m = [EAST, NORTH, UP]  # the log does not say")
    records = [
        f"{q} = {f'{s:.3g}' if q in ADDITIVE else share_text(s)}"
        for q, s in log.sigmas.items()
        if s > 0
    ]
    if records:
        listed = ", ".join(records)
        lines.append(
            f"records = {{ {listed} }}  # sigma: s for times, rad for directions, else "
            "relative"
        )
        if log.times and set(TIMED) & {q for q, s in log.sigmas.items() if s > 0}:
            lines.append(f"times_s = {log.times}  # of radii, by its clock")
    if sampled:
        lines.append("# it recorded samples, from which its errors are told, too")
    read_off = OF_SAMPLES if sampled else ()
    silent = [q for q, s in log.sigmas.items() if not s > 0 and q not in read_off]
    if silent:
        lines.append(f"# the log gives no sigma for {', '.join(silent)}")
    return "\n".join(lines) + "\n"
