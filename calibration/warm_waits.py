"""How long does a second answer take, in imports of JAX?

    python -m calibration.warm_waits [--runs 5]

Each command runs in a process of its own, with programs, compiled code and modules'
bytecode kept in a folder made for this: once to fill it, then a few times, of which
the least counts.
Counted is processor time, on a shared machine the steadier figure; the unit J is that
of `import jax`, taken between the runs. No random numbers beside those of the commands.
"""

import argparse
import contextlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent
DATA = HERE / "data"
RESULT = HERE / "results" / "warm_waits.txt"
RECORDS = DATA / "records_example"
JBLAST = (
    sys.executable,
    "-c",
    "import sys; from jblast.cli.main import main; sys.exit(main())",
)


def fit(log: str, *words: str, scene: str = "") -> list[str]:
    """Return the words of a fit of a log of `calibration/data`."""
    known = ["--scene", str(DATA / scene)] if scene else []
    return ["fit", str(DATA / log), *known, *words]


def commands(out: str) -> dict[str, tuple[list[str], float]]:
    """Return what is timed: words after `jblast`, and the bound it was given [J]."""
    report = ("--out", out, "--force")
    microphones = {"log": "five_microphones.csv", "scene": "five_microphones.toml"}
    shot = {"log": "hta_1.csv", "scene": "hta_1.toml"}
    stations = str(RECORDS / "STATIONS.csv")
    return {
        "a folder of ten records, to the map": (
            fit("records_example", "--positions", stations, *report),
            12.0,
        ),
        "five microphones, to the map": (fit(**microphones) + list(report), 12.0),
        "five microphones": (fit(**microphones), 5.0),
        "a Ford shot, with its report": (fit(**shot) + list(report), 0.0),
        "a Ford shot": (fit(**shot), 6.0),
        "calc": (["calc", "--mass", "15", "--range", "20"], 1.5),
    }


def processor_seconds(command: list[str], env: dict[str, str]) -> tuple[float, float]:
    """Return the processor time of a command and how long it took [s].

    Raises:
        RuntimeError: It ended with another code than 0 (answered) and 4 (in doubt).
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    run = subprocess.run(command, env=env, capture_output=True, text=True)
    took = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if run.returncode not in (0, 4):
        raise RuntimeError(run.stderr.strip().splitlines()[-1])
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return used, took


def main() -> None:
    """Measure, print the table and keep it."""
    options = argparse.ArgumentParser(description="Time second answers.")
    options.add_argument("--runs", type=int, default=5)
    asked = options.parse_args()
    lines = []
    with tempfile.TemporaryDirectory() as kept, tempfile.TemporaryDirectory() as out:
        env = {**os.environ, "XDG_CACHE_HOME": kept, "PYTHONPYCACHEPREFIX": kept}
        env.pop("PYTHONDONTWRITEBYTECODE", None)
        units: list[float] = []
        for what, (words, bound) in commands(str(Path(out) / "report")).items():
            command = [*JBLAST, *words]
            used = []
            with contextlib.suppress(RuntimeError):
                processor_seconds(command, env)  # fills what is kept
                for _ in range(asked.runs):
                    jax = [sys.executable, "-c", "import jax"]
                    units.append(processor_seconds(jax, env)[0])
                    used.append(processor_seconds(command, env))
            lines.append((what, used, bound))
    unit = min(units)
    text = [
        f"J = {unit:.2f} s of processor time, {os.cpu_count()} cores; the least of "
        f"{asked.runs} runs, programs kept",
        "",
        f"{'processor':>11s}  {'wall':>7s}  {'J':>5s}  {'asked':>5s}",
    ]
    for what, used, bound in lines:
        wanted = f"{bound:g}" if bound else ""
        if not used:
            text.append(f"{'not run':>11s}  {'':7s}  {'':5s}  {wanted:>5s}  {what}")
            continue
        seconds, wall = min(used)[0], min(took for _, took in used)
        text.append(
            f"{seconds:9.2f} s  {wall:5.1f} s  {seconds / unit:5.1f}  {wanted:>5s}  "
            f"{what}"
        )
    print("\n".join(text))
    RESULT.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
