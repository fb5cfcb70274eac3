"""The last experiments of the thesis (figures 4.7 and 4.8) as one run.

python -m calibration.flight_of_the_thesis figures
python -m calibration.flight_of_the_thesis detections
python -m calibration.flight_of_the_thesis speed

`figures` runs `scenes/flight_of_the_thesis.toml` with the physics of the thesis as
printed, as coded, and with jblast's laws: path and set points, waveform, force, torque,
path error before and after each blast, recovery time. `detections` searches the run of
20 seeds while it is recorded. `speed` times the run and its parts.
"""

import resource
import shutil
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from calibration.thesis.physics import CODED, PRINTED, Physics
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.colours import BLUE, COLOURS, INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, titled, write_figure
from jblast.report.view import aligned
from jblast.report.world import run_world
from jblast.study.missions import MissionOutcome
from jblast.study.run_detectors import RunDetectors
from jblast.study.run_files import summary_of
from jblast.study.running import Run, packets_of, prepare_run

HERE = Path(__file__).parent
SCENE = HERE / "scenes" / "flight_of_the_thesis.toml"
RESULTS = HERE / "results"
PHYSICS = {"as printed": PRINTED, "as coded": CODED, "jblast": None}
SEED, SEEDS, SECONDS = 1, 20, 60.0
AFTER_S = 5.0
"""Time after a blast that the figure shows [s]."""


def outcome_of(run: Run) -> MissionOutcome:
    """Return the outcome of a run's mission."""
    assert run.flown is not None
    assert run.flown.outcome is not None
    return run.flown.outcome


def run_by(physics: Physics | None) -> Run:
    """Return the run by another physics, or by jblast's."""
    if physics is None:
        return prepare_run(SCENE, seed=SEED)
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(shutil.copytree(SCENE.parent, folder, dirs_exist_ok=True))
        scene = scene / SCENE.name
        scene.write_text(SCENE.read_text("utf-8") + physics.toml, "utf-8")
        return prepare_run(scene, seed=SEED, load=physics.load)


def figures() -> str:
    """Draw the figures; return the table."""
    runs = {name: run_by(physics) for name, physics in PHYSICS.items()}
    write_figure(flight_figure(runs), RESULTS / "flight_of_the_thesis.png")
    write_figure(error_figure(runs), RESULTS / "flight_of_the_thesis_error.png")
    head = ["blast", "mass kg", "distance m", "before m"]
    for name in runs:
        head += [f"peak m, {name}", "recovery s"]
    rows = [head]
    ours = runs["jblast"].flown
    assert ours is not None
    for n, one in enumerate(outcome_of(runs["jblast"]).disturbances):
        charge = runs["jblast"].world.charges[n]
        away = float(ours.first.encounter.distance_m[n])
        row = [one.charge, f"{float(charge.mass_kg):.2f}", f"{away:.1f}"]
        row.append(f"{one.error_before_m:.3f}")
        for run in runs.values():
            found = outcome_of(run).disturbances[n]
            row.append(f"{found.peak_deviation_m:.3f}")
            row.append(f"{found.recovery_time_s:.2f}")
        rows.append(row)
    ends = [
        f"{name}: {sum(w.reached for w in outcome_of(run).waypoints)} of "
        f"{len(outcome_of(run).waypoints)} items reached, "
        f"{outcome_of(run).crash or 'no crash'}"
        for name, run in runs.items()
    ]
    tolerance = ours.options.tolerance_m
    note = f"recovery: the path error stays within {tolerance:g} m; inf: not in 10 s"
    return "\n".join([*aligned(rows, right=range(1, len(head))), note, *ends, ""])


def flight_figure(runs: dict[str, Run]) -> Figure:
    """Draw what figure 4.7 shows: path, waveform, force and torque."""
    figure = new_figure(12.0, 8.5)
    grid = figure.subplots(4, len(runs), squeeze=False)
    # a common scale, in which the differences of the physics are visible
    for column, (name, run) in zip(grid.T, runs.items(), strict=True):
        motion = run.flight
        assert motion is not None
        sound = [p.samples["on_board"] for p in packets_of(replace(run, film=None))]
        pressure = np.concatenate([part.values[:, 0] for part in sound])
        times = np.arange(pressure.size) / sound[0].rate_hz
        path, wave, force, torque = column
        path.plot(*np.asarray(motion.set_point_m).T[:2], color=MUTED, linewidth=1.0)
        path.plot(*motion.position_m.T[:2], color=BLUE, linewidth=1.2)
        for charge in run.world.charges:
            path.plot(*map(float, charge.position_m[:2]), "o", color=VERMILLION)
        path.set_aspect("equal")
        wave.plot(times[::8], pressure[::8], color=BLUE, linewidth=0.6)
        for axes, rows in ((force, motion.force_n), (torque, motion.moment_n_m)):
            for part, colour in zip(rows.T, COLOURS, strict=False):
                axes.plot(motion.time_s, part, color=colour, linewidth=0.8)
        for axes in column:
            quiet(axes)
        for axes in column[1:]:
            axes.set_xlim(0.0, run.seconds)
        for charge in run.world.charges:
            for axes in column[1:]:
                axes.axvline(float(charge.time_s), color=INK, linewidth=0.5, ls=":")
        titled(path, name)
        path.set_xlabel("east [m]")
        torque.set_xlabel("time [s]; dotted: a blast")
    words = ("north [m]", "sound on board [Pa]", "force [N]", "torque [N m]")
    for axes, label in zip(grid[:, 0], words, strict=True):
        axes.set_ylabel(label)
    return figure


