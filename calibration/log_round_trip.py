"""Random logs in random units and dialects, written by pandas: are they read back?

    python -m calibration.log_round_trip > calibration/results/log_round_trip.txt

10,000 logs of 1 to 12 rows, seed 20: quantities in SI
or other units, named at the quantity or at the column; levels in dB; errors in the unit
of the value or per cent; places in metres, feet and the like, as ranges, in degrees, or
none; clock times as seconds or as dates in any zone; rows of nothing and notes between.
Seven in ten are text (three separators, decimal points and commas, three encodings, two
line ends), the rest .xlsx, .ods and Parquet. The factors are definitions written down a
second time; places in degrees are compared by the distances between sensors, through
geocentric coordinates of WGS84 written out here. A log that can be read two ways has to
be refused; that it can is asked of its text.
"""

import math
import re
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jblast.errors import InputError
from jblast.observations import Observations, read

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


LOGS, SEED = 10_000, 20
KINDS = ("value", "sigma", "place_m", "time_s")
ALLOWED = {"value": 1e-12, "sigma": 1e-12, "place_m": 1e-6, "time_s": 1e-6}
SEMI_MAJOR_M, FLATTENING = 6378137.0, 1 / 298.257223563
"""Of WGS84 (NGA.STND.0036, table 3.1)."""
ONE_WAY = re.compile(
    r"(?<![\d.,])(0?[.,]\d|\d+[.,]\d{1,2}(?!\d)|\d+[.,]\d{4}|\d{4,}[.,])"
)
"""A number whose mark can be nothing but that of decimals."""


def errors(log: Log, got: Observations) -> Iterator[tuple[str, float]]:
    """Yield by how much a log that was read back is off, by kind."""
    assert list(got.quantity) == log.quantity, (got.quantity, log.quantity)
    if log.seconds is None:
        yield "value", float(np.max(np.abs(got.value / log.value - 1)))
        arrivals = np.array([name == "air_arrival_s" for name in log.quantity])
        yield (
            "time_s",
            float(np.max(np.abs(got.value - log.value)[arrivals], initial=0)),
        )
    else:
        assert got.epoch is not None
        ours = got.value + (got.epoch - EPOCH).total_seconds()
        yield "time_s", float(np.max(np.abs(ours - log.seconds)))
    np.testing.assert_array_equal(np.isnan(got.sigma), np.isnan(log.sigma))
    share = np.nan_to_num(got.sigma / log.sigma - 1)
    yield "sigma", float(np.max(np.abs(share)))
    np.testing.assert_array_equal(np.isnan(got.time), np.isnan(log.time))
    yield "time_s", float(np.max(np.abs(np.nan_to_num(got.time - log.time))))
    if log.degrees is not None:
        apart = _distances(_geocentric(log.degrees)) - _distances(got.position)
        yield "place_m", float(np.max(np.abs(apart)))
    elif log.metres is not None:
        ours = got.slant_range if log.metres.ndim == 1 else got.position
        yield "place_m", float(np.max(np.abs(ours - log.metres)))


def _geocentric(places: np.ndarray) -> np.ndarray:
    """Return geocentric coordinates of latitude, longitude [rad] and height [m]."""
    lat, lon, alt = places.T
    eccentricity = FLATTENING * (2 - FLATTENING)
    normal = SEMI_MAJOR_M / np.sqrt(1 - eccentricity * np.sin(lat) ** 2)
    ring = (normal + alt) * np.cos(lat)
    up = (normal * (1 - eccentricity) + alt) * np.sin(lat)
    return np.stack([ring * np.cos(lon), ring * np.sin(lon), up], axis=1)


def _distances(places: np.ndarray) -> np.ndarray:
    return np.linalg.norm(places[:, None] - places[None], axis=-1)


def round_trips(logs: int, seed: int = SEED) -> Iterator[tuple[Log, dict[str, float]]]:
    """Yield each log with how far it is off; empty if it was rightly refused.

    Raises:
        InputError: A log that can be read one way only was refused.
    """
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(logs):
            log, path = written_log(Path(folder) / "log", rng)
            worst: dict[str, float] = defaultdict(float)
            try:
                for kind, error in errors(log, read(path)):
                    worst[kind] = max(worst[kind], error)
            except InputError as refused:
                text = path.read_text(log.ways.get("encoding", "utf-8"))
                if "may be" not in str(refused) or ONE_WAY.search(text):
                    raise
            yield log, worst


def main(logs: int = LOGS) -> None:
    """Print how far logs are off by way of writing, the worst of each."""
    worst: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    count: Counter[str] = Counter()
    refused = 0
    for done, (log, off) in enumerate(round_trips(logs), start=1):
        refused += not off
        for way in ("all", *(f"{k}: {v}" for k, v in sorted(log.ways.items()))):
            count[way] += 1
            for kind, error in off.items():
                worst[way][kind] = max(worst[way][kind], error)
        if not done % 500:
            print(done, "of", logs, file=sys.stderr, flush=True)
    print(f"{logs:,} logs; {refused} can be read two ways and were refused as such")
    print("largest error: relative of values and sigmas, of places in m, times in s\n")
    print(f"{'':24}{'logs':>7}" + "".join(f"{kind:>11}" for kind in KINDS))
    for way in sorted(count, key=lambda way: (way != "all", way)):
        cells = "".join(f"{worst[way].get(kind, 0.0):11.1e}" for kind in KINDS)
        print(f"{way:24}{count[way]:7}{cells}")
    print(f"{'allowed':24}{'':7}" + "".join(f"{ALLOWED[k]:11.1e}" for k in KINDS))


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


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
