"""Whether two trees of the package answer the same to some forty commands.

    python tests/tools/compare_trees.py record TREE OUT [NAME ...]
    python tests/tools/compare_trees.py compare OUT OTHER

`record` runs the commands of `COMMANDS` by the package in TREE, with fixed seeds and
small inputs, and keeps in OUT what each printed and wrote. `compare` names what differs
between two records and exits with 1 if anything does:

- exit codes, keys of JSON, columns of tables: at all;
- numbers of laws and simulations: by more than 1e-12 of their size;
- numbers that are searched for or sampled: by more than 1e-3 of their own standard
  deviation, or of 1e-6 of their size where none is told;
- sounds, frames, events and stores: at all. They are compared byte by byte.

Words may change: text on the terminal, pages and figures are not compared, only
whether they are there. `serve` needs a client; tests of its own run it.
"""

import argparse
import csv
import hashlib
import io
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

EXACT = 1e-12
"""Of laws and simulations: other orders of the same sums differ by less."""
OF_SD = 1e-3
"""Of what a search finds: far below what an answer is worth, far above where two
searches by the same method end."""
SEARCHED = 1e-6
"""Of a searched number without a standard deviation."""
SECONDS = 900
"""A command takes so long at most."""

LOG = """sensor,quantity,value,sigma,east_m,north_m,up_m
gate,air_arrival_s,0.1203,0.0005,52.0,11.0,1.5
gate,peak_overpressure_pa,9010,450,52.0,11.0,1.5
mast,air_arrival_s,0.2238,0.0005,-31.0,84.0,4.0
mast,peak_overpressure_pa,4860,240,-31.0,84.0,4.0
"""
FLASH = LOG.partition("gate")[0] + "f,flash_time_s,1e-3,1e-4,300,0,0\n"
BAD = LOG.replace("9010", "nine")
FOREIGN = "Station;Range (ft);arrival (ms)\nA;164,0;120,3\nB;295,3;223,8\n"
CHARGE = "[charge]\nmass_kg = 15.0\nposition_m = [0, 0, 1]\ntime_s = 0.02\n"
RECORDS = """
[[sensor]]
name = "gauge"
position_m = [40, 0, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
[[sensor]]
name = "north"
position_m = [0, 50, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
[[sensor]]
name = "west"
position_m = [-50, -20, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
"""
HEARD = """
[[sensor]]
name = "phone"
kind = "microphone"
position_m = [60.0, 0.0, 1.5]
clock_offset_s = 0.01
rate_hz = 8000
full_scale_pa = 2000.0
noise_pa = 0.02
[[sensor]]
name = "pressure"
kind = "pressure"
position_m = [60.0, 0.0, 1.5]
rate_hz = 8000
[[sensor]]
name = "ground"
kind = "geophone"
position_m = [30, 0, 0]
rate_hz = 8000
"""
CAMERA = """
[camera]
position_m = [0, -40, 2]
look_at_m = [0, 0, 4]
width = 24
height = 18
focal_px = 24
frames_hz = 500
threshold = [0.2, 0.3]
"""
VEHICLE = '[vehicle]\nmodel = "crazyflie"\nposition_m = [5.0, 0.0, 2.0]\n'
WORLD = """
[world]
count = 2
region_m = { box = [[-10, -10, 0], [10, 10, 0]] }
time_s = [0.2, 0.9]
gap_s = 0.4
[law]
scatter = false
"""
STUDY = """
scene = "prior.toml"
seed = 3
samples = 16
outcomes = ["air_arrival_s", "peak_overpressure_pa"]
[axes]
charge_east_m = [-50.0, 50.0]
"""
FILES = {
    "log.csv": LOG,
    "flash.csv": FLASH,
    "bad.csv": BAD,
    "foreign.csv": FOREIGN,
    "records.toml": CHARGE + RECORDS,
    "heard.toml": CHARGE + HEARD,
    "film.toml": CHARGE + CAMERA,
    "flight.toml": "[charge]\nmass_kg = 1.0\n" + VEHICLE,
    "flights.toml": "[charge]\nmass_kg = { lognormal = [1.0, 2.0] }\n" + VEHICLE,
    "mission.toml": "[charge]\nmass_kg = 0.5\nposition_m = [1.0, 4.0, 0.0]\n"
    'time_s = 8.0\n[vehicle]\nmodel = "crazyflie"\nmission = "grid.plan"\n',
    "world.toml": WORLD + RECORDS + HEARD + CAMERA + VEHICLE,
    "free.toml": '[charge]\nmass_kg = "free"\n' + RECORDS,
    "prior.toml": "[charge]\nmass_kg = { lognormal = [15.0, 3.0] }\n" + RECORDS,
    "growth.toml": CHARGE + "[law]\nfireball_growth_s = 0.0025\n" + CAMERA,
    "study.toml": STUDY,
    "orbit.csv": "time_s,x_m,v_m_s\n"
    + "".join(
        f"{0.05 * i},{math.cos(0.1 * i)},{-2 * math.sin(0.1 * i)}\n" for i in range(200)
    ),
}
"""Inputs, written anew for each record."""


