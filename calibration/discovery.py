"""Does `jblast.discovery` find laws that are known, and at which noise not?

    python -m calibration.discovery --out calibration/results/discovery.png
        > calibration/results/discovery.txt
    python -m calibration.discovery intervals [--seeds 200] [--workers 2]

Simulated: the drag of a Hummingbird in a swinging wind, the motor lag of a Crazyflie
under stepped commands, 50 and 200 rows a second (`discovery/noise_sweep.py`), and a
strong shock of a point source, 60 radii. To each, normal noise, 20 seeds a level (0 to
19). Shocks: Trinity's radii (calibration/data/trinity.csv; and with the zero of time
moved), and the radius of 1 kg on the ground by Kingery and Bulmash and by
`shock_kinematics`, in three ranges, with 1 % of noise (seed 0).

How to read the table: "exact" is the share of seeds in which exactly the true terms
came out; "missing" and "false" are mean numbers of terms; "error" is the largest
relative error of a coefficient, the median over the exact ones; "in 90 %" the share of
true coefficients inside their 90 % intervals; "holds" the share whose equations,
integrated from the start, stay within 10 % of the spread of the clean record; "law"
the share that foretells stretches its coefficients have not seen, "whole" the share of
which no more is left over than noise leaves, tested on records the equations made.

Then records in which there is no law to find, or not among the candidates (products of
up to two columns, and |x| x): in how many a law is told without a doubt. They are white
noise, a walk of normal steps, noise that remembers 0.8 of the row before, each of 401
rows with and without an input, and du/dt = -0.2 u - 0.05 u^3 + push, seeds 0 to 19.

Intervals: how many of discovery's 90 % intervals hold the truth, counted in many
records?

The equations of `discovery/noise_sweep.py`, normal noise of 1 %, seeds 0 to 199. Of the
records in which exactly the true terms came out, the share of all true coefficients
inside their intervals; beside it two standard errors of the share, the coefficients of
a record counted as one draw, and the same of each coefficient. Begun again, it goes on
where it was. Writes calibration/results/discovery_intervals.txt.
"""

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import jax
import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from calibration import run_part
from jblast.discovery.discover import discover, replay
from jblast.discovery.noise_sweep import (
    CASES,
    MEMBERS,
    found_in,
    noise_sweep,
    noisy_states,
)
from jblast.discovery.shock import shock_slowing
from jblast.discovery.sparse_regression import polynomial
from jblast.errors import InputError
from jblast.files import write_text
from jblast.observations import read
from jblast.report.discovery import outcomes_text, slowing_text
from jblast.report.discovery_figures import noise_figure
from jblast.waves import kingery_bulmash_arrival_time, shock_kinematics_arrival_time

TRINITY = Path(__file__).parent / "data" / "trinity.csv"
SHIFTS_S = (0.0, -2e-5, 2e-5)
"""Of the zero of time: a fifth of the first interval between two photographs."""
RANGES = ((0.1, 2.0), (0.5, 5.0), (2.0, 40.0))
"""Of scaled distance [m/kg^(1/3)]: near, middle, far."""
NOISE = 0.01
ROWS = 60
ROWS_WITHOUT_LAW = 401
SEEDS = 20
LAWS = {
    "Kingery and Bulmash": kingery_bulmash_arrival_time,
    "shock_kinematics": shock_kinematics_arrival_time,
}


RESULT = Path(__file__).parent / "results" / "discovery_intervals.txt"
NOISES = (0.01,)
Job = tuple[str, float, int]
Held = dict[str, dict[str, bool]]


