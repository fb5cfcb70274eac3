"""How often `jblast check` doubts an honest log, and how often it names a slip.

1,000 honest logs and 500 with one slip each, simulated by Kinney and Graham's laws,
which the check does not use, and half of them by weak shocks, which it does. Scatter is
as declared (arrivals 1 % a shot and 1 % a record, pressures, impulses and durations
10 % and 10 %), wind blows up to 12 m/s, air has -10 to 35 C, and nobody wrote that
down. Three to twelve sensors, charges of 0.1 kg to 30 t, scaled distances of 1.5 to 500
m/kg^(1/3); the charge at the origin without a scene, at a place that a scene frees, or
ranges alone. East and north swapped leave the range from the origin as it was.

    python -m calibration.check_logs        # writes calibration/results/check_logs.txt
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np

from jblast.files import write_text
from jblast.inference.sanity import doubts
from jblast.observations import Observations, observed
from jblast.observations.places import Frame
from jblast.scene import UncertainScene, default_scene, freed
from jblast.sensors.calculator import Rows, by_law

SEED, HONEST, SLIPPED = 20, 1000, 500
TITLE = "How often an honest log is doubted, and a slip is named"
RESULT = Path(__file__).parent / "results" / "check_logs.txt"
MEASURED = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_impulse_pa_s",
    "positive_duration_s",
)
FRAME = Frame(33.9, 35.5, 10.0)
GRID = np.geomspace(0.5, 3000.0, 600)
THIRD = {"air_arrival_s", "positive_impulse_pa_s", "positive_duration_s"}


@dataclass(frozen=True)
class Case:
    """A log, what is known of the scene, and what a slip was made in.

    Attributes:
        kind: How the charge is known: "origin", "free place" or "ranges".
        log: The log.
        scene: The scene that it is checked beside.
    """

    kind: str
    log: Observations
    scene: UncertainScene


def tables() -> dict[tuple[str, str], np.ndarray]:
    """Return ln of each quantity of 1 kg along `GRID` by two families of laws."""
    names = [
        (q, law) for law in ("kinney_graham", "shock_kinematics") for q in MEASURED
    ]
    scene = default_scene().scene
    scene = replace(scene, charges=(replace(scene.charge, burst="surface"),))
    rows = Rows(scene, GRID, np.ones_like(GRID))
    return {(q, name): np.log(by_law(rows, q)[name].value) for q, name in names}


def honest(rng: np.random.Generator, laws: dict[tuple[str, str], np.ndarray]) -> Case:
    """Draw an honest log."""
    kind = str(rng.choice(["origin", "free place", "ranges"]))
    count = int(rng.integers(3, 13))
    mass = float(np.exp(rng.uniform(np.log(0.1), np.log(3e4))))
    scaled = np.exp(rng.uniform(np.log(2.0), np.log(300.0)))
    z = np.clip(scaled * np.exp(rng.normal(0, 0.5, count)), 1.5, 500.0)
    ranges = z * np.cbrt(mass)
    azimuth = rng.uniform(0, 2 * np.pi, count)
    charge = np.zeros(3)
    if kind == "free place":
        charge = np.array([*rng.uniform(-1, 1, 2) * np.median(ranges), 0.0])
    way = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    position = charge + ranges[:, None] * way
    family = str(rng.choice(["kinney_graham", "shock_kinematics"]))
    some = [q for q in MEASURED if rng.random() < 0.6] or [str(rng.choice(MEASURED))]
    origin = 0.0 if kind != "free place" else float(rng.uniform(0, 100))
    wind = rng.uniform(0, 12) * way[:, 0] * rng.choice([-1, 1])
    speed = np.sqrt(rng.uniform(263.0, 308.0) / 288.15) * 340.3
    rows = []
    for quantity in some:
        sd = 0.01 if quantity == "air_arrival_s" else 0.10
        shot = rng.normal(0, sd)
        table = laws[quantity, family]
        for i in range(count):
            if rng.random() < 0.1:
                continue  # a sensor that missed it
            ln = np.interp(np.log(z[i]), np.log(GRID), table)
            ln += np.log(mass) / 3 if quantity in THIRD else 0.0
            value = float(np.exp(ln + shot + rng.normal(0, sd)))
            if quantity == "air_arrival_s":
                sigma = float(np.exp(rng.uniform(np.log(1e-5), np.log(1e-2))))
                value = (
                    origin + value * 340.3 / (speed + wind[i]) + rng.normal(0, sigma)
                )
            else:
                share = float(rng.uniform(0.01, 0.1))
                sigma, value = (
                    share * value,
                    value * float(np.exp(rng.normal(0, share))),
                )
            rows.append((f"s{i}", quantity, value, sigma, position[i], ranges[i]))
    if len(rows) < 2:
        return honest(rng, laws)
    return Case(kind, _log(rows, kind == "ranges"), _scene(kind))


def _scene(kind: str) -> UncertainScene:
    if kind != "free place":
        return default_scene()
    names = ["charge_east_m", "charge_north_m", "origin_time_s"]
    return replace(freed(default_scene(), names), source="free.toml")


def _log(rows: list, ranged: bool) -> Observations:
    sensor, quantity, value, sigma, position, distance = zip(*rows, strict=True)
    if ranged:
        where = {"slant_range": np.array(distance)}
    else:
        where = {"position": np.array(position)}
    return observed(sensor, quantity, value, sigma, **where)


def of_one(
    rng: np.random.Generator, log: Observations, quantities: tuple[str, ...]
) -> int:
    """Return a row of some quantities, -1 if there is none."""
    rows = [i for i, q in enumerate(log.quantity) if q in quantities]
    return int(rng.choice(rows)) if rows else -1


def scaled(factor: float, *quantities: str) -> Callable:
    """Return a slip that multiplies one row, with its sigma."""

    def slip(rng: np.random.Generator, log: Observations) -> Observations | None:
        row = of_one(rng, log, quantities)
        if row < 0:
            return None
        value, sigma = log.value.copy(), log.sigma.copy()
        value[row] *= factor
        sigma[row] *= factor
        return replace(log, value=value, sigma=sigma)

    return slip


def late(rng: np.random.Generator, log: Observations) -> Observations | None:
    """Set one sensor's clock an hour off."""
    row = of_one(rng, log, ("air_arrival_s",))
    if row < 0:
        return None
    its = np.array([s == log.sensor[row] for s in log.sensor])
    timed = its & (np.array(log.quantity) == "air_arrival_s")
    return replace(log, value=log.value + 3600.0 * timed * rng.choice([-1, 1]))