def error_figure(runs: dict[str, Run]) -> Figure:
    """Draw what figure 4.8 shows: the path in space, and the error about each blast."""
    figure = new_figure(12.0, 7.5)
    top, bottom = figure.subfigures(2, 1, squeeze=False)[:, 0]
    for n, (name, run) in enumerate(runs.items()):
        motion = run.flight
        assert motion is not None
        axes = top.add_subplot(1, len(runs), n + 1, projection="3d")
        axes.plot(*np.asarray(motion.set_point_m).T, color=MUTED, linewidth=0.8)
        axes.plot(*motion.position_m.T, color=BLUE, linewidth=1.0)
        for charge in run.world.charges:
            axes.plot(*([float(x)] for x in charge.position_m), "o", color=VERMILLION)
        axes.set_title(name, loc="left", fontsize=10)
    axes = bottom.subplots()
    quiet(axes)
    for (name, run), colour in zip(runs.items(), COLOURS, strict=False):
        motion, flown = run.flight, run.flown
        assert motion is not None
        assert flown is not None
        axes.plot(motion.time_s, motion.path_error_m, color=colour, label=name)
        for came, one in zip(
            flown.first.encounter.arrival_s,
            outcome_of(run).disturbances,
            strict=True,
        ):
            if np.isfinite(one.recovery_time_s):
                axes.plot(float(came) + one.recovery_time_s, 0.0, "|", color=colour)
    axes.set(xlabel="time [s]; ticks: recovered", ylabel="path error [m]")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False, ncols=3, labelcolor=MUTED)
    titled(axes, "Distance from the set point")
    return figure


def detections() -> str:
    """Search the runs of all seeds; return the table."""
    rows = [["seed", "detected", "missed", "false alarms", "median latency s", "max"]]
    totals, latencies = np.zeros(3, int), []
    for seed in range(SEEDS):
        run = prepare_run(SCENE, seed=seed, seconds=SECONDS)
        shots = [charge.name for charge in run.world.scene.charges]
        detectors = RunDetectors(run.world.scene, run.arrivals, shots)
        reported = [one for part in packets_of(run) for one in detectors.take(part)]
        reported += detectors.finish()
        found = summary_of(run, reported)
        counts = found.detected, found.missed, found.false_alarms
        totals += counts
        latencies += [one.latency_s for one in reported if one.shot]
        rows.append(
            [
                *map(str, (seed, *counts)),
                f"{found.median_latency_s:.3f}",
                f"{found.max_latency_s:.3f}",
            ]
        )
        print(rows[-1], flush=True)
    rows.append(["all", *map(str, totals), f"{np.median(latencies):.3f}"])
    rows[-1].append(f"{max(latencies):.3f}")
    return "\n".join([*aligned(rows, right=range(1, 6)), ""])


def speed() -> str:
    """Time a run of 60 s and its parts, warm; return the table."""
    seconds, rows = SECONDS, [["part", "wall s", "cores s", "times real time"]]
    bare = tempfile.mkdtemp()
    text = SCENE.read_text()
    start, stop = text.index("[camera]"), text.index("[[sensor]]")
    scene = Path(bare) / "scene.toml"
    scene.write_text(text[:start] + text[stop:])
    (Path(bare) / "campus.plan").write_text(
        (SCENE.parent / "campus.plan").read_text("utf-8")
    )

    def timed(name: str, work) -> None:
        work()  # compiles
        wall, cores = time.perf_counter(), time.process_time()
        work()
        wall, cores = time.perf_counter() - wall, time.process_time() - cores
        cells = [f"{wall:.2f}", f"{cores:.2f}", f"{seconds / wall:.1f}"]
        rows.append([name, *cells])
        print(rows[-1], flush=True)

    out = Path(bare) / "run"
    run = prepare_run(scene, seed=SEED, seconds=seconds)
    timed("flight", lambda: prepare_run(scene, seed=SEED, seconds=seconds))
    timed("packets without camera", lambda: [*packets_of(run)])
    common = {"seed": SEED, "seconds": seconds, "force": True}
    timed("run without camera", lambda: run_world(scene, out, **common))
    timed(
        "the same with detectors and estimator",
        lambda: run_world(scene, out, detect=True, estimator="ekf", **common),
    )
    timed("run with camera", lambda: run_world(SCENE, out, **common))
    timed(
        "the same with detectors and estimator",
        lambda: run_world(SCENE, out, detect=True, estimator="ekf", **common),
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return "\n".join(
        [*aligned(rows, right=range(1, 4)), f"peak memory {peak:.2f} GB", ""]
    )


PARTS = {"figures": figures, "detections": detections, "speed": speed}
OUT = {
    "figures": "flight_of_the_thesis.txt",
    "detections": "run_detections.txt",
    "speed": "run_speed.txt",
}

if __name__ == "__main__":
    start_jax()
    part = sys.argv[1]
    result = PARTS[part]()
    print(result)
    write_text(RESULTS / OUT[part], result)
