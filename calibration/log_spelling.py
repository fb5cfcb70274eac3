"""Random logs, and random ways in which other programs would write them down.

Factors between units are their definitions, written here again, so that what reads them
is held against something else than itself.
"""

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

PSI = 4.4482216152605 / 0.0254**2
UNITS = {
    "pressure": {"pa": 1, "kpa": 1e3, "psi": PSI, "mbar": 1e2, "bar": 1e5, "MPa": 1e6},
    "impulse": {"pa_s": 1, "kpa_ms": 1, "psi_ms": PSI / 1e3, "bar_ms": 1e2},
    "time": {"s": 1, "ms": 1e-3, "us": 1e-6, "min": 60},
    "length": {"m": 1, "ft": 0.3048, "km": 1e3, "in": 0.0254, "cm": 1e-2},
    "speed": {"m_s": 1, "mm_s": 1e-3, "in_s": 0.0254},
    "angle": {"rad": 1, "deg": math.pi / 180},
}
QUANTITIES = {
    "air_arrival": ("time", "s", (1e-2, 100)),
    "positive_duration": ("time", "s", (1e-4, 1)),
    "peak_overpressure": ("pressure", "pa", (1, 1e7)),
    "reflected_pressure": ("pressure", "pa", (1, 1e7)),
    "positive_impulse": ("impulse", "pa_s", (0.1, 1e5)),
    "ground_peak_velocity": ("speed", "m_s", (1e-6, 1)),
    "bearing": ("angle", "rad", (1e-3, 6.28)),
    "shock_radius": ("length", "m", (0.1, 1e3)),
}
"""By word: dimension, our unit, and between what values lie."""
ADDITIVE = ("air_arrival", "bearing")
TEXTS = {"comma": ",", "semicolon": ";", "tab": "\t"}
FORMATS = ("text",) * 7 + ("xlsx", "ods", "parquet")
EPOCH = datetime(2026, 3, 1, 12, tzinfo=UTC)


@dataclass
class Log:
    """A log as it is, and as it was written.

    Attributes:
        quantity: Ours, by row, without the row that holds no value.
        value: In SI [row].
        sigma: In SI, NaN where none [row].
        time: Clock times of radii [row].
        metres: East, north, up, or the range, in metres [row ...]; or
        degrees: latitude, longitude [rad] and height [m] [row 3].
        seconds: Clock times since `EPOCH` where they were written as dates [row].
        ways: What was drawn: format, separator, ...
    """

    quantity: list[str]
    value: np.ndarray
    sigma: np.ndarray
    time: np.ndarray
    metres: np.ndarray | None = None
    degrees: np.ndarray | None = None
    seconds: np.ndarray | None = None
    ways: dict[str, str] = field(default_factory=dict)


def written_log(path: Path, rng: np.random.Generator) -> tuple[Log, Path]:
    """Draw a log, write it in a random way, and return it with its file."""
    n = int(rng.integers(1, 13))
    words = rng.choice(list(QUANTITIES), n)
    by_column = bool(rng.random() < 0.15)
    if by_column:
        words = np.full(n, words[0])
    elif rng.random() < 0.15:  # clock times alone, which may be dates
        words = np.full(n, "air_arrival")
    log = _drawn(words, rng)
    columns: dict[str, list[Any]] = {"sensor": [f"s{i % 5}" for i in range(n)]}
    _measurements(columns, log, words, rng, by_column=by_column)
    _places(columns, log, rng)
    if not np.isnan(log.time).all():
        unit = _pick(rng, UNITS["time"])
        times = log.time / UNITS["time"][unit]
        columns[_header(rng, "time", unit)] = times.tolist()
    if rng.random() < 0.3:
        columns["Note"] = ["by hand, windy"] * n
    frame = pd.DataFrame(columns)
    if rng.random() < 0.3:  # a row in which nothing was measured
        empty = frame.iloc[:1].copy()
        for name in frame.columns:
            if name.strip().lower().startswith("value"):
                empty[name] = np.nan
        at = int(rng.integers(0, n + 1))
        parts = [frame.iloc[:at], empty, frame.iloc[at:]]
        frame = pd.concat(parts, ignore_index=True)
    return log, _saved(frame, path, log, rng)


def _drawn(words: np.ndarray, rng: np.random.Generator) -> Log:
    n = len(words)
    ends = np.log([QUANTITIES[word][2] for word in words])
    value = np.exp(rng.uniform(*ends.T))
    share = np.where(rng.random(n) < 0.2, np.nan, rng.uniform(0.01, 0.2, n))
    time = np.where(words == "shock_radius", rng.uniform(1e-4, 1, n), np.nan)
    quantity = [f"{word}_{QUANTITIES[word][1]}" for word in words]
    return Log(quantity, value, share * value, time)