def moved(change: Callable[[np.ndarray, Observations], np.ndarray]) -> Callable:
    """Return a slip of one sensor's place."""

    def slip(rng: np.random.Generator, log: Observations) -> Observations | None:
        if np.isnan(log.position).any():
            return None
        sensor = rng.choice(log.sensor)
        its = np.array([s == sensor for s in log.sensor])
        position = log.position.copy()
        position[its] = change(position[its], log)
        frame = FRAME if change is swapped_degrees else None
        return replace(log, position=position, frame=frame)

    return slip


def swapped_degrees(position: np.ndarray, log: Observations) -> np.ndarray:
    """Swap latitude and longitude."""
    frame = FRAME
    lat, lon, alt = np.moveaxis(frame.to_geodetic(position), -1, 0)
    return frame.to_enu(lon, lat, alt)


def copied(rng: np.random.Generator, log: Observations) -> Observations | None:
    """Copy a sensor's rows under another name."""
    sensor = rng.choice(log.sensor)
    rows = [i for i, s in enumerate(log.sensor) if s == sensor]
    from jblast.observations import some_rows

    both = some_rows(log, np.array([*range(len(log)), *rows]))
    return replace(both, sensor=(*log.sensor, *("copy",) * len(rows)))


PULSE = ("peak_overpressure_pa", "positive_impulse_pa_s")
SLIPS: dict[str, Callable] = {
    "a pressure or impulse x 1000": scaled(1e3, *PULSE),
    "a pressure or impulse / 1000": scaled(1e-3, *PULSE),
    "psi for kPa, one row": scaled(1 / 6.894757, *PULSE),
    "kPa for psi, one row": scaled(6.894757, *PULSE),
    "milliseconds for seconds, a duration": scaled(1e3, "positive_duration_s"),
    "minutes for seconds, an arrival": scaled(1 / 60, "air_arrival_s"),
    "a clock 1 h off": late,
    "east and north swapped in one sensor": moved(lambda at, _: at[:, [1, 0, 2]]),
    "latitude and longitude swapped in one": moved(swapped_degrees),
    "feet for metres in one sensor": moved(lambda at, _: at / 0.3048),
    "a sensor copied under another name": copied,
}