class Command(NamedTuple):
    """A command, and how closely its numbers must agree.

    Attributes:
        name: Of the folder that keeps its output; what later commands read lies there.
        line: The words; DATA is `calibration/data` of the tree.
        exact: Whether numbers are those of a law or a simulation.
    """

    name: str
    line: str
    exact: bool = True


COMMANDS = (
    Command("calc", "calc --mass 15 --range 20 --json"),
    Command("calc_far", "calc --mass 2 --explosive C4 --range 5,50,500 --json"),
    Command("calc_inverse", "calc --range 5 --duration 3ms --json"),
    Command("calc_reflected", "calc --mass 15 --reflected-pressure 1e5 --json"),
    Command("convert", "convert foreign.csv --wide --out converted.csv"),
    Command("scene", "scene log.csv --out starter.toml"),
    Command("check", "check log.csv --json", exact=False),
    Command("check_hta", "check DATA/hta_1.csv --json", exact=False),
    Command("choose", "choose records.toml --quantity air_arrival_s --json"),
    Command("choose_peak", "choose prior.toml --quantity peak_overpressure_pa --json"),
    Command(
        "bound",
        "bound records.toml --free charge_mass_kg --at charge_mass_kg=15 --json",
    ),
    Command("bound_free", "bound free.toml --at charge_mass_kg=15 --json"),
    Command("simulate", "simulate records.toml --seed 3 --out simulated.csv"),
    Command("fit", "fit log.csv --json", exact=False),
    Command("fit_normal", "fit log.csv --noise gaussian --json", exact=False),
    Command("fit_simulated", "fit simulated.csv --scene free.toml --json", exact=False),
    Command("fit_walk", "fit log.csv --posterior emcee --json", exact=False),
    Command(
        "fit_five",
        "fit DATA/five_microphones.csv --scene DATA/five_microphones.toml --json",
        exact=False,
    ),
    Command(
        "fit_camera",
        "fit DATA/camera_and_bang.csv --scene DATA/camera_and_bang.toml --json",
        exact=False,
    ),
    Command(
        "fit_hta", "fit DATA/hta_1.csv --scene DATA/hta_1.toml --json", exact=False
    ),
    Command(
        "fit_clips",
        "fit DATA/six_clips.csv --date 2024-05-17 --zone UTC --json",
        exact=False,
    ),
    Command(
        "fit_records",
        "fit DATA/records_example --positions DATA/records_example/STATIONS.csv --json",
        exact=False,
    ),
    Command("fit_unknown", "fit flash.csv --free origin_time_s --json", exact=False),
    Command("fit_bad", "fit bad.csv --json"),
    Command("fit_out", "fit log.csv --out fitted", exact=False),
    Command("pick", "pick DATA/records_example/g01.csv --json", exact=False),
    Command("pick_phone", "pick DATA/inl_phones/phone_1.mseed --json", exact=False),
    Command("listen", "listen heard.toml --seconds 0.3 --seed 1 --out heard --json"),
    Command("detect", "detect DATA/sound/bang.flac --json", exact=False),
    Command("render", "render film.toml --seconds 0.1 --seed 1 --out film --json"),
    Command("events", "events film/frames --fps 500 --seed 1 --out events.h5 --json"),
    Command("detect_film", "detect film/frames --fps 500 --json", exact=False),
    Command("fly", "fly flight.toml --seconds 0.6 --step 0.002 --out flown --json"),
    Command(
        "fly_many",
        "fly flights.toml --vehicles 4 --seconds 0.4 --step 0.002 --seed 2 "
        "--controllers hold,cascade --out many --json",
    ),
    Command("plan", "plan grid.plan --grid 6,0,1 --home 35.3,-80.7,200 --speed 4"),
    Command("plan_orbit", "plan orbit.plan --orbit 20,2 --home 35.3,-80.7,200"),
    Command("fly_mission", "fly mission.toml --out mission --json"),
    Command("world", "world world.toml --seconds 1.5 --seed 3 --out world --json"),
    Command("report", "report world --out world.html"),
    Command("study", "study study.toml --out study.zarr --json"),
    Command("study_report", "study report study.zarr --json"),
    Command("study_list", "study --list --json"),
    Command(
        "tune",
        "tune growth.toml film/frames --free fireball_growth_s --out tuned --json",
        exact=False,
    ),
    Command(
        "discover",
        "discover orbit.csv --state x_m,v_m_s --ensemble 20 --seed 0 --json",
        exact=False,
    ),
)
BY_WORD = {".html", ".md", ".toml", ".svg", ".txt", ".kml"}
"""Text and figures: only whether they are there."""
DRAWN = {"loads.png", "error.png", "map.png", "report.png", "sheet.png"}
UNSTEADY = {"provenance", "versions", "took_s", "written", "command", "seconds_taken"}
"""Keys that tell when, where and by what an answer came."""


