"""Does `jblast.discovery` find laws that are known, and at which noise not?

    python -m calibration.discovery [--out calibration/results/discovery.png]
        > calibration/results/discovery.txt
    python -m calibration.discovery intervals [--seeds 150] [--workers 2]

Simulated: the drag of a Hummingbird in a swinging wind, and the motor lag of a
Crazyflie under stepped commands, 50 and 200 rows a second. To each, normal noise, 20
seeds a level (0 to 19).

How to read the table: "exact" is the share of seeds in which exactly the true terms
came out; "missing" and "false" are mean numbers of terms; "error" is the largest
relative error of a coefficient, the median over the exact ones; "holds" the share whose
equations, integrated from the start, stay within 10 % of the spread of the clean
record; "law" the share that foretells stretches that its terms and coefficients have
not seen, "whole" the share of which terms beyond the search explain no more than noise.

Then records in which there is no law to find, or not among the candidates (products of
up to two columns, and |x| x): in how many a law is told without a doubt. They are white
noise, a walk of normal steps, noise that remembers 0.8 of the row before, each of 401
rows with and without an input, and du/dt = -0.2 u - 0.05 u^3 + push, seeds 0 to 19.

Intervals: how many of discovery's 90 % intervals hold the truth, counted in 150 records
of the same equations with normal noise of 0.3, 1 and 3 %? Of the records in which
exactly the true terms came out, the share of all true coefficients inside their
intervals; beside it two standard errors of the share, the coefficients of a record
counted as one draw, and the same of each coefficient. Begun again, it goes on where it
was. Writes calibration/results/discovery_intervals.txt.
"""

import argparse
import functools
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from calibration import run_part
from jblast import vehicle
from jblast.constants import FLIGHT_GRAVITY
from jblast.discovery.equations import CLOSE, Discovery, discover, misfit
from jblast.discovery.sparse_regression import Candidates, polynomial
from jblast.files import write_text
from jblast.report.colours import COLOURS
from jblast.report.figures import MARKERS, log_ticks, new_figure, quiet, titled
from jblast.report.view import aligned

NOISES = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Noise relative to a state's standard deviation."""
SEEDS = 20
"""Records for each noise level: a share then has a standard error of 0.1."""
MEMBERS = 40
"""Members of each ensemble: enough for the majority and for rough quantiles."""
ROWS_APART_S = 0.02
"""Time between two rows of a flight [s]: 50 a second, as a flight log has."""
GUST_M_S, GUST_PERIOD_S = 14.0, 4.0
"""Amplitude [m/s] and period [s] of the wind, declared."""
FLIGHT_S = 16.0
"""Duration of the flight [s], four periods of the wind, while the vehicle stays
level."""
COMMANDS = (0.9, 1.1, 0.95, 1.2, 0.8, 1.05, 0.85, 1.15)
"""Commanded rotor speeds in turn, relative to the speed at hover."""
COMMAND_S = 0.4
"""Duration of each command [s], much longer than the motor lag."""
ROWS_WITHOUT_LAW = 401
RESULT = Path(__file__).parent / "results" / "discovery_intervals.txt"
INTERVAL_NOISES = (0.003, 0.01, 0.03)
Job = tuple[str, float, int]
Held = dict[str, dict[str, bool]]


def main() -> None:
    """Print the tables; draw the figure."""
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


@dataclass(frozen=True)
class Outcome:
    """Results of the noisy records of one equation.

    Attributes:
        case: Name of the case.
        state: State of the equation.
        noise: Noise relative to the state's standard deviation.
        seeds: Number of records.
        exact: Share of records in which exactly the true terms are found.
        missing: Mean number of missing true terms.
        false: Mean number of false terms.
        error: Median over exact records of the largest relative error of a coefficient;
            NaN without exact records.
        reproduced: Share of records whose integrated equations give the clean record.
        law: Share of records whose equations predict held-out segments.
        whole: Share of records whose residuals are no more than noise.
    """

    case: str
    state: str
    noise: float
    seeds: int
    exact: float
    missing: float
    false: float
    error: float
    reproduced: float
    law: float
    whole: float


