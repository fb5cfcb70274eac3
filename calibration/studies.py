"""The three studies that ship, run, and what came of them.

python -m calibration.studies [weighing|survival|hearing ...] [--samples N]

- weighing: which of three layouts of six microphones weighs 1 to 100 kg best. Beside
  each other the standard deviation of ln mass that simulated fits have (rms error, and
  half of the 90 % interval over 1.645), and that of the Cramer-Rao bound.
- survival: whether each quadrotor that holds its place flies on, and survives within
  the thresholds of its model, over charge and distance; where half do, between the
  distances at which Wilson's 90 % interval still holds a half.
- hearing: from how far a microphone hears the blast, by the wind's noise on it: where
  half of 1 to 100 kg are heard, likewise.

The files of the studies are in calibration/studies; all have seed 0. `--samples` takes
another number of draws a cell than they say; what was run stands in the table. Tables
go to calibration/results/studies_NAME.txt, figures to studies_NAME.png.
"""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.colours import COLOURS
from jblast.report.figures import MARKERS, log_ticks, new_figure, quiet, write_figure
from jblast.report.study_figures import contours_figure
from jblast.report.view import aligned
from jblast.study.columns import StudyColumns, read_columns

STUDIES = Path(__file__).parent / "studies"
RESULTS = Path(__file__).parent / "results"
Q95 = 1.6448536269514722
NAMES = ("weighing", "survival", "hearing")


def ran(name: str, samples: int | None) -> tuple[StudyColumns, str]:
    """Run a study; return its samples, and what was run in words."""
    from jblast.study import read_study, run_into

    with tempfile.TemporaryDirectory() as folder:
        for path in STUDIES.glob(f"{name}*.toml"):
            text = path.read_text()
            if samples is not None and path.stem == name:
                said = next(x for x in text.splitlines() if x.startswith("samples"))
                text = text.replace(said, f"samples = {samples}")
            (Path(folder) / path.name).write_text(text)
        study = read_study(Path(folder) / f"{name}.toml")
        begun = time.perf_counter()
        found = run_into(study, Path(folder) / "store")
        seconds = time.perf_counter() - begun
        columns = read_columns(str(Path(folder) / "store"))
    return columns, (
        f"{name}: {found.samples:,} samples, {study.samples} draws of each cell asked "
        f"for, seed {study.seed}; calculated in {seconds:.0f} s, compiling included, "
        "beside others"
    )


def lane(columns: StudyColumns, name: str):
    """Return an outcome that no sensor, or one, has."""
    return next(one for one in columns.lanes if one.name == name)


def even(distance: np.ndarray, share: np.ndarray) -> float:
    """Return where a share that falls with distance last passes a half; NaN: nowhere.

    Interpolated in the logarithm of distance.
    """
    above = np.flatnonzero(share >= 0.5)
    if not above.size or above[-1] == len(share) - 1:
        return float("nan")
    n = above[-1]
    part = (share[n] - 0.5) / (share[n] - share[n + 1])
    near, far = np.log(distance[n : n + 2])
    return float(np.exp(near + part * (far - near)))


def first_even(distance: np.ndarray, share: np.ndarray) -> float:
    """Return where a share that grows with distance last passes a half; likewise."""
    return even(distance, 1.0 - share)


def weighing(columns: StudyColumns) -> tuple[list[str], Figure]:
    """Tell how well each layout weighs, by fits and by the bound."""
    layouts, masses = columns.word_axes[0], columns.numeric_axes[0]
    rows = [
        (
            *("layout", "mass [kg]", "rms error", "interval", "bound"),
            *("inside [%]", "n", "far"),
        )
    ]
    figure = new_figure(7.0, 4.2)
    axes = figure.subplots()
    quiet(axes)
    for n, layout in enumerate(layouts.words):
        curves = []
        for m, mass in enumerate(masses.values):
            mask = (layouts.at == n) & (masses.at == m)
            error = lane(columns, "fit_error").values[mask]
            known = error[np.isfinite(error)]
            width, bound = (
                np.nanmedian(lane(columns, name).values[mask]) / (2 * Q95)
                for name in ("fit_interval_width", "fit_bound_width")
            )
            inside = lane(columns, "fit_truth_inside").statistics(mask)
            rms = float(np.sqrt(np.mean(known**2)))
            curves.append((rms, width, bound))
            rows.append(
                (
                    *(layout.removeprefix("weighing_"), f"{mass:.3g}", f"{rms:.4f}"),
                    *(f"{width:.4f}", f"{bound:.4f}", f"{100 * inside['share']:.1f}"),
                    f"{known.size:,}",
                    f"{np.sum(np.abs(known) > 4 * bound)}",
                )
            )
        rms, width, bound = np.array(curves).T
        colour, name = COLOURS[n], layout.removeprefix("weighing_")
        axes.plot(
            masses.values, bound, color=colour, linewidth=1.4, label=f"{name}, bound"
        )
        axes.plot(
            masses.values,
            rms,
            MARKERS[n],
            color=colour,
            label=f"{name}, fits: rms error",
        )
    axes.set_xscale("log")
    log_ticks(axes.xaxis, (masses.values[0], masses.values[-1]))
    axes.set_ylim(bottom=0)
    axes.set_xlabel("charge [kg]")
    axes.set_ylabel("standard deviation of ln mass")
    axes.legend(fontsize=8, frameon=False)
    head = "standard deviation of ln mass; interval: half the 90 % interval / 1.645"
    return [head, *aligned(rows, right=(1, 2, 3, 4, 5, 6, 7))], figure


