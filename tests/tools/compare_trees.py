"""Record and compare the answers of two trees of the package to about ninety commands.

    python tests/tools/compare_trees.py record TREE OUT [NAME ...]
    python tests/tools/compare_trees.py compare OUT OTHER [NAME ...]

`record` runs `COMMANDS` by the package in TREE, with fixed seeds and small inputs, and
writes one JSON document for each into OUT: exit code, answer (`--json` or `--csv`),
tables, and checksums of all other files. The kept record is `tests/tools/documents`.
`compare` prints the differences of two records, and returns 1 if there are any:

- exit codes, keys, columns, numbers of rows and files: any difference;
- words: the message of a refused command must contain `word`. Strings with a space,
  pages and figures are not compared, only whether they exist;
- numbers of laws and simulations: more than 1e-12 of their size, in a list of that of
  its largest number;
- searched or sampled numbers: more than 1e-3 of their own standard deviation, or 1e-6
  of their size if none is given;
- sounds, frames, events and stores: any byte.

Intended differences are rows of `differences.csv` in OUT: command, key and reason; the
first two are patterns of `fnmatch`. If all commands are compared, a row without a
difference is a difference itself.
"""

import argparse
import csv
import hashlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

EXACT = 1e-12
"""Of laws and simulations: sums in another order differ by less."""
OF_SD = 1e-3
"""Of searched numbers: far below what matters to a user, far above the difference of
two searches by the same method."""
SEARCHED = 1e-6
"""Of a searched number without a standard deviation."""
ROWS = 100
"""Rows of a table and entries of a list that are kept; longer ones are thinned."""

LOG = """sensor,quantity,value,sigma,east_m,north_m,up_m
gate,air_arrival_s,0.1203,0.0005,52.0,11.0,1.5
gate,peak_overpressure_pa,9010,450,52.0,11.0,1.5
mast,air_arrival_s,0.2238,0.0005,-31.0,84.0,4.0
mast,peak_overpressure_pa,4860,240,-31.0,84.0,4.0
"""
FLASH = LOG.partition("gate")[0] + "f,flash_time_s,1e-3,1e-4,300,0,0\n"
UNLIKELY = LOG.replace("9010,450", "9.01,0.45")
BAD = LOG.replace("9010", "nine")
THEIRS = "sensor,range_ft,air_arrival_ms,sigma_air_arrival_ms\nA,164,120.3,0.5\n"
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
    "unlikely.csv": UNLIKELY,
    "theirs.csv": THEIRS,
    "silence.csv": "time_s,pressure_pa\n"
    + "".join(f"{0.001 * i:.3f},{math.sin(i * i):.6f}\n" for i in range(1000)),
    "noise.csv": "time_s,x_m\n"
    + "".join(f"{0.05 * i:.2f},{math.sin(i * i):.6f}\n" for i in range(200)),
    "typo.toml": CHARGE.replace("mass_kg", "mas_kg"),
    "flash.toml": '[charge]\nmass_kg = "free"\ntime_s = "free"\n'
    '[[sensor]]\nname = "f"\nposition_m = [300, 0, 0]\n'
    "records = { flash_time_s = 1e-4 }\n",
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
"""Inputs."""


class Command(NamedTuple):
    """A command, and how closely its numbers must agree.

    Attributes:
        name: Of its document.
        line: The words; DATA is `calibration/data` of the tree. Files of earlier
            commands may be read.
        exact: Whether numbers are those of a law or a simulation.
        word: What the message of a refused command must contain.
        seconds: Time after which it is interrupted.
    """

    name: str
    line: str
    exact: bool = True
    word: str = ""
    seconds: float = 3600.0


def _searched(name: str, line: str) -> Command:
    return Command(name, line, exact=False)


def _refused(name: str, line: str, word: str) -> Command:
    return Command(name, line, word=word)