@dataclass(frozen=True)
class Case:
    """Record without noise, with its true equations.

    Attributes:
        name: Name of the case.
        names: Names of the states, then of the inputs.
        time_s: Times of the rows.
        states: States at the rows.
        inputs: Inputs at the rows.
        held: Whether inputs are constant until the next row.
        candidates: Candidate terms.
        truth: Coefficients of the terms of each state.
        outside: Terms outside of the search that residuals are compared with.
    """

    name: str
    names: tuple[str, ...]
    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    held: bool
    candidates: Candidates
    truth: dict[str, dict[str, float]]
    outside: Candidates | None = None


def noise_sweep(
    case: Case, noises: Sequence[float] = NOISES, seeds: int = SEEDS
) -> list[Outcome]:
    """Return the outcomes of a case at several noise levels."""
    return [
        outcome for noise in noises for outcome in _outcomes(case, noise, range(seeds))
    ]


def noisy_states(case: Case, noise: float, seed: int) -> np.ndarray:
    """Return a record with normal noise, independent from row to row."""
    drawn = noise * np.random.default_rng(seed).standard_normal(case.states.shape)
    return case.states + drawn * np.std(case.states, axis=0)


def found_in(case: Case, states: np.ndarray, seed: int) -> Discovery:
    """Return the equations found in a record of a case."""
    return discover(
        case.time_s,
        states,
        case.inputs,
        names=case.names,
        candidates=case.candidates,
        outside=case.outside,
        held=case.held,
        members=MEMBERS,
        seed=seed,
    )


def _outcomes(case: Case, noise: float, seeds: Sequence[int]) -> list[Outcome]:
    """Return one outcome for each state."""
    rows: list[list[tuple[float, ...]]] = [[] for _ in case.truth]
    for seed in seeds:
        found = found_in(case, noisy_states(case, noise, seed), seed)
        # Against the clean record: the equations are compared with the truth, not with
        # the noise.
        holds = misfit(found.predicted, case.states, 0.0) <= CLOSE
        for state, true in enumerate(case.truth.values()):
            judged = found.judged[state]
            rest = holds[state], judged.law, judged.whole
            rows[state].append((*_against(found, state, true), *map(float, rest)))
    return [
        Outcome(case.name, state, noise, len(row), *_summary(row))
        for state, row in zip(case.truth, rows, strict=True)
    ]


def _against(
    found: Discovery, state: int, true: dict[str, float]
) -> tuple[float, float, float, float]:
    """Return exactness, missing and false terms, and error."""
    terms = set(found.terms(state))
    missing, false = float(len(set(true) - terms)), float(len(terms - set(true)))
    # Coefficients of another set of terms have no true value.
    if missing or false:
        return 0.0, missing, false, np.nan
    place = [found.candidates.names.index(name) for name in true]
    value = np.array(list(true.values()))
    error = np.max(np.abs(found.coefficients[state, place] / value - 1.0))
    return 1.0, 0.0, 0.0, float(error)