def _measurements(
    columns: dict[str, list[Any]],
    log: Log,
    words: np.ndarray,
    rng: np.random.Generator,
    *,
    by_column: bool,
) -> None:
    """Write what was measured: the unit at the quantity, or at the column."""
    units = {word: _pick(rng, UNITS[QUANTITIES[word][0]]) for word in set(words)}
    level = not by_column and rng.random() < 0.2
    factor = np.array([UNITS[QUANTITIES[w][0]][units[w]] for w in words], float)
    value, sigma = log.value / factor, log.sigma / factor
    names = [_header(rng, word, units[word]) for word in words]
    utc = set(words) == {"air_arrival"} and not by_column and rng.random() < 0.5
    if level:
        of = words == "peak_overpressure"
        value = np.where(of, 20 * np.log10(log.value / 20e-6), value)
        sigma = np.where(of, log.sigma / log.value * 20 / math.log(10), sigma)
        for row in np.flatnonzero(of):
            names[row] = _header(rng, "peak_level", "db")
    log.ways["units"] = "level" if level else "column" if by_column else "quantity"
    if by_column:
        columns["quantity"] = [words[0]] * len(words)
        columns[_header(rng, "value", units[words[0]])] = value.tolist()
    elif utc:
        log.ways["units"] = "utc"
        microseconds = np.round(log.value * 1e6).astype(int)
        log.seconds = microseconds / 1e6
        when = [EPOCH + timedelta(microseconds=int(t)) for t in microseconds]
        columns["quantity"] = ["air_arrival_s"] * len(words)
        zone = timezone(timedelta(hours=int(rng.integers(-11, 13))))
        columns["value_utc"] = [t.astimezone(zone).isoformat() for t in when]
        sigma = log.sigma
    else:
        columns["quantity"], columns["value"] = names, value.tolist()
    if not set(words) & set(ADDITIVE) and rng.random() < 0.3:
        log.ways["sigma"] = "percent"
        columns["Sigma (%)"] = (log.sigma / log.value * 100).tolist()
    else:
        log.ways["sigma"] = "of the value"
        columns["sigma"] = sigma.tolist()


def _places(columns: dict[str, list[Any]], log: Log, rng: np.random.Generator) -> None:
    n, kind = len(log.value), _pick(rng, ("enu", "range", "degrees", "none"))
    log.ways["places"] = kind
    unit = _pick(rng, UNITS["length"])
    factor = UNITS["length"][unit]
    if kind == "enu":
        log.metres = rng.normal(0, 1e3, (n, 3))
        for name, held in zip(("east", "north", "up"), log.metres.T, strict=True):
            columns[_header(rng, name, unit)] = (held / factor).tolist()
        if rng.random() < 0.2:
            columns.popitem()
            log.metres[:, 2] = 0.0
    elif kind == "range":
        log.metres = np.exp(rng.uniform(0, 9, n))
        columns[_header(rng, "range", unit)] = (log.metres / factor).tolist()
    elif kind == "degrees":
        middle = rng.uniform((-80, -179), (80, 179))
        lat, lon = (middle + rng.normal(0, 0.01, (n, 2))).T
        alt = rng.uniform(0, 500, n)
        columns |= {"lat_deg": lat.tolist(), "lon_deg": lon.tolist()}
        columns[_header(rng, "alt", unit)] = (alt / factor).tolist()
        log.degrees = np.stack([np.radians(lat), np.radians(lon), alt], axis=1)


def _saved(frame: pd.DataFrame, path: Path, log: Log, rng: np.random.Generator) -> Path:
    """Write a frame by pandas, in a random format."""
    kind = log.ways["format"] = _pick(rng, FORMATS)
    if kind == "text":
        separator, decimal = _pick(rng, TEXTS), _pick(rng, ".,")
        encoding = _pick(rng, ("utf-8", "utf-8-sig", "utf-16"))
        log.ways |= {"separator": separator, "encoding": encoding}
        log.ways["decimal"] = {".": "point", ",": "comma"}[decimal]
        path = path.with_suffix(".csv")
        frame.to_csv(
            path,
            index=False,
            sep=TEXTS[separator],
            decimal=decimal,
            encoding=encoding,
            lineterminator=_pick(rng, ("\n", "\r\n")),
            na_rep=_pick(rng, ("", "NA", "NaN")),
        )
        return path
    path = path.with_suffix(f".{kind}")
    if kind == "parquet":
        frame.to_parquet(path, index=False)
    else:
        engine: Any = {"xlsx": "openpyxl", "ods": "odf"}[kind]
        frame.to_excel(path, index=False, engine=engine)
    return path


def _header(rng: np.random.Generator, word: str, unit: str) -> str:
    """Return a name with its unit, in one of a few styles."""
    style = rng.integers(4)
    shown = unit.replace("_", "\u00b7") if unit in UNITS["impulse"] else unit
    shown = shown.replace("_", "/")
    if style == 0 and unit != "MPa":
        return f"{word}_{unit}".upper()
    if style == 1:
        return f" {word.replace('_', ' ').capitalize()} ({shown})"
    if style == 2:
        return f"{word.replace('_', ' ').title()}\u00a0[{shown}]"
    return f"{word}_{unit}"


def _pick(rng: np.random.Generator, among: Any) -> str:
    """Draw one."""
    return list(among)[int(rng.integers(len(among)))]