def main() -> None:
    """Print the table and the shocks; draw the figure."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", metavar="FIGURE.png")
    asked = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    outcomes = []
    for name, build in CASES.items():
        outcomes += noise_sweep(build())
        sys.stderr.write(f"{name} done\n")
    print(outcomes_text(outcomes))
    if asked.out:
        noise_figure(outcomes).savefig(asked.out)
    print(without_law())
    photographs = read(TRINITY)
    for shift in SHIFTS_S:
        moved = f", time {1e6 * shift:+.0f} µs" if shift else ""
        print(f"Trinity, {len(photographs)} radii{moved}")
        print(slowing_text(shock_slowing(photographs.time + shift, photographs.value)))
    for near, far in RANGES:
        radius = np.geomspace(near, far, ROWS)
        drawn = np.exp(NOISE * np.random.default_rng(0).standard_normal(ROWS))
        for law, arrival in LAWS.items():
            print(f"{law}, 1 kg, {near:g} to {far:g} m, {100 * NOISE:g} % of noise")
            time = np.asarray(arrival(radius, 1.0))
            print(slowing_text(shock_slowing(time, radius * drawn)))


def without_law() -> str:
    """Return a table of records whose law is none, or not among the candidates."""
    text = f"{'no law among the candidates':44}terms  law   whole  certain\n"
    for name, make in RECORDS.items():
        told = []
        for seed in range(SEEDS):
            time, states, inputs = make(np.random.default_rng(seed))
            names = ("u", "push")[: 1 + inputs.shape[1]]
            candidates, outside = (
                polynomial(names, degree, signed_squares=True) for degree in (2, 3)
            )
            found = discover(
                time,
                states,
                inputs,
                names=names,
                candidates=candidates,
                outside=outside,
                members=MEMBERS,
                seed=seed,
            )
            judged = found.judged[0]
            holds = replay(found, time, states, inputs).reproduced[0]
            certain = judged.law and judged.whole and holds
            told.append((len(found.terms(0)), judged.law, judged.whole, certain))
        terms, law, whole, sure = np.mean(told, axis=0)
        text += f"{name:44}{terms:<7.2f}{law:<6.2f}{whole:<7.2f}{sure:.2f}\n"
    return text


def _noise(memory: float, push: bool):
    """Return what makes records of noise that remembers a share of the row before."""

    def make(rng: np.random.Generator):
        time = np.linspace(0.0, 20.0, ROWS_WITHOUT_LAW)
        states = lfilter([1.0], [1.0, -memory], rng.standard_normal(ROWS_WITHOUT_LAW))
        return time, np.reshape(states, (-1, 1)), _push(time)[:, None][:, : int(push)]

    return make


def _cubic(noise: float):
    """Return what makes records of a body with cubic drag that is pushed."""
    time = np.linspace(0.0, 20.0, ROWS_WITHOUT_LAW)
    clean = solve_ivp(
        lambda t, u: -0.2 * u - 0.05 * u**3 + np.interp(t, time, _push(time)),
        (0.0, 20.0),
        [3.0],
        t_eval=time,
        rtol=1e-9,
        atol=1e-9,
        max_step=0.05,
    ).y[0]

    def make(rng: np.random.Generator):
        states = clean + noise * np.std(clean) * rng.standard_normal(len(clean))
        return time, states[:, None], _push(time)[:, None]

    return make


def _push(time: np.ndarray) -> np.ndarray:
    return 2.0 * np.sin(1.3 * time) + 1.2 * np.sin(0.47 * time + 1.0)


RECORDS = {
    "white noise": _noise(0.0, push=False),
    "white noise beside an input": _noise(0.0, push=True),
    "a walk": _noise(1.0, push=False),
    "a walk beside an input": _noise(1.0, push=True),
    "noise that remembers 0.8": _noise(0.8, push=False),
    "cubic drag, 0.1 % of noise": _cubic(0.001),
    "cubic drag, 1 % of noise": _cubic(0.01),
    "cubic drag, 3 % of noise": _cubic(0.03),
    "cubic drag, 10 % of noise": _cubic(0.1),
}


def held(job: Job) -> Held:
    """Return which intervals hold the truth, by state of exact equations and term."""
    import jax

    jax.config.update("jax_enable_x64", True)
    name, noise, seed = job
    case = CASES[name]()
    try:
        found = found_in(case, noisy_states(case, noise, seed), seed)
    except InputError:  # noise so large that the radius shrinks somewhere
        return {}
    answer = {}
    for state, (label, true) in enumerate(case.truth.items()):
        if set(found.terms(state)) != set(true):
            continue
        places = [found.candidates.names.index(term) for term in true]
        low, high = found.low[state, places], found.high[state, places]
        value = np.array(list(true.values()))
        inside = (low <= value) & (value <= high)
        answer[label] = dict(zip(true, inside.tolist(), strict=True))
    return answer


def intervals() -> None:
    """Count, print the table and keep it."""
    parser = argparse.ArgumentParser(description="Count intervals that hold the truth.")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--kept", type=Path, default=Path("out/intervals.jsonl"))
    parser.add_argument("--out", type=Path, default=RESULT)
    asked = parser.parse_args()
    jobs = [
        (name, noise, seed)
        for name in CASES
        for noise in NOISES
        for seed in range(asked.seeds)
    ]
    found = counted(asked.kept)
    left = [job for job in jobs if job not in found]
    with (
        ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool,
        asked.kept.open("a") as lines,
    ):
        for job, one in zip(left, pool.map(held, left), strict=True):
            found[job] = one
            lines.write(json.dumps([*job, one]) + "\n")
            lines.flush()
    text = table(found, asked.seeds)
    write_text(asked.out, text)
    sys.stdout.write(text)


def counted(kept: Path) -> dict[Job, Held]:
    """Return what was counted before, so that it goes on there."""
    kept.parent.mkdir(parents=True, exist_ok=True)
    lines = kept.read_text().splitlines() if kept.exists() else []
    rows = map(json.loads, lines)
    return {(name, noise, seed): one for name, noise, seed, one in rows}


def table(found: dict[Job, Held], seeds: int) -> str:
    """Return a line for each equation and noise."""
    text = f"Intervals of 90 %: how many hold the truth, {seeds} records a line\n\n"
    text += f"{'of':24s}noise  exact  in 90 %   2 se  of each coefficient\n"
    for name in CASES:
        case = CASES[name]()
        for noise in NOISES:
            for label in case.truth:
                rows = [
                    one[label]
                    for job, one in found.items()
                    if job[:2] == (name, noise) and label in one
                ]
                if not rows:
                    continue
                inside = np.array([[*row.values()] for row in rows], float)
                each = inside.mean(axis=0)
                error = 2.0 * inside.mean(axis=1).std() / np.sqrt(len(rows))
                of_each = ", ".join(
                    f"{term} {share:.2f}"
                    for term, share in zip(rows[0], each, strict=True)
                )
                text += (
                    f"{f'{case.name}, {label}':24s}{100 * noise:4.1f} %{len(rows):7d}"
                )
                text += f"{inside.mean():9.3f}{error:7.3f}  {of_each}\n"
    return text


if __name__ == "__main__":
    run_part({"laws": main, "intervals": intervals})