def _summary(rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
    """Return the means, and the median error of exact records."""
    exact, missing, false, error, *shares = np.array(rows, float).T
    any_exact = bool(np.any(exact))
    return (
        float(np.mean(exact)),
        float(np.mean(missing)),
        float(np.mean(false)),
        # The median, as a single near miss would dominate a mean.
        float(np.nanmedian(error)) if any_exact else np.nan,
        *(float(np.mean(share)) for share in shares),
    )


@functools.cache
def drag_case() -> Case:
    r"""Return a Hummingbird in an oscillating wind: drag of u and w.

    With u and w the airspeed, ahead and up, and |U| its magnitude,
    $$dv_x/dt = -(k_d \Sigma\Omega/m)\, u - (c_{Dx}/m) |U| u$$
    $$dv_z/dt = -(k_z \Sigma\Omega/m)\, w + (4 k_h/m)\, u^2 - (c_{Dz}/m) |U| w$$
    while the rotors turn as at hover and the vehicle stays level.
    """
    body = vehicle.named("hummingbird")
    speed = _hover_speed(body)

    def wind(time: Float[Array, ""], position: Float[Array, "3"]) -> Float[Array, "3"]:
        gust = GUST_M_S * jnp.sin(2.0 * jnp.pi * time / GUST_PERIOD_S)
        return jnp.stack([gust, jnp.zeros_like(gust), jnp.zeros_like(gust)])

    flight = vehicle.simulate(
        body,
        _hovering(speed),
        duration_s=FLIGHT_S,
        # Ten steps a row, so that the error of the integrator is far below the noise.
        step_s=ROWS_APART_S / 10.0,
        wind=wind,
        store_every=10,
    )
    time = np.asarray(flight.time_s)
    # The wind again at the rows, as the input of the search.
    gust = GUST_M_S * np.sin(2.0 * np.pi * time / GUST_PERIOD_S)
    mass, turning = float(body.mass_kg), 4.0 * speed
    drag, frame = (np.asarray(body.rotor_drag), np.asarray(body.frame_drag))
    return Case(
        "drag of a vehicle",
        ("v_x", "v_z", "wind_x"),
        time,
        np.asarray(flight.velocity_m_s)[:, [0, 2]],
        gust[:, None],
        False,
        Candidates(("1", "u", "w", "u^2", "u w", "w^2", "|U| u", "|U| w"), _in_air),
        {
            "v_x": {
                "u": -float(drag[0]) * turning / mass,
                "|U| u": -float(frame[0]) / mass,
            },
            "v_z": {
                "w": -float(drag[2]) * turning / mass,
                "u^2": 4.0 * float(body.translational_lift) / mass,
                "|U| w": -float(frame[2]) / mass,
            },
        },
        # The next degree in the airspeed, of which the true law has no term.
        outside=Candidates(("u^3", "u^2 w", "u w^2", "w^3"), _cubes_in_air),
    )


def _in_air(values: Float[np.ndarray, "place column"]) -> np.ndarray:
    """Return the candidates of drag from $v_x$, $v_z$ and the wind."""
    u, w = values[:, 0] - values[:, 2], values[:, 1]
    both = np.hypot(u, w)
    return np.stack(
        [np.ones_like(u), u, w, u**2, u * w, w**2, both * u, both * w], axis=1
    )


def _cubes_in_air(values: Float[np.ndarray, "place column"]) -> np.ndarray:
    """Return products of three speeds through the air."""
    u, w = values[:, 0] - values[:, 2], values[:, 1]
    return np.stack([u**3, u**2 * w, u * w**2, w**3], axis=1)


@functools.cache
def motor_case() -> Case:
    r"""Return a rotor of a Crazyflie that follows commands: its lag.

    $$d\Omega/dt = (\Omega_c - \Omega)/\tau_m$$
    """
    body = vehicle.named("crazyflie")
    speed = _hover_speed(body)
    commands, lag = speed * np.asarray(COMMANDS), float(body.motor_lag_s)
    flight = vehicle.simulate(
        body,
        _hovering(speed),
        duration_s=COMMAND_S * len(commands),
        step_s=ROWS_APART_S / 20.0,
        control=vehicle.Commands(np.repeat(commands[:, None], 4, axis=1), COMMAND_S),
        store_every=10,
    )
    time = np.asarray(flight.time_s)
    nth = np.floor(time / COMMAND_S + 1e-6).astype(
        int
    )  # a row at a change belongs to the next command
    names = ("speed", "command")
    return Case(
        "lag of a motor",
        names,
        time,
        np.asarray(flight.rotor_speed_rad_s)[:, :1],
        commands[np.minimum(nth, len(commands) - 1)][:, None],
        True,
        polynomial(names),
        {"speed": {"speed": -1.0 / lag, "command": 1.0 / lag}},
        outside=polynomial(names, 3),
    )


def _hover_speed(body: vehicle.Vehicle) -> float:
    """Return the speed at which four rotors carry the weight [rad/s]."""
    weight = float(body.mass_kg) * FLIGHT_GRAVITY
    return float(np.sqrt(weight / 4.0 / float(body.thrust_coefficient)))


def _hovering(speed: float) -> vehicle.State:
    """Return a level vehicle at rest."""
    return vehicle.State(
        np.array([0.0, 0.0, 50.0]),
        np.zeros(3),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.zeros(3),
        np.full(4, speed),
    )


CASES: dict[str, Callable[[], Case]] = {
    "drag": drag_case,
    "motor": motor_case,
}


def outcomes_text(outcomes: Sequence[Outcome]) -> str:
    """Return a table with a row for each equation and noise level."""
    head = "of,noise,exact,missing,false,error,holds,law,whole"
    rows: list[tuple[str, ...]] = [tuple(head.split(","))]
    for o in outcomes:
        rows.append(
            (
                f"{o.case}, {o.state}",
                f"{100.0 * o.noise:g} %",
                f"{o.exact:.2f}",
                f"{o.missing:.2f}",
                f"{o.false:.2f}",
                "-" if math.isnan(o.error) else f"{100.0 * o.error:.2g} %",
                f"{o.reproduced:.2f}",
                f"{o.law:.2f}",
                f"{o.whole:.2f}",
            )
        )
    return "\n".join(aligned(rows)) + "\n"


def noise_figure(outcomes: Sequence[Outcome]) -> Figure:
    """Draw the share of records with exactly the true terms, and coefficient errors."""
    figure = new_figure(11.0, 4.4)
    left, right = figure.subplots(1, 2)
    keys = list(dict.fromkeys((o.case, o.state) for o in outcomes))
    for nth, key in enumerate(keys):
        own = [o for o in outcomes if (o.case, o.state) == key and o.noise > 0.0]
        noise = [100.0 * o.noise for o in own]
        style = {
            "color": COLOURS[nth],
            "marker": MARKERS[nth],
            "markersize": 5,
            "label": ", ".join(key),
        }
        left.plot(noise, [100.0 * o.exact for o in own], **style)
        right.plot(noise, [100.0 * o.error for o in own], **style)
    for axes in (left, right):
        quiet(axes)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, (0.08, 35.0))
        axes.set_xlabel("noise, share of the state's spread [%]")
    right.set_yscale("log")
    log_ticks(right.yaxis, right.get_ylim())
    left.set_ylim(-4.0, 104.0)
    left.set_ylabel("records [%]")
    right.set_ylabel("largest error of a coefficient, median [%]")
    titled(left, "Records with exactly the true terms")
    titled(right, "Coefficients of these records")
    left.legend(frameon=False, fontsize=9, loc="lower left")
    return figure


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
            certain = judged.law and judged.whole and found.reproduced[0]
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