COMMANDS = (
    Command("calc", "calc --mass 15 --range 20 --json"),
    Command("calc_far", "calc --mass 2 --explosive C4 --range 5,50,500 --json"),
    Command("calc_inverse", "calc --range 5 --duration 3ms --json"),
    Command("calc_reflected", "calc --mass 15 --reflected-pressure 1e5 --json"),
    Command("calc_height", "calc --mass 33lb --range 100ft --height 12 --csv"),
    Command(
        "calc_air",
        "calc --mass 2 --range 30:300:4 --altitude 2000 --humidity 0.5 --csv",
    ),
    _refused("calc_refused", "calc --mass -5 --range 20 --json", "--mass"),
    _refused("calc_without", "calc --mass 15 --json", "--range"),
    Command("convert", "convert theirs.csv --wide --out converted.csv"),
    _refused("convert_refused", "convert foreign.csv --wide", "foreign.csv"),
    Command("scene", "scene log.csv --out starter.toml"),
    _refused("scene_refused", "scene bad.csv --out none.toml", "nine"),
    _searched("check", "check log.csv --json"),
    _searched("check_hta", "check DATA/hta_1.csv --json"),
    _searched("check_unlikely", "check unlikely.csv --json"),
    _refused("check_refused", "check bad.csv --json", ""),
    Command(
        "choose",
        "choose records.toml --quantity air_arrival_s --tolerance 0.05 --json",
    ),
    Command("choose_none", "choose records.toml --quantity air_arrival_s --json"),
    Command("choose_peak", "choose prior.toml --quantity peak_overpressure_pa --json"),
    _refused("choose_refused", "choose records.toml --quantity loudness", "loudness"),
    Command(
        "bound",
        "bound records.toml --free charge_mass_kg --at charge_mass_kg=15 --json",
    ),
    Command("bound_free", "bound free.toml --at charge_mass_kg=15 --json"),
    Command("bound_unknown", "bound flash.toml --at charge_mass_kg=15 --json"),
    _refused("bound_refused", "bound free.toml --json", "charge_mass_kg"),
    Command("simulate", "simulate records.toml --seed 3 --out simulated.csv"),
    Command("simulate_prior", "simulate prior.toml --seed 4 --out sampled.csv"),
    _refused("simulate_refused", "simulate typo.toml --out none.csv", "mas_kg"),
    _searched("fit", "fit log.csv --json"),
    _searched("fit_normal", "fit log.csv --noise gaussian --json"),
    _searched("fit_simulated", "fit simulated.csv --scene free.toml --json"),
    _searched("fit_walk", "fit log.csv --posterior emcee --json"),
    _searched(
        "fit_five",
        "fit DATA/five_microphones.csv --scene DATA/five_microphones.toml --json",
    ),
    _searched(
        "fit_camera",
        "fit DATA/camera_and_bang.csv --scene DATA/camera_and_bang.toml --json",
    ),
    _searched("fit_hta", "fit DATA/hta_1.csv --scene DATA/hta_1.toml --json"),
    _searched(
        "fit_clips", "fit DATA/six_clips.csv --date 2024-05-17 --zone UTC --json"
    ),
    _searched(
        "fit_records",
        "fit DATA/records_example --positions DATA/records_example/STATIONS.csv --json",
    ),
    _searched("fit_unknown", "fit flash.csv --free origin_time_s --json"),
    _searched("fit_several", "fit log.csv bad.csv --out several --json"),
    _refused("fit_refused", "fit bad.csv --json", "nine"),
    _searched("fit_out", "fit log.csv --out fitted"),
    _searched("pick", "pick DATA/records_example/g01.csv --json"),
    _searched("pick_phone", "pick DATA/inl_phones/phone_1.mseed --json"),
    _searched(
        "pick_several",
        "pick DATA/records_example/g02.csv DATA/records_example/g03.csv "
        "--positions DATA/records_example/STATIONS.csv --out picks.csv --report picked",
    ),
    _searched("pick_none", "pick silence.csv --json"),
    _refused("pick_refused", "pick log.csv --json", "log.csv"),
    Command("listen", "listen heard.toml --seconds 0.3 --seed 1 --out heard --json"),
    _refused("listen_refused", "listen records.toml --out none --json", "kind"),
    _searched("detect", "detect DATA/sound/bang.flac --all-sounds --json"),
    _searched(
        "detect_pulse",
        "detect heard/phone.wav --charge 15 --range 60 --out found --json",
    ),
    _searched("detect_none", "detect DATA/sound/ambient_fireplace.ogg --json"),
    _refused("detect_refused", "detect log.csv --json", "log.csv"),
    Command("render", "render film.toml --seconds 0.1 --seed 1 --out film --json"),
    Command(
        "render_views",
        "render film.toml --views explosion --seconds 0.02 --mode rgb --out views "
        "--json",
    ),
    _refused("render_refused", "render records.toml --out none", "[camera]"),
    Command("events", "events film/frames --fps 500 --seed 1 --out events.h5 --json"),
    _refused("events_refused", "events film/frames --out none.h5", "--fps"),
    _searched("detect_film", "detect film/frames --fps 500 --json"),
    _searched("detect_events", "detect film/events.h5 --json"),
    Command("fly", "fly flight.toml --seconds 0.6 --step 0.002 --out flown --json"),
    Command(
        "fly_many",
        "fly flights.toml --vehicles 4 --seconds 0.4 --step 0.002 --seed 2 "
        "--controllers hold,cascade --out many --json",
    ),
    Command("fly_estimated", "fly flight.toml --seconds 0.4 --estimator ekf --json"),
    _refused("fly_refused", "fly records.toml --json", "[vehicle]"),
    Command("plan", "plan grid.plan --grid 6,0,1 --home 35.3,-80.7,200 --speed 4"),
    Command("plan_orbit", "plan orbit.plan --orbit 20,2 --home 35.3,-80.7,200"),
    _refused("plan_refused", "plan none.plan --orbit 20 --home 95,0", "--home"),
    Command("fly_mission", "fly mission.toml --out mission --json"),
    Command("world", "world world.toml --seconds 1.5 --seed 3 --out world --json"),
    _searched(
        "world_fit",
        "world world.toml --seconds 1.5 --seed 3 --detect --fit --out searched --json",
    ),
    _refused("world_refused", "world typo.toml --out none --json", "mas_kg"),
    Command("report", "report world --out world.html"),
    _searched("report_fit", "report world --fit --out fits.html"),
    _refused("report_refused", "report film", "run.json"),
    Command(
        "serve",
        "serve world.toml --listen 127.0.0.1:0 --seconds 0.2 --json",
        seconds=60.0,  # it waits for clients
    ),
    _refused("serve_refused", "serve typo.toml --listen 127.0.0.1:0", "mas_kg"),
    Command("study", "study study.toml --out study.zarr --json"),
    Command("study_report", "study report study.zarr --out studied --json"),
    Command("study_list", "study --list"),
    _refused("study_refused", "study typo.toml --out none.zarr", "typo.toml"),
    _searched(
        "tune",
        "tune growth.toml film/frames --free fireball_growth_s --out tuned --json",
    ),
    _searched("tune_gains", "tune flights.toml --gains --vehicles 2 --json"),
    Command("tune_list", "tune film.toml --list"),
    _refused("tune_refused", "tune film.toml film/frames --free hue", "hue"),
    _searched(
        "discover",
        "discover orbit.csv --state x_m,v_m_s --ensemble 20 --seed 0 --json",
    ),
    _searched("discover_none", "discover noise.csv --ensemble 20 --seed 0 --json"),
    _refused("discover_refused", "discover log.csv --json", "time_s"),
)
WORDS = {".html", ".md", ".toml", ".svg", ".txt", ".kml"}
FIGURES = {"path", "loads", "error", "map", "report", "sheet", "mission", "controllers"}
"""Text, and names of drawn figures: kept is only that they exist."""
UNSTEADY = {"provenance", "versions", "took_s", "written", "command", "seconds_taken"}
UNSTEADY |= {"date", "address", "seconds"}
"""Keys of when, where, by what and how long an answer was computed."""
SHORT = re.compile(r"\[([^][{}]*)\]")
"""Lists of numbers and words, which are written on one line."""