def record(tree: Path, out: Path, names: list[str]) -> None:
    """Run the commands by one tree.

    Args:
        tree: Checkout of the package.
        out: Folder that keeps what came.
        names: Of the commands; all if empty.
    """
    work = out / "work"
    if not names and out.exists():
        shutil.rmtree(out)
    work.mkdir(parents=True, exist_ok=True)
    for name, text in FILES.items():
        (work / name).write_text(text)
    env = {**os.environ, "PYTHONPATH": str(tree), "COLUMNS": "96"}
    for command in COMMANDS:
        if names and command.name not in names:
            continue
        line = command.line.replace("DATA", str(tree / "calibration" / "data"))
        before = _files(work)
        done = subprocess.run(
            [sys.executable, "-m", "jblast.cli.main", *line.split()],
            cwd=work,
            env=env,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )
        kept = out / command.name
        shutil.rmtree(kept, ignore_errors=True)
        kept.mkdir()
        (kept / "exit_code").write_text(str(done.returncode))
        (kept / "stdout").write_text(done.stdout)
        (kept / "stderr").write_text(done.stderr)
        new = sorted(p for p, at in _files(work).items() if before.get(p) != at)
        (kept / "files").write_text("".join(f"{path}\n" for path in new))
        sys.stdout.write(
            f"{command.name}: exit code {done.returncode}, {len(new)} files\n"
        )
        sys.stdout.flush()


def _files(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder)): path.stat().st_mtime_ns
        for path in folder.rglob("*")
        if path.is_file()
    }


def compare(one: Path, other: Path) -> list[str]:
    """Return what differs between two records."""
    found = []
    for command in COMMANDS:
        a, b = one / command.name, other / command.name
        if not (a.exists() and b.exists()):
            found.append(f"{command.name}: not run by both")
            continue
        found += [f"{command.name}: {line}" for line in _of_command(command, a, b)]
    return found


def _of_command(command: Command, a: Path, b: Path) -> Iterator[str]:
    for kept in ("exit_code", "files"):
        one, other = (sorted((p / kept).read_text().split("\n")) for p in (a, b))
        if one != other:
            yield f"{kept}: {sorted(set(one) ^ set(other))}"
    if "--json" in command.line:
        one, other = ((p / "stdout").read_text() for p in (a, b))
        if one and other:
            yield from _of_json(command, "stdout", one, other)
        elif one != other:
            yield "one printed nothing"
    for name in (a / "files").read_text().split():
        one, other = (p.parent / "work" / name for p in (a, b))
        if one.exists() and other.exists():
            yield from _of_file(command, name, one, other)


