"""Fit a blast to one log, or to several logs one after another.

A fit reads the log, chooses the laws, draws from the posterior and collects what the
draws identify, with warnings. `fit_each` fits several logs independently; a log that
fails is reported, and the others are fitted all the same. Predictive bands for figures
are quantiles of posterior draws along a line away from the charge.

One program per layout is compiled, and decisions are made in Python, so a fit cannot be
put under `jit`; `many.fit_many` can.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import InputError
from jblast.inference.answer import Answer, joint_mode
from jblast.inference.density import Density
from jblast.inference.fitting.fit_input import Laws, fit_input
from jblast.inference.fitting.solution import Solution, solution_of, solve
from jblast.inference.fitting.summary import Summary, summary_of
from jblast.inference.mcmc import Ensemble, ensemble
from jblast.inference.posterior.parameters import Parameters, as_seen
from jblast.kept_programs import kept, kept_between_runs
from jblast.observations import Observations, resolve_positions
from jblast.observations.clocks import untied_flashes
from jblast.observations.grouping import located
from jblast.observations.records.formats import Scaling
from jblast.observations.scenes import for_log
from jblast.observations.table import SAMPLES, some_rows
from jblast.parameters import CLOCK_OFFSET
from jblast.progress import Progress, each, reported, stages
from jblast.quantities import DIRECTIONS, TIMED
from jblast.results import Note, assumption, warning
from jblast.scene import Scene, UncertainScene, freed as with_free
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors import Layout, record
from jblast.sensors.forward_model import path_to
from jblast.sensors.layout import components
from jblast.sensors.simulated_readings import Noise

Method = Literal["weighted", "emcee"]
DRAWS = 4000
"""Draws of equal weight for figures and files."""
# The bounds of a band are then precise to 5 % of its width, which a figure does not
# resolve. Each draw costs one evaluation at every point of a line.
DRAWS_IN_BANDS = 200
STAGES = {
    "reading samples": 14.0,
    "choosing laws": 0.7,
    "searching": 1.0,
    "walking": 10.0,
    "collecting results": 0.3,
}
"""Stages of a fit with their approximate duration [s], most of it compilation."""
OF_SAMPLES = ("reading samples",)
"""Stages of logs with records of samples only."""
OF_WALKERS = ("walking",)
# points of a band, evenly spaced in ln: 5 % apart for a span of a factor of 50
POINTS = 80


@dataclass(frozen=True)
class Band:
    """Predictive band of one quantity along a line away from the charge.

    Attributes:
        quantity: A key of `observations.QUANTITIES`.
        shot: Index of the charge in the scene.
        axis: "range_m", or "time_s" for `TIMED` quantities.
        x: Ranges or times, increasing.
        q05: 5 % quantile over the posterior, without the scatter of the laws; clock
            times are on the common clock.
        answer: The law at the answer, as `Fit.predicted`.
        q95: 95 % quantile.
        valid: True where the law is within its range at the answer.
    """

    quantity: str
    shot: int
    axis: str
    x: Float[np.ndarray, " point"]
    q05: Float[np.ndarray, " point"]
    answer: Float[np.ndarray, " point"]
    q95: Float[np.ndarray, " point"]
    valid: Bool[np.ndarray, " point"]


@dataclass(frozen=True)
class Fit:
    """The fit of one log.

    Attributes:
        summary: Estimates, warnings and further results.
        observations: The log.
        solution: Density, draws, and what these identify.
        draws: Draws of equal weight of every identified parameter, in the most
            probable region, as the estimates.
        posterior_reason: Method of the intervals.
        ensemble: The walkers' chain, if they ran.
        exit_code: 0 answered, 4 answered with a problem (`Summary.problems`).
    """

    summary: Summary
    observations: Observations
    solution: Solution
    draws: Mapping[str, Float[np.ndarray, " draw"]] = field(default_factory=dict)
    posterior_reason: Note | None = None
    ensemble: Ensemble | None = None

    @property
    def answer(self) -> Answer:
        """The log at the most probable numbers."""
        return self.solution.answer

    @property
    def density(self) -> Density:
        """The posterior density."""
        return self.solution.density

    @property
    def scene(self) -> Scene:
        """The scene with the most probable numbers."""
        return self.answer.scene

    @property
    def predicted(self) -> Float[np.ndarray, " row"]:
        """The law's value at each row, in the row's unit."""
        return self.answer.predicted

    @property
    def distance(self) -> Float[np.ndarray, " row"]:
        """Slant range of each row at the answer [m]."""
        return self.answer.slant_range

    @property
    def residual(self) -> Float[np.ndarray, " row"]:
        """(Measured - predicted - shared effects) / sd of each row.

        For a lower bound it is the smallest error that satisfies it: 0 where the law
        predicts more.
        """
        return self.answer.residual

    @property
    def sd(self) -> Float[np.ndarray, " row"]:
        """Independent sd of each row: seconds for times, else in ln."""
        return self.answer.sd

    @property
    def shared(self) -> Float[np.ndarray, " row"]:
        """The shared effects at each row, same unit as `sd`."""
        return self.answer.shared

    @property
    def shot(self) -> tuple[int, ...]:
        """Index of the charge of each row."""
        return self.density.layout.shot

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, in the order of `start`."""
        return self.answer.names

    @property
    def log_evidence(self) -> float:
        """Logarithm of the probability of the log, to compare laws on one log.

        It is the integral of likelihood and priors, in the units of `sd`, with an error
        of some hundredths.
        """
        return self.solution.draws.log_evidence

    @cached_property
    def start(self) -> Float[np.ndarray, " free"]:
        """The optimum of `log_density`, in its coordinates."""
        return joint_mode(self.answer)

    @property
    def log_density(self) -> Callable[[Float[Array, " free"]], Float[Array, ""]]:
        """Return ln of the posterior density as a function of coordinates.

        It is known up to a constant, per unit of the coordinates. A coordinate is the
        logarithm of a free positive number, a free number itself, or the normal score
        of a number with a prior; all are unbounded. JAX can differentiate, compile and
        vectorise the function.
        """
        # a plain function: `jax.jit` needs a hash
        return partial(_log_density, self.density)

    def values(self, z: Float[ArrayLike, "*draw free"]) -> dict[str, Array]:
        """Return the parameters in their units at coordinates of `log_density`."""
        parameters = self.density.parameters
        each_of = zip(parameters.names, parameters.beliefs, strict=True)
        return {
            name: belief.constrain(jnp.asarray(z)[..., i])
            for i, (name, belief) in enumerate(each_of)
        }

    @cached_property
    def bands(self) -> tuple[Band, ...]:
        """Predictive band of each observed quantity and charge."""
        solution = self.solution
        there = solution.identified.resampled(DRAWS_IN_BANDS)
        return bands(
            self.density.parameters,
            self.answer.z,
            solution.identified.z[there],
            self.observations,
            self.density.layout,
            self.distance,
            self.density.laws,
        )

    @property
    def origin_time(self) -> Float[np.ndarray, " row"]:
        """Origin time of the charge of each row, on the common clock [s]."""
        times = np.array([float(charge.time_s) for charge in self.scene.charges])
        return times[list(self.shot)]

    @property
    def exit_code(self) -> int:
        """Return the exit code: 0 answered, 4 answered with a problem."""
        return 4 if self.summary.problems else 0

    def to_dict(self) -> dict[str, Any]:
        """Return the summary with values that JSON can represent."""
        return self.summary.to_dict()