def record(tree: Path, out: Path, names: list[str]) -> None:
    """Run the commands by one tree.

    Args:
        tree: Checkout of the package.
        out: Folder for the documents.
        names: Of the commands, of which earlier ones have been run; all if empty.
    """
    work = Path(tempfile.gettempdir()) / "compare_trees" / out.name
    if not names:
        shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True, exist_ok=True)
    out.mkdir(parents=True, exist_ok=True)
    for name, text in FILES.items():
        (work / name).write_text(text)
    env = {**os.environ, "PYTHONPATH": str(tree), "COLUMNS": "96"}
    for command in COMMANDS:
        if names and command.name not in names:
            continue
        line = command.line.replace("DATA", str(tree / "calibration" / "data"))
        before = _files(work)
        words = [sys.executable, "-m", "jblast.cli.main", *line.split()]
        with subprocess.Popen(
            words,
            cwd=work,
            env=env,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as run:
            try:
                output, errors = run.communicate(timeout=command.seconds)
            except subprocess.TimeoutExpired:
                run.send_signal(signal.SIGINT)
                output, errors = run.communicate()
        new = sorted(p for p, at in _files(work).items() if before.get(p) != at)
        document: dict[str, Any] = {"line": command.line, "exit_code": run.returncode}
        if run.returncode and not output:
            document["message"] = errors.splitlines()[-1]
        if "--json" in line and output:
            document["answer"] = _kept(json.loads(output))
        elif "--csv" in line:
            document["answer"] = _table(output)
        document["files"] = {name: _content(work / name) for name in new}
        text = json.dumps(document, indent=1, ensure_ascii=False)
        text = SHORT.sub(lambda found: f"[{' '.join(found[1].split())}]", text)
        for place, word in ((tree, "TREE"), (work, "WORK")):
            text = text.replace(str(place), word)
        (out / f"{command.name}.json").write_text(f"{text}\n")
        sys.stdout.write(
            f"{command.name}: exit code {run.returncode}, {len(new)} files\n"
        )
        sys.stdout.flush()


def _files(folder: Path) -> dict[str, int]:
    return {
        path.relative_to(folder).as_posix(): path.stat().st_mtime_ns
        for path in folder.rglob("*")
        if path.is_file()
    }


def _content(path: Path) -> Any:
    """Return what is kept of a file: its values, its checksum or nothing."""
    if path.suffix in WORDS or (path.suffix == ".png" and path.stem in FIGURES):
        return None
    if path.suffix == ".csv":
        return _table(path.read_text())
    if path.suffix == ".json" and not any(".zarr" in part for part in path.parts):
        return _kept(json.loads(path.read_text()))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _table(text: str) -> dict[str, Any]:
    """Return the number of rows of a table, and its columns."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    head, *rows = csv.reader(lines)
    columns = {
        name: _kept([_value(cell) for cell in column])
        for name, column in zip(head, zip(*rows, strict=True), strict=False)
    }
    return {"rows": len(rows), "columns": columns}


def _value(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def _kept(value: Any) -> Any:
    """Return a value without unsteady keys, its long lists thinned."""
    if isinstance(value, dict):
        return {k: _kept(v) for k, v in value.items() if k not in UNSTEADY}
    if isinstance(value, list):
        return [_kept(v) for v in value[:: 1 + len(value) // ROWS]]
    return value


def compare(one: Path, other: Path, names: list[str]) -> list[str]:
    """Return the differences of two records."""
    rows = []
    if (one / "differences.csv").exists():
        with (one / "differences.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
    found, unmatched = [], list(rows)
    for command in COMMANDS:
        if names and command.name not in names:
            continue
        a, b = (folder / f"{command.name}.json" for folder in (one, other))
        if not (a.exists() and b.exists()):
            found.append(f"{command.name}: not in both records")
            continue
        a, b = (json.loads(file.read_text()) for file in (a, b))
        for at, what in _of_command(command, a, b):
            intended = [
                row
                for row in rows
                if fnmatch(command.name, row["command"]) and fnmatch(at, row["key"])
            ]
            unmatched = [row for row in unmatched if row not in intended]
            if not intended:
                found.append(f"{command.name}: {at}: {what}")
    if not names:
        found += [
            f"differences.csv: {row['command']}, {row['key']}: no such difference"
            for row in unmatched
        ]
    return found


Differences = Iterator[tuple[str, str]]


def _of_command(command: Command, a: dict, b: dict) -> Differences:
    messages = [document.pop("message", "") for document in (a, b)]
    if not all(command.word in message for message in messages):
        yield "message", f"{command.word!r} is missing in one of {messages}"
    yield from _of_value(command, "", a, b, math.nan, 0.0)


def _of_value(
    command: Command, at: str, a: Any, b: Any, sd: float, size: float
) -> Differences:
    if isinstance(a, dict) and isinstance(b, dict):
        sd = _sd_of(a, sd)
        for key in sorted(a.keys() | b.keys()):
            below = f"{at}.{key}".removeprefix(".")
            if key in a and key in b:
                yield from _of_value(command, below, a[key], b[key], sd, 0.0)
            else:
                yield below, "in one record only"
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            yield at, f"{len(a)} and {len(b)} entries"
        size = max(
            (abs(x) for x in a + b if _is_number(x) and math.isfinite(x)), default=0.0
        )
        for i, (x, y) in enumerate(zip(a, b, strict=False)):
            yield from _of_value(command, f"{at}.{i}", x, y, sd, size)
    elif _is_number(a) and _is_number(b):
        if not _near(command, float(a), float(b), sd, size):
            yield at, f"{a!r} and {b!r}"
    elif isinstance(a, str) and isinstance(b, str) and " " in a + b:
        return  # words
    elif a != b:
        yield at, f"{a} and {b}"


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _sd_of(document: dict[str, Any], otherwise: float) -> float:
    """Return the standard deviation of a document's numbers, if it is given."""
    sd, low, high = (document.get(key) for key in ("sd", "q05", "q95"))
    if _is_number(sd):
        return float(sd)
    if _is_number(low) and _is_number(high):
        return (high - low) / 3.29  # of a normal
    return otherwise


def _near(command: Command, a: float, b: float, sd: float, size: float) -> bool:
    if a == b or (math.isnan(a) and math.isnan(b)):
        return True
    own = max(abs(a), abs(b))
    if command.exact:
        return abs(a - b) <= EXACT * max(own, size)
    return abs(a - b) <= max(SEARCHED * own, 0.0 if math.isnan(sd) else OF_SD * sd)


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
    found = compare(one, other, args.names)
    number = len(args.names or COMMANDS)
    sys.stdout.write(("\n".join(found) or f"{number} commands: no difference") + "\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
