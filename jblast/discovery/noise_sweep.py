"""Noise level at which discovery fails, for known laws in simulated records.

Each case is a law with known terms and coefficients, a simulated record of it and the
candidates of the search. The sweep adds normal noise of increasing size and reports
whether exactly the true terms are found, and the errors of their coefficients.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast import vehicle
from jblast.constants import FLIGHT_GRAVITY
from jblast.discovery.discover import THRESHOLD, Discovery, discover, replay
from jblast.discovery.shock import EXPONENTS, shock_slowing
from jblast.discovery.sparse_regression import Candidates, polynomial, powers
from jblast.errors import InputError
from jblast.waves import sedov_taylor_shock_radius

NOISES = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Noise relative to a state's standard deviation; relative to the radius for a
shock."""
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
SHOCK_S = (4e-4, 25e-3)
"""First and last time [s], within those of Taylor's pictures of Trinity, 0.1 to
62 ms."""
SHOCK_ROWS = 60
"""Rows, evenly spaced in ln of the time, declared."""
SHOCK_KG = 20e6
"""TNT mass of Trinity [kg]: 20 kilotons."""


@dataclass(frozen=True)
class Outcome:
    """Results of the noisy records of one equation.

    Attributes:
        case: Name of the case.
        state: State of the equation.
        noise: Noise relative to the state's standard deviation, or to the radius.
        seeds: Number of records.
        exact: Share of records in which exactly the true terms are found.
        missing: Mean number of missing true terms.
        false: Mean number of false terms.
        error: Median over exact records of the largest relative error of a coefficient;
            NaN without exact records.
        covered: Share of the true coefficients of exact records inside their nominal
            90 % intervals.
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
    covered: float
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
        shock: Whether the state is the radius of a shock since the detonation.
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
    shock: bool = False
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
    if case.shock:
        # Radii are read from pictures with a relative error, and stay positive.
        return case.states * np.exp(drawn)
    return case.states + drawn * np.std(case.states, axis=0)


def found_in(case: Case, states: np.ndarray, seed: int) -> Discovery:
    """Return the equations found in a record of a case."""
    if case.shock:
        slowing = shock_slowing(
            case.time_s, states[:, 0], threshold=THRESHOLD, members=MEMBERS, seed=seed
        )
        return slowing.discovery
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
        try:
            found = found_in(case, noisy_states(case, noise, seed), seed)
        except InputError:  # with large noise the smoothed radius decreases somewhere
            for row, true in zip(rows, case.truth.values(), strict=True):
                row.append((0.0, float(len(true)), 0.0, np.nan, np.nan, 0.0, 0.0, 0.0))
            continue
        # Against the clean record: the equations are compared with the truth, not with
        # the noise.
        again = replay(
            found, case.time_s, case.states, case.inputs, held=case.held, noise=False
        )
        for state, true in enumerate(case.truth.values()):
            judged = found.judged[state]
            rest = again.reproduced[state], judged.law, judged.whole
            rows[state].append((*_against(found, state, true), *map(float, rest)))
    return [
        Outcome(case.name, state, noise, len(row), *_summary(row))
        for state, row in zip(case.truth, rows, strict=True)
    ]


def _against(
    found: Discovery, state: int, true: dict[str, float]
) -> tuple[float, float, float, float, float]:
    """Return exactness, missing and false terms, error and coverage."""
    terms = set(found.terms(state))
    missing, false = float(len(set(true) - terms)), float(len(terms - set(true)))
    # Coefficients of another set of terms have no true value.
    if missing or false:
        return 0.0, missing, false, np.nan, np.nan
    place = [found.candidates.names.index(name) for name in true]
    value = np.array(list(true.values()))
    error = np.max(np.abs(found.coefficients[state, place] / value - 1.0))
    inside = (found.low[state, place] <= value) & (value <= found.high[state, place])
    return 1.0, 0.0, 0.0, float(error), float(np.mean(inside))


def _summary(rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
    """Return the means, and the median error of exact records."""
    exact, missing, false, error, covered, *shares = np.array(rows, float).T
    any_exact = bool(np.any(exact))
    return (
        float(np.mean(exact)),
        float(np.mean(missing)),
        float(np.mean(false)),
        # The median, as a single near miss would dominate a mean.
        float(np.nanmedian(error)) if any_exact else np.nan,
        float(np.nanmean(covered)) if any_exact else np.nan,
        *(float(np.mean(share)) for share in shares),
    )


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
        commands=np.repeat(commands[:, None], 4, axis=1),
        command_step_s=COMMAND_S,
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


def shock_case() -> Case:
    r"""Return a strong shock of a point source, as large as Trinity's.

    $$dR/dt = \tfrac{2}{5} A^{5/2} R^{-3/2}, \qquad R = A t^{2/5}$$
    """
    # A shock slows down as a power of the time: equal ratios show each phase.
    time = np.geomspace(*SHOCK_S, SHOCK_ROWS)
    size = float(sedov_taylor_shock_radius(1.0, SHOCK_KG, 1.225, 1.4))  # after 1 s
    return Case(
        "slowing of a shock",
        ("R",),
        time,
        size * time[:, None] ** 0.4,
        np.empty((len(time), 0)),
        False,
        powers("R", EXPONENTS),
        {"R": {"R^-1.5": 0.4 * size**2.5}},
        shock=True,
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
    "shock": shock_case,
}
