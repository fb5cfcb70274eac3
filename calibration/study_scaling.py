"""What sharing a study among workers costs, and what 1e12 samples would take.

python -m calibration.study_scaling

- Start: from the command until the first tile is written, the second time.
- Workers that calculate: a study of arrivals and pressures at 16 sensors,
  `keep = "summary"`, in tiles of about a second of a core, by this process alone on one
  core, by this process on all cores, and by workers that share all cores. Each is run
  for a quarter of its samples and for all of them: the difference is what the rest
  takes, so that neither the start nor what each process compiles counts. Dask's loss is
  held against this process on the same cores.
- Simulated workers: as many processes, whose tiles are a second of sleep: what is lost
  is what Dask takes to hand tiles out and to hear of them.
- Cost model: samples x seconds a sample of one core / (workers x efficiency), the
  efficiency that of the most simulated workers, whose loss is the largest.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIMULATED = (1, 2, 4, 8)
EACH = 5
"""Tiles of a simulated worker."""
TILE_S = 1.0
SAMPLES = 1 << 26
"""Of each core: a tile that one worker has more, or less, is to be a small part."""
TILE = 1 << 21
"""Samples of a tile: about a second of a core."""
RUN = "import sys; from jblast.cli.main import main; sys.exit(main())"
KEPT = Path(__file__).parent / "results" / "study_scaling.txt"


def asleep(store: str, tile: int) -> str:
    """Take as long as a tile does; return a version."""
    del store, tile
    time.sleep(TILE_S)
    return "simulated"


def simulated(workers: int) -> float:
    """Return how long tiles of sleep take in all, against the least they could."""
    from jblast.study.sampling.cluster import shared, workers_here

    with workers_here(workers) as client:
        list(shared(client, asleep, "", list(range(workers)), "simulated"))
        begun = time.perf_counter()
        tiles = list(range(EACH * workers))
        done = list(shared(client, asleep, "", tiles, "simulated"))
        assert sorted(done) == tiles
        return EACH * TILE_S / (time.perf_counter() - begun)


def command(folder: Path, out: str, *more: str, on: tuple[str, ...] = ()) -> float:
    """Run a study by its command, begun by another or not; return the seconds."""
    begun = time.perf_counter()
    words = [*on, sys.executable, "-c", RUN, "study", str(folder / "study.toml")]
    subprocess.run(
        [*words, "--out", str(folder / out), *more],
        check=True,
        capture_output=True,
    )
    return time.perf_counter() - begun


def written(folder: Path, samples: int) -> None:
    """Write the study of arrivals and pressures."""
    from calibration.study_cases import AIR, sensors

    (folder / "scene.toml").write_text(AIR + sensors(16))
    (folder / "study.toml").write_text(
        f'scene = "scene.toml"\nsamples = {samples}\nkeep = "summary"\n'
        'outcomes = ["air_arrival_s", "peak_overpressure_pa"]\n'
    )


def workers_lines() -> tuple[list[str], float]:
    """Measure workers that calculate; return seconds a sample of one core, too."""
    from jblast.study.sampling.work import MOST_TILES

    cores = os.cpu_count() or 1
    counts = [n for n in (1, 2, 4, 8, 16) if n <= cores]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        written(folder, MOST_TILES * TILE)
        command(folder, "first", "--limit", "1")
        start = command(folder, "second", "--limit", "1")

        def rate(
            name: str, samples: int, *more: str, on: tuple[str, ...] = ()
        ) -> float:
            """Return samples a second of all but the first quarter."""
            quarter, whole = (
                command(folder, f"{name} {limit}", *more, "--limit", str(limit), on=on)
                for limit in (samples // 4, samples)
            )
            return 0.75 * samples / (whole - quarter)

        # held to it: XLA has threads on all cores, however few its devices are
        one = rate("one core", SAMPLES, "--devices", "1", on=("taskset", "-c", "0"))
        here = rate("all cores", cores * SAMPLES)
        shared = {
            n: rate(f"{n} workers", cores * SAMPLES, "--workers", str(n))
            for n in counts
        }
    lines = [
        f"start to first tile, warm: {start:.1f} s",
        "",
        "workers that calculate, samples a second of all but a study's first quarter",
        f"  this process, one core          {one:12,.0f}",
        f"  this process, {cores:2} cores          {here:12,.0f}"
        f"   ({here / one / cores:.0%} of {cores} times one core)",
    ]
    for n, each in shared.items():
        said = f"{n} workers of {cores // n} cores"
        lines.append(f"  {said:32}{each:12,.0f}   (Dask's loss {1 - each / here:6.1%})")
    return lines, 1 / one


def main() -> None:
    """Measure; print and keep."""
    from jblast.files import write_text

    lines = [
        f"Sharing a study: {os.cpu_count()} cores, load average "
        f"{os.getloadavg()[0]:.1f} before",
    ]
    measured, each = workers_lines()
    lines += measured
    lines += ["", f"simulated workers, tiles of {TILE_S:g} s, {EACH} for each"]
    efficiency = {n: simulated(n) for n in SIMULATED}
    lines += [f"  {n:2} workers: efficiency {e:.1%}" for n, e in efficiency.items()]
    worst = efficiency[SIMULATED[-1]]
    lines += ["", f"cost model: {each:.3g} s a sample of 16 sensors on one core"]
    for cores in (2, 64, 1024):
        hours = 1e12 * each / (cores * worst) / 3600
        lines.append(f"  1e12 samples on {cores:5,} cores: {hours:12,.1f} h")
    text = "\n".join(lines) + "\n"
    print(text)
    write_text(KEPT, text)


if __name__ == "__main__":
    main()