def _of_file(command: Command, name: str, one: Path, other: Path) -> Iterator[str]:
    path = Path(name)
    is_drawn = path.name in DRAWN or (path.suffix == ".png" and not command.exact)
    if path.suffix in BY_WORD or is_drawn:
        return
    a, b = one.read_bytes(), other.read_bytes()
    if hashlib.sha256(a).digest() == hashlib.sha256(b).digest():
        return
    if path.suffix == ".json" and ".zarr" not in name:
        yield from _of_json(command, name, a.decode(), b.decode())
    elif path.suffix == ".csv":
        yield from _of_table(command, name, a.decode(), b.decode())
    else:
        yield f"{name}: other bytes"


def _of_table(command: Command, name: str, one: str, other: str) -> Iterator[str]:
    def rows(text: str) -> list[list[str]]:
        told = (line for line in io.StringIO(text) if not line.startswith("#"))
        return list(csv.reader(told))

    a, b = rows(one), rows(other)
    if [len(r) for r in a] != [len(r) for r in b] or a[:1] != b[:1]:
        yield f"{name}: other rows or columns"
        return
    for number, (r, s) in enumerate(zip(a, b, strict=True)):
        for column, x, y in zip(a[0], r, s, strict=True):
            if x != y and not _near(command, _number(x), _number(y), math.nan):
                yield f"{name}: row {number}, {column}: {x} and {y}"


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _of_json(command: Command, name: str, one: str, other: str) -> Iterator[str]:
    try:
        a, b = json.loads(one), json.loads(other)
    except json.JSONDecodeError:
        if one != other:
            yield f"{name}: no JSON"
        return
    yield from _of_value(command, name, a, b, math.nan)


def _of_value(command: Command, at: str, a: Any, b: Any, sd: float) -> Iterator[str]:
    if isinstance(a, dict) and isinstance(b, dict):
        if a.keys() != b.keys():
            yield f"{at}: keys {sorted(a.keys() ^ b.keys())}"
        sd = _sd_of(a, sd)
        for key in a.keys() & b.keys() - UNSTEADY:
            yield from _of_value(command, f"{at}.{key}", a[key], b[key], sd)
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            yield f"{at}: {len(a)} and {len(b)} entries"
        for i, (x, y) in enumerate(zip(a, b, strict=False)):
            yield from _of_value(command, f"{at}[{i}]", x, y, sd)
    elif isinstance(a, str) and isinstance(b, str):
        return  # words
    elif _is_number(a) and _is_number(b):
        if a != b and not _near(command, float(a), float(b), sd):
            yield f"{at}: {a!r} and {b!r}"
    elif a != b:
        yield f"{at}: {a} and {b}"


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _sd_of(document: dict[str, Any], otherwise: float) -> float:
    """Return the standard deviation of a document's numbers, where it tells one."""
    sd, low, high = (document.get(key) for key in ("sd", "q05", "q95"))
    if _is_number(sd):
        return float(sd)
    if _is_number(low) and _is_number(high):
        return (high - low) / 3.29  # of a normal
    return otherwise


def _near(command: Command, a: float, b: float, sd: float) -> bool:
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    size = max(abs(a), abs(b))
    if command.exact:
        return abs(a - b) <= EXACT * size
    return abs(a - b) <= max(SEARCHED * size, 0.0 if math.isnan(sd) else OF_SD * sd)


def main() -> int:
    """Record, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("one", type=Path)
    parser.add_argument("other", type=Path)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    one, other = args.one.resolve(), args.other.resolve()
    if args.what == "record":
        record(one, other, args.names)
        return 0
    found = compare(one, other)
    told = "\n".join(found) or f"{len(COMMANDS)} commands: no difference"
    sys.stdout.write(f"{told}\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