def _log_density(density: Density, z: Float[Array, " free"]) -> Float[Array, ""]:
    return density.log_density(z)


@kept_between_runs()
@reported("fit")
def fit(
    log: Any,
    scene: UncertainScene | str | os.PathLike[str] | None = None,
    *,
    positions: str | os.PathLike[str] | None = None,
    one_event: bool = False,
    freed: Sequence[str] = (),
    laws: Laws = (),
    noise: Noise = "student",
    posterior: Method = "weighted",
    seed: int = 0,
    scaling: Scaling | None = None,
    high_pass_hz: float | None = None,
    progress: Progress = False,
) -> Fit:
    """Fit a blast to a log, as `jblast fit` does.

    Args:
        log: A table of any form that `jblast.read` accepts (a file, a data frame),
            several files with `one_event`, a folder or files of pressure records with
            `positions`, the result of `jblast.pick_files`, or `Observations`. A row
            that names a record is replaced by the readings of its pick.
        scene: The scene and its unknown parameters, or its file. The default is a
            surface charge of unknown mass in sea-level air, at a free position and time
            if the log can identify them, else at the origin at time 0
            (`scenes.for_log`). A fireball's growth time is free unless the scene states
            otherwise.
        positions: Table of stations: `log` is then records of pressure, to be picked.
        one_event: Treat the files as recordings of one event, each with its own clock,
            whose offset is free except for the first.
        freed: Further free parameters, for example "charge_east_m".
        laws: Laws by quantity; or words NAME, QUANTITY=NAME or "auto".
        noise: Distribution of the independent errors.
        posterior: Method of the intervals: "weighted" (draws of a mixture, weighted by
            the posterior) or "emcee" (walkers).
        seed: Seed of all random numbers.
        scaling: Scale of the records, where files do not state it.
        high_pass_hz: Corner of their recorders' first-order high-pass [Hz].
        progress: True prints progress on stderr; a function is called at each report
            with words and the finished share, 0 to 1.

    Returns:
        Estimates with their intervals, the laws with their ranges, and what the data do
        not identify; `jblast.report.summary` formats it as text.

    Raises:
        ValueError: Log and scene do not match, or there are several logs, which
            `fit_each` fits; the message states the remedy.

    Example:
        `jblast.fit("records/", positions="stations.csv")`
    """
    ready = fit_input(
        log,
        scene,
        positions=positions,
        one_event=one_event,
        freed=freed,
        laws=laws,
        scaling=scaling,
        high_pass_hz=high_pass_hz,
    )
    return _fit(
        ready.only(),
        ready.scene,
        noise=noise,
        posterior=posterior,
        seed=seed,
        scaling=scaling,
        high_pass_hz=high_pass_hz,
    )