def slipped(
    rng: np.random.Generator, case: Case, name: str
) -> tuple[Case, set[str]] | None:
    """Return a case with one slip, and the sensors it touches; None: not possible."""
    log = SLIPS[name](rng, case.log)
    if log is None:
        return None
    old = dict(
        enumerate(zip(case.log.value, map(tuple, case.log.position), strict=True))
    )
    touched = {
        log.sensor[i]
        for i in range(len(log))
        if i not in old
        or log.value[i] != old[i][0]
        or (not np.isnan(log.position[i]).any() and tuple(log.position[i]) != old[i][1])
    }
    return replace(case, log=log), touched


def main() -> None:
    """Draw, check, count, write."""
    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(SEED)
    laws = tables()
    lines = [TITLE, "", f"seed {SEED}", ""]
    lines += alarms(rng, laws)
    lines += ["", *named(rng, laws)]
    text = "\n".join(lines) + "\n"
    write_text(RESULT, text)
    print(text)


def alarms(rng: np.random.Generator, laws: dict) -> list[str]:
    """Count honest logs with a warning."""
    kinds: Counter[str] = Counter()
    total: Counter[str] = Counter()
    warned: Counter[str] = Counter()
    for _ in range(HONEST):
        case = honest(rng, laws)
        found = doubts(case.log, case.scene)
        total[case.kind] += 1
        warned[case.kind] += bool(found)
        kinds.update({doubt.kind for doubt in found})
    lines = ["Honest logs                logs   with a warning"]
    for kind in ("all", *total):
        n = HONEST if kind == "all" else total[kind]
        odd = sum(warned.values()) if kind == "all" else warned[kind]
        lines.append(f"  {kind:24s} {n:5d}   {odd:4d}  {100 * odd / n:5.1f} %")
    lines += ["Of which kind:"] + [f"  {k:24s} {c:5d}" for k, c in kinds.most_common()]
    return lines


def named(rng: np.random.Generator, laws: dict) -> list[str]:
    """Count logs with one slip that are warned of, at the sensor, and by its name."""
    rows: dict[str, list[int]] = {name: [0, 0, 0] for name in SLIPS}
    names = list(SLIPS)
    done = 0
    while done < SLIPPED:
        name = names[done % len(names)]
        made = slipped(rng, honest(rng, laws), name)
        if made is None:
            continue
        case, touched = made
        found = doubts(case.log, case.scene)
        at = {case.log.sensor[row] for doubt in found for row in doubt["rows"]}
        rows[name][0] += 1
        rows[name][1] += bool(found)
        rows[name][2] += bool(at & touched)
        done += 1
    lines = [
        "Logs with one slip                         logs  warned of   at the sensor"
    ]
    every = [sum(column) for column in zip(*rows.values(), strict=True)]
    for name, (n, warned, at) in {"all": every, **rows}.items():
        lines.append(
            f"  {name:40s} {n:4d}  {100 * warned / n:7.0f} %  {100 * at / n:9.0f} %"
        )
    return lines


if __name__ == "__main__":
    main()
