"""Six phone clips of a charge: does `jblast fit FILE` lead to an answer that holds?

    python -m calibration.six_clips > calibration/results/six_clips.txt
    python -m calibration.six_clips example > calibration/data/six_clips.csv

200 logs are simulated as people have them: six clips, each with a flash and a bang by
the clock of its phone, which is off by up to ten minutes, two with a peak besides;
places in degrees, times of day in a file with semicolons and decimal commas. The charge
(20 to 2,000 kg, evenly in ln) and the phones (200 to 700 m from the middle) stand
anywhere. A flash is seen in frames, 30 a second, so its error is even within one (sd
9.6 ms); a bang is read to 2 ms and a peak to 20 %, Student-t errors; the laws scatter
as the fit takes them to. Each log is fitted as a user would type it: first the file
alone, then with what the refusal asks for.
"""

import sys
import tempfile
from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path

import jax
import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.errors import InputError
from jblast.inference import fit
from jblast.inference.fitting.fit import Fit
from jblast.observations import Observations, read
from jblast.observations.places import Frame
from jblast.scene import Charge, Scene, Sensor, UncertainScene
from jblast.sensors.simulated_readings import simulate

LOGS = 200
FRAME = 1 / 30
"""Between two frames of a clip [s]."""
ORIGIN = Frame(33.9, 35.5, 20.0)
NOON = datetime(2024, 5, 17, 12, tzinfo=UTC)
DATE, ZONE = "2024-05-17", "UTC"
REFERENCE = 20e-6
"""Of a level [Pa]."""
LOUD = (1, 4)
"""Clips whose peak is known."""
HEADER = "sensor;quantity;value_utc;value;sigma;lat_deg;lon_deg;alt_m;clock"
EXAMPLE = f"""\
# SIMULATED, not measured: python -m calibration.six_clips example
# Six phone clips of one charge: flash and bang by each phone's own clock, two levels.
# Times of day of {DATE}, {ZONE}. East and north about {ORIGIN.lat_deg} N,
# {ORIGIN.lon_deg} E; the origin time is on the clock of clip_1, since 12:00.
"""
TOLD = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")


def drawn(seed: int) -> tuple[str, dict[str, float]]:
    """Return a log as a user has it, and what is true of it, about `ORIGIN`.

    The origin time is that on the clock of the first clip, in seconds since `NOON`.
    """
    rng = np.random.default_rng(seed)
    mass = float(np.exp(rng.uniform(np.log(20.0), np.log(2000.0))))
    east, north = (float(x) for x in rng.uniform(-150.0, 150.0, 2))
    turn = (np.arange(6) + rng.uniform(-0.4, 0.4, 6)) * np.pi / 3
    away = rng.uniform(200.0, 700.0, 6)
    offsets = rng.uniform(-600.0, 600.0, 6)
    sensors = tuple(
        Sensor(
            f"clip_{number + 1}",
            np.array([r * np.sin(a), r * np.cos(a), 0.0]),
            records=(("flash_time_s", 1e-6), ("air_arrival_s", 2e-3))
            + ((("peak_overpressure_pa", 0.2),) if number in LOUD else ()),
        )
        for number, (r, a) in enumerate(zip(away, turn, strict=True))
    )
    scene = Scene(
        Charge(mass_kg=mass, position_m=(east, north, 0.0), time_s=5.0), sensors=sensors
    )
    log = simulate(UncertainScene(scene), seed)
    lines = [HEADER]
    for row, sensor in enumerate(log.sensor):
        quantity = log.quantity[row]
        number = int(sensor.removeprefix("clip_")) - 1
        value, sigma, when = float(log.value[row]), float(log.sigma[row]), ""
        if quantity == "flash_time_s":
            value += float(rng.uniform(-0.5, 0.5)) * FRAME
            sigma = FRAME / 12**0.5
        if quantity == "peak_overpressure_pa":
            quantity = "peak_level_db"
            told = f"{20.0 * np.log10(value / REFERENCE):.1f}"
            sigma *= 20.0 / np.log(10.0) / value
        else:
            told, moment = "", NOON + timedelta(seconds=value + offsets[number])
            when = moment.strftime("%H:%M:%S.%f")[:12]
        lat, lon, alt = ORIGIN.to_geodetic(log.position[row])
        place = f"{lat:.6f};{lon:.6f};{alt:.1f}"
        fields = f"{sensor};{quantity};{when};{told};{sigma:.4f};{place};{sensor}"
        lines.append(fields.replace(".", ","))
    truth = (mass, east, north, 5.0 + float(offsets[0]))
    return "\n".join(lines) + "\n", dict(zip(TOLD, truth, strict=True))