def contours(
    columns: StudyColumns, name: str, labels, where, distance: str
) -> list[tuple[str, ...]]:
    """Return where half are yes, for each word and value of the other axis."""
    away = next(axis for axis in columns.numeric_axes if axis.name == distance)
    of, rows = lane(columns, name), []
    for words, mask in labels:
        shares = []
        for n in range(away.values.size):
            found = of.statistics(mask & (away.at == n))
            shares.append([found[key] for key in ("share", "low", "high")])
        ends = [where(away.values, share) for share in np.array(shares).T]
        least, most = sorted(ends[1:]) if np.isfinite(ends[1:]).all() else ends[1:]
        told = ("none" if np.isnan(x) else f"{x:.4g}" for x in (ends[0], least, most))
        rows.append((*words, *told))
    return rows


def survival(columns: StudyColumns) -> tuple[list[str], Figure]:
    """Tell from where on half of the vehicles fly on, and survive."""
    models = columns.word_axes[0]
    masses = next(a for a in columns.numeric_axes if a.name == "charge_mass_kg")
    labels = [
        ((model, f"{mass:.3g}"), (models.at == n) & (masses.at == m))
        for n, model in enumerate(models.words)
        for m, mass in enumerate(masses.values)
    ]
    lines = [
        "distance [m] beyond which half do; none: half at no distance within 2 to 64"
    ]
    for name in ("flies_on", "survives"):
        rows = [("vehicle", "charge [kg]", "half", "from", "to")]
        rows += contours(columns, name, labels, first_even, "charge_east_m")
        lines += ["", name, *aligned(rows, right=(1, 2, 3, 4))]
    kept = tuple(one for one in columns.lanes if one.name == "flies_on")
    figure = contours_figure(replace(columns, lanes=kept))
    return lines, figure


def hearing(columns: StudyColumns) -> tuple[list[str], Figure]:
    """Tell from how far half of the blasts are heard, by the wind's noise."""
    noise = next(a for a in columns.axes if a.name == "ambient.level_pa")
    away = next(a for a in columns.numeric_axes if a.name == "charge_east_m")
    levels = [noise.shown(n) for n in range(noise.values.size)]
    labels = [((word,), noise.at == n) for n, word in enumerate(levels)]
    rows = [("noise [Pa]", "half heard [m]", "from", "to")]
    rows += contours(columns, "detected", labels, even, "charge_east_m")
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    quiet(axes)
    of = lane(columns, "detected")
    for n, (words, mask) in enumerate(labels):
        found = [of.statistics(mask & (away.at == m)) for m in range(away.values.size)]
        share, low, high = ([f[k] for f in found] for k in ("share", "low", "high"))
        axes.plot(
            away.values, share, color=COLOURS[n], marker=MARKERS[n], markersize=4,
            linewidth=1.4, label=f"{words[0]} Pa",
        )  # fmt: skip
        axes.fill_between(away.values, low, high, color=COLOURS[n], alpha=0.15)
    axes.set_xscale("log")
    axes.set_xlabel("distance [m]")
    axes.set_ylabel("share of 1 to 100 kg that is heard")
    axes.legend(fontsize=8, frameon=False, title="wind's noise, rms", title_fontsize=8)
    head = (
        "distance up to which half are heard, and where the 90 % interval holds a half"
    )
    return [head, *aligned(rows, right=(0, 1, 2, 3))], figure


def main() -> None:
    """Run studies; print and keep."""
    parser = argparse.ArgumentParser(description="Run the studies that ship.")
    parser.add_argument("name", nargs="*", metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--samples", type=int, help="draws of each cell")
    asked = parser.parse_args()
    if unknown := [name for name in asked.name if name not in NAMES]:
        parser.error(f"no study {unknown[0]!r}: expected {', '.join(NAMES)}")
    start_jax(all_cores=True)
    for name in asked.name or NAMES:
        columns, said = ran(name, asked.samples)
        lines, figure = globals()[name](columns)
        text = "\n".join([said, *columns.notes, "", *lines]) + "\n"
        print(text)
        write_text(RESULTS / f"studies_{name}.txt", text)
        write_figure(figure, RESULTS / f"studies_{name}.png")


if __name__ == "__main__":
    main()
