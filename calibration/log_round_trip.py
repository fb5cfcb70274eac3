"""Random logs in random units and dialects, written by pandas: are they read back?

    python -m calibration.log_round_trip > calibration/results/log_round_trip.txt

10,000 logs of 1 to 12 rows (`calibration/log_spelling.py`), seed 20: quantities in SI
or other units, named at the quantity or at the column; levels in dB; errors in the unit
of the value or per cent; places in metres, feet and the like, as ranges, in degrees, or
none; clock times as seconds or as dates in any zone; rows of nothing and notes between.
Seven in ten are text (three separators, decimal points and commas, three encodings, two
line ends), the rest .xlsx, .ods and Parquet. The factors are definitions written down a
second time; places in degrees are compared by the distances between sensors, through
geocentric coordinates of WGS84 written out here. A log that can be read two ways has to
be refused; that it can is asked of its text.
"""

import re
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from calibration.log_spelling import EPOCH, Log, written_log
from jblast.errors import InputError
from jblast.observations import Observations, read

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


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
