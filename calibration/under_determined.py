"""Do logs that leave something open end with exit code 4 and a sentence?

    python -m calibration.under_determined [--logs 1000] [--workers 2]

Random logs of two kinds are fitted: fewer readings than unknowns, and readings alike.
A worker takes all logs of a kind, since they share its programs, and writes a line as
each ends; begun again, it goes on with those that are missing. When all have ended the
table is written to calibration/results/under_determined.txt.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.inference import Fit, fit
from jblast.observations import Observations
from jblast.report.fit_report import not_identified
from jblast.scene import UncertainScene, default_scene, freed, with_laws

PLACE = ("charge_east_m", "charge_north_m")
TIMED_PLACE = ("origin_time_s", *PLACE)
SPEED = 340.0


class Kind(NamedTuple):
    """Quantities, by how many sensors each, and what is free beside the mass."""

    quantities: tuple[str, ...]
    sensors: int
    free: tuple[str, ...]
    repeats: int = 1
    law: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        what = ", ".join(self.quantities) + f" at {self.sensors}"
        what += f" x {self.repeats}" if self.repeats > 1 else ""
        what += "".join(f" by {law}" for _, law in self.law)
        return what + "; free: " + ", ".join(("charge_mass_kg", *self.free))


ARRIVAL, PRESSURE = ("air_arrival_s",), ("peak_overpressure_pa",)
IMPULSE, BEARING = ("positive_impulse_pa_s",), ("bearing_rad",)
RADIUS = ("fireball_radius_m",)
KINDS = (
    Kind(ARRIVAL, 2, TIMED_PLACE, law=(("air_arrival_s", "kingery_bulmash"),)),
    Kind(PRESSURE, 2, PLACE, law=(("peak_overpressure_pa", "swisdak"),)),
    Kind(BEARING, 1, PLACE),
    Kind(RADIUS, 2, ("origin_time_s",)),
    Kind(ARRIVAL, 1, ("origin_time_s",)),
    Kind(ARRIVAL, 2, TIMED_PLACE),
    Kind(ARRIVAL, 3, TIMED_PLACE),
    Kind(PRESSURE, 1, PLACE),
    Kind(PRESSURE, 2, (*PLACE, "charge_up_m")),
    Kind(IMPULSE, 1, PLACE),
    Kind(IMPULSE, 2, PLACE),
    Kind(BEARING, 3, PLACE),
    Kind(RADIUS, 1, ("origin_time_s",)),
    Kind((*ARRIVAL, *PRESSURE, *IMPULSE), 1, TIMED_PLACE),
    Kind((*BEARING, *ARRIVAL), 1, TIMED_PLACE),
    # as many readings as unknowns, or more, yet all of one place
    Kind((*ARRIVAL, *PRESSURE), 1, TIMED_PLACE, repeats=3),
    Kind(PRESSURE, 1, PLACE, repeats=4),
    Kind(
        *(ARRIVAL, 3, (*TIMED_PLACE, "air_sound_speed_m_s")),
        law=(("air_arrival_s", "wu_hao"),),
    ),
)
SIGMA = {"air_arrival_s": 1e-3, "bearing_rad": 0.02}
SHARE = 0.05


RESULT = Path(__file__).parent / "results" / "under_determined.txt"
AS_ASKED = "ok"


def main() -> None:
    """Fit what is missing, by so many processes, and write the table."""
    parser = argparse.ArgumentParser(description="Fit logs that leave something open.")
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--lines", type=Path, default=Path("out/under_determined.csv"))
    parser.add_argument("--out", type=Path, default=RESULT)
    parser.add_argument("--kind", type=int, help="fit this kind alone, here")
    asked = parser.parse_args()
    if asked.kind is not None:
        fit_kind(asked.kind, asked.logs, asked.seed, asked.lines)
        return
    asked.lines.parent.mkdir(parents=True, exist_ok=True)
    for code in side_by_side(asked.workers):
        if code:
            sys.exit(f"a worker ended with exit code {code}; begin again to go on")
    text = table(read(asked.lines), asked.logs, asked.seed)
    write_text(asked.out, text)
    sys.stdout.write(text)


def side_by_side(workers: int) -> list[int]:
    """Fit each kind in a process of its own, so many at a time; return exit codes."""
    waiting, running, codes = list(range(len(KINDS))), [], []
    while waiting or running:
        while waiting and len(running) < workers:
            kind = str(waiting.pop(0))
            command = [sys.executable, "-m", "calibration.under_determined"]
            command += [*sys.argv[1:], "--kind", kind]
            running.append(subprocess.Popen(command))
        time.sleep(0.5)
        codes += [one.returncode for one in running if one.poll() is not None]
        running = [one for one in running if one.poll() is None]
    return codes


def fit_kind(kind: int, count: int, seed: int, lines: Path) -> None:
    """Fit the logs of a kind that have no line yet, and add their lines."""
    start_jax(quick=True)
    done = read(lines)
    for i, (of, made) in enumerate(logs(count, len(KINDS), seed), start=1):
        if KINDS.index(of) != kind or i in done:
            continue
        begun = time.process_time()
        said = fault(ended(made)).replace("\n", " ") or AS_ASKED
        line = f"{i},{time.process_time() - begun:.2f},{said}\n"
        with lines.open("a") as file:
            file.write(line)
        sys.stdout.write(line)
        sys.stdout.flush()


def read(lines: Path) -> dict[int, tuple[float, str]]:
    """Return processor seconds and end of each log that has a line."""
    if not lines.exists():
        return {}
    rows = [line.split(",", 2) for line in lines.read_text().splitlines()]
    return {int(i): (float(seconds), said) for i, seconds, said in rows}


def table(found: dict[int, tuple[float, str]], count: int, seed: int) -> str:
    """Return how many of each kind end as they should, and which do not."""
    numbers = [i for i in range(1, count + 1) if i in found]
    text = "Under-determined logs: how many end with exit code 4 and a sentence\n\n"
    text += "right   of  median s    most  kind\n"
    for k, kind in enumerate(KINDS):
        of_kind = [found[i] for i in numbers if (i - 1) % len(KINDS) == k]
        text += _row(of_kind, str(kind))
    text += _row([found[i] for i in numbers], "all")
    text += f"\nLogs 1 to {count}, seed {seed}; seconds are the processor's, the most\n"
    text += "with the programs of a kind's first log compiled or read.\n"
    wrong = [f"{i}: {found[i][1]}\n" for i in numbers if found[i][1] != AS_ASKED]
    return text + ("\nNot as asked\n" + "".join(wrong) if wrong else "")


def _row(ends: Sequence[tuple[float, str]], name: str) -> str:
    seconds = [end[0] for end in ends] or [np.nan]
    right = sum(said == AS_ASKED for _, said in ends)
    median, most = np.median(seconds), np.max(seconds)
    return f"{right:5d} {len(ends):4d} {median:9.2f} {most:7.1f}  {name}\n"


def drawn(kind: Kind, rng: np.random.Generator) -> tuple[Observations, UncertainScene]:
    """Draw a log of a kind: its readings no more than plausible, its places any.

    Of four logs one has a charge at a sensor, one has sensors that stand together.
    """
    size = 10 ** rng.uniform(0.5, 3)
    places = rng.uniform(-size, size, (kind.sensors, 3)) * [1, 1, 0]
    charge = rng.uniform(-size, size, 3) * [1, 1, 0]
    case = rng.integers(4)
    if case == 1:
        charge = places[0].copy()
    if case == 2:
        places[:] = places[0]
    mass = 10 ** rng.uniform(-1, 4)
    rows = []
    for i, at in enumerate(places):
        away = charge - at
        r = max(float(np.linalg.norm(away)), 0.3)
        for quantity in kind.quantities:
            for repeat in range(kind.repeats):
                time = 1e-3 * (i + 1) * (repeat + 1) * rng.uniform(0.5, 2)
                value = {
                    "air_arrival_s": 3 + 0.8 * r / SPEED,
                    "peak_overpressure_pa": 1e6 * mass ** (2 / 3) / r**2,
                    "positive_impulse_pa_s": 300 * mass ** (2 / 3) / r,
                    "bearing_rad": float(np.arctan2(away[0], away[1]) % (2 * np.pi)),
                    "fireball_radius_m": 2 * mass ** (1 / 3) * (time / 1e-3) ** 0.4,
                }[quantity]
                sigma = SIGMA.get(quantity)
                error = rng.standard_t(4)
                if sigma is None:
                    sigma = SHARE * value
                    value *= np.exp(SHARE * error)
                else:
                    value += sigma * error
                timed = quantity == "fireball_radius_m"
                seen = 3 + time if timed else np.nan
                rows.append((f"s{i}", quantity, value, sigma, at, seen))
    sensor, quantity, value, sigma, position, time = zip(*rows, strict=True)
    nowhere = ("",) * len(rows)
    observed = Observations(
        sensor=sensor,
        quantity=quantity,
        value=np.array(value),
        sigma=np.array(sigma),
        position=np.array(position),
        slant_range=np.full(len(rows), np.nan),
        time=np.array(time),
        path=nowhere,
        shot=nowhere,
        clock=nowhere,
    )
    asked = freed(with_laws(default_scene(), dict(kind.law)), list(kind.free))
    return observed, asked


def logs(
    count: int, kinds: int, seed: int
) -> Iterator[tuple[Kind, tuple[Observations, UncertainScene]]]:
    """Draw so many logs of the first kinds, in turn."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        kind = KINDS[i % kinds]
        yield kind, drawn(kind, rng)


def ended(made: tuple[Observations, UncertainScene]) -> Fit | Exception:
    """Fit a log; return what ended otherwise too."""
    try:
        return fit(*made)
    except Exception as error:  # what must not be is counted
        return error


def fault(found: Fit | Exception) -> str:
    """Say what is wrong with an end; "" if it is as it should be."""
    if isinstance(found, Exception):
        return f"{type(found).__name__}: {found}"
    answer = found.summary
    if found.exit_code != 4:
        return f"exit code {found.exit_code}"
    least = max(len(answer.free) - len(found.observations), 1)
    if len(answer.null_directions) < least:
        return f"{len(answer.null_directions)} null directions for {least}"
    return "" if not_identified(answer, answer.estimates) else "no sentence"


if __name__ == "__main__":
    main()