def _fit(
    observations: Observations,
    uncertain: UncertainScene,
    *,
    noise: Noise,
    posterior: Method,
    seed: int,
    scaling: Scaling | None,
    high_pass_hz: float | None,
) -> Fit:
    """Fit one log in its scene."""
    left_out = () if SAMPLES in observations.quantity else OF_SAMPLES
    left_out += () if posterior == "emcee" else OF_WALKERS
    begin = stages({k: v for k, v in STAGES.items() if k not in left_out})
    if SAMPLES in observations.quantity:
        begin("reading samples")
        # logs without samples do not need the import of picks
        from jblast.signals.picks.pick_log import picked_log

        observations = picked_log(observations, scaling, high_pass_hz=high_pass_hz)
    # in this order: the log decides which numbers are free, then its positions are
    # resolved, then the fireball
    uncertain = for_log(uncertain, observations)
    observations = located(observations, uncertain)
    uncertain = as_seen(uncertain, observations.quantity, observations.time)
    # a flash on a clock without other readings is related to nothing else in the log
    aside = untied_flashes(observations, uncertain.scene.clock_offsets())
    set_aside = tuple(dict.fromkeys(np.array(observations.clock, object)[aside]))
    before: tuple[Note, ...] = ()
    if set_aside:
        offsets = tuple(f"{CLOCK_OFFSET}.{name}" for name in set_aside)
        before = (warning("flashes_set_aside", clocks=set_aside, parameters=offsets),)
        observations = some_rows(observations, np.flatnonzero(~aside))
    observations = resolve_positions(
        observations,
        uncertain.scene,
        uncertain.beliefs,
        is_default=uncertain.source == NO_SCENE,
    )
    solution = solve(observations, uncertain, noise=noise, seed=seed, begin=begin)
    drawn = solution.draws
    reason = assumption("draws_weighted", k_hat=drawn.k_hat, effective=drawn.effective)
    walkers = None
    if posterior == "emcee":
        begin("walking")
        walkers = ensemble(solution.density, solution.draws, seed=seed)
        solution = solution_of(solution.density, walkers.as_draws(solution.draws))
        reason = assumption("walked")
    begin("collecting results")

    def refit(log: Observations, names: Sequence[str]) -> Solution:
        return solve(log, with_free(uncertain, names), noise=noise, seed=seed)

    found = solution.identified
    there = found.resampled(DRAWS, seed)
    return Fit(
        summary=summary_of(
            observations,
            uncertain,
            solution,
            refit,
            method=posterior,
            of_sampler=walkers.notes if walkers else (),
            found_before=before,
        ),
        observations=observations,
        solution=solution,
        # numbers in a null direction have draws without meaning
        draws={
            name: solution.draws.values[there, i]
            for i, name in enumerate(found.names)
            if found.determined[i]
        },
        posterior_reason=reason,
        ensemble=walkers,
    )


@kept_between_runs()
@reported("fit_each")
def fit_each(
    logs: Any,
    scene: UncertainScene | str | os.PathLike[str] | None = None,
    *,
    positions: str | os.PathLike[str] | None = None,
    freed: Sequence[str] = (),
    laws: Laws = (),
    noise: Noise = "student",
    posterior: Method = "weighted",
    seed: int = 0,
    scaling: Scaling | None = None,
    high_pass_hz: float | None = None,
    done: Callable[[dict[str, Fit | InputError]], object] | None = None,
    progress: Progress = False,
) -> dict[str, Fit | InputError]:
    """Fit every log with the same scene. Logs of the same rows compile once.

    Args:
        logs: Several files, a table with a column `shot`, records of several shots with
            `positions`, or `Observations` by name.
        scene: As for `fit`.
        positions: As for `fit`.
        freed: As for `fit`.
        laws: As for `fit`.
        noise: As for `fit`.
        posterior: As for `fit`.
        seed: As for `fit`.
        scaling: As for `fit`.
        high_pass_hz: As for `fit`.
        done: Function that is called after each fit with the answers so far, as to
            write them: a later error or signal then loses none.
        progress: As for `fit`.

    Returns:
        By name, the fit, or the error if the log could not be read or fitted.

    Raises:
        InputError: The only file cannot be read, or the scene cannot.

    Example:
        `jblast.fit_each(["monday.csv", "tuesday.csv"], "scene.toml")`
    """
    ready = fit_input(
        logs,
        scene,
        positions=positions,
        freed=freed,
        laws=laws,
        scaling=scaling,
        high_pass_hz=high_pass_hz,
    )
    failed = {k: v for k, v in ready.logs.items() if isinstance(v, InputError)}
    answers: dict[str, Fit | InputError] = {**failed}
    for name, observations in each(ready.readable().items(), "logs"):
        try:
            answers[name] = _fit(
                observations,
                ready.scene,
                noise=noise,
                posterior=posterior,
                seed=seed,
                scaling=scaling,
                high_pass_hz=high_pass_hz,
            )
        except InputError as error:
            answers[name] = error
        if done is not None:
            done(answers)
    # in the order of the input, failed logs included
    return {name: answers[name] for name in ready.logs}