def typed(path: Path) -> tuple[int, Observations, Fit]:
    """Return after how many commands there is an answer, the log, and the answer.

    Raises:
        RuntimeError: A refusal does not name what to type next.
    """
    try:
        log, commands = read(path), 1
    except InputError as refusal:
        if not all(word in str(refusal) for word in ("date", "zone")):
            raise RuntimeError(str(refusal)) from refusal
        log, commands = read(path, date=DATE, zone=ZONE), 2
    return commands, log, fit(log)


def true_there(truth: dict[str, float], log: Observations) -> dict[str, float]:
    """Return the truth about the origin, and since the epoch, of the log as read."""
    if log.frame is None or log.epoch is None:
        raise RuntimeError("the log lost its places or times")
    east, north = truth["charge_east_m"], truth["charge_north_m"]
    place = ORIGIN.to_geodetic(np.array([east, north, 0.0]))
    east, north, _ = log.frame.to_enu(*place)
    later = (log.epoch - NOON).total_seconds()
    time = truth["origin_time_s"] - later
    numbers = (truth["charge_mass_kg"], float(east), float(north), time)
    return dict(zip(TOLD, numbers, strict=True))


def main(count: int = LOGS) -> None:
    """Print the table."""
    held = {name: 0 for name in TOLD}
    commands: Counter[str] = Counter()
    off, sizes = [], []
    for seed in range(count):
        text, truth = drawn(seed)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "six_clips.csv"
            path.write_text(text)
            number, log, answer = typed(path)
        there, found = true_there(truth, log), answer.summary.estimates
        answered = "answered" if answer.exit_code == 0 else "with a doubt"
        commands[f"{number} commands, {answered}"] += 1
        for name in TOLD:
            held[name] += found[name].q05 <= there[name] <= found[name].q95
        mass = found["charge_mass_kg"]
        off.append(abs(np.log(mass.value / there["charge_mass_kg"])))
        east, north = (found[name].value - there[name] for name in TOLD[1:3])
        sizes.append((float(np.hypot(east, north)), np.log(mass.q95 / mass.q05) / 2))
        print(seed, number, answer.exit_code, f"{off[-1]:.2f}", file=sys.stderr)
        if not (seed + 1) % 50:
            jax.clear_caches()
    error, width = np.array(sizes).T
    worst = int(np.argmax(off))
    print(f"of {count} logs, how many were answered after how many commands")
    for words, times in sorted(commands.items()):
        print(f"{words:32s}{times:6d}")
    print("\nshare whose 90 % interval holds the truth (+- 0.02 by chance)")
    for name, times in held.items():
        print(f"{name:32s}{times / count:6.3f}")
    median, most = np.median(error), error.max()
    print(f"\nplace, median and largest error [m]  {median:6.1f}{most:8.1f}")
    print(f"mass, median factor of the interval  {np.exp(np.median(width)):6.2f}")
    print(f"worst mass: log {worst}, off by a factor of {np.exp(off[worst]):.2f}")


if __name__ == "__main__":
    start_jax()
    if sys.argv[1:] == ["example"]:
        text, truth = drawn(0)
        sys.stdout.write(
            EXAMPLE
            + "".join(
                f"# truth: {name} = {value:.6g}\n" for name, value in truth.items()
            )
            + text
        )
    else:
        main(*map(int, sys.argv[1:]))