@functools.cache
def _cubic_motion() -> np.ndarray:
    """Return the motion of a body with cubic drag that is pushed."""
    time = np.linspace(0.0, 20.0, ROWS_WITHOUT_LAW)
    return solve_ivp(
        lambda t, u: -0.2 * u - 0.05 * u**3 + np.interp(t, time, _push(time)),
        (0.0, 20.0),
        [3.0],
        t_eval=time,
        rtol=1e-9,
        atol=1e-9,
        max_step=0.05,
    ).y[0]


def _cubic(noise: float):
    """Return what makes records of this motion."""

    def make(rng: np.random.Generator):
        time, clean = np.linspace(0.0, 20.0, ROWS_WITHOUT_LAW), _cubic_motion()
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
    jax.config.update("jax_enable_x64", True)
    name, noise, seed = job
    case = CASES[name]()
    found = found_in(case, noisy_states(case, noise, seed), seed)
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
    parser.add_argument("--seeds", type=int, default=150)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--kept", type=Path, default=Path("out/intervals.jsonl"))
    parser.add_argument("--out", type=Path, default=RESULT)
    asked = parser.parse_args()
    jobs = [
        (name, noise, seed)
        for name in CASES
        for noise in INTERVAL_NOISES
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
        for noise in INTERVAL_NOISES:
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