def bands(
    parameters: Parameters,
    z: Float[np.ndarray, " free"],
    draws: Float[np.ndarray, "draw free"],
    observations: Observations,
    sensors: Layout,
    distance: Float[np.ndarray, " row"],
    laws: Mapping[str, str],
) -> tuple[Band, ...]:
    """Return the band of every quantity and charge of a log.

    It extends from half the smallest to twice the largest range of the readings,
    through still air: a range has no direction for the wind. A draw with another
    position is nearer to some sensors and farther from others. At the range of a sensor
    the band shows the reading of that sensor. Between sensors the ratio of ranges is
    interpolated in ln of the range.

    Args:
        parameters: Fitted parameters.
        z: The answer.
        draws: Coordinates drawn from the posterior.
        observations: The log.
        sensors: Its rows.
        distance: Slant range of each row at the answer [m].
        laws: Name of the law for each quantity.
    """
    answer = []
    answered = parameters.scene_at(jnp.asarray(z))
    shot = sensors.shot
    for quantity, of in dict.fromkeys(zip(observations.quantity, shot, strict=True)):
        rows = np.isin(observations.quantity, quantity) & (np.array(shot) == of)
        if quantity in DIRECTIONS:  # do not depend on the range
            continue
        is_radius = quantity in TIMED
        # radii grow from the explosion on: points are spaced from the origin time
        start = float(answered.charges[of].time_s) if is_radius else 0.0
        reach = (observations.time - start if is_radius else distance)[rows]
        positive = reach[reach > 0]
        if positive.size == 0:
            continue
        x = start + np.geomspace(positive.min() / 2, positive.max() * 2, POINTS)
        nothing = np.full(POINTS, np.nan)
        one = int(np.flatnonzero(rows)[0])
        first, seen_from = observations.position[one], observations.slant_range[one]
        layout = Layout(
            quantity=(quantity,) * POINTS,
            # for radii: the position of the camera
            position=jax.device_put(np.tile(np.nan_to_num(first), (POINTS, 1))),
            slant_range=jax.device_put(np.full(POINTS, seen_from) if is_radius else x),
            time=jax.device_put(x if is_radius else nothing),
            group=(0,) * POINTS,
            shot=(of,) * POINTS,
            clock=("",) * POINTS,
        )
        needed = tuple((name, laws[name]) for name, _ in components(quantity))
        # one sensor for each distance: interpolation needs increasing ranges
        near, first_at = np.unique(np.where(rows, distance, 0.0), return_index=True)
        covered = near > 0
        value, valid = _recordings(
            parameters,
            jax.device_put(np.concatenate([z[None, :], draws])),
            layout,
            None if is_radius else sensors.only(first_at[covered]),
            jax.device_put(near[covered]),
            needed,
        )
        # the first is the answer, the others are draws
        q05, q95 = np.quantile(np.asarray(value)[1:], [0.05, 0.95], axis=0)
        answer.append(
            Band(
                quantity=quantity,
                shot=of,
                axis="time_s" if is_radius else "range_m",
                x=x,
                q05=q05,
                answer=np.asarray(value)[0],
                q95=q95,
                valid=np.asarray(valid)[0],
            )
        )
    return tuple(answer)


@kept
def _recordings(parameters, draws, layout, sensors, near, laws):
    """Return the readings of each draw along a layout; see `bands`."""

    def one(z):
        scene = parameters.scene_at(z)
        if sensors is None:
            recording = record(scene, layout, dict(laws))
            return recording.value, recording.valid
        own = path_to(scene, sensors, scene.charges[layout.shot[0]]).slant_range
        x = layout.slant_range
        further = jnp.interp(jnp.log(x), jnp.log(near), jnp.log(own / near))
        moved = replace(layout, slant_range=x * jnp.exp(further))
        recording = record(scene, moved, dict(laws))
        return recording.value, recording.valid

    return jax.vmap(one)(draws)
