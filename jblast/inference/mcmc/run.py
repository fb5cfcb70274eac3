"""Sampling until the quantiles are precise enough: the loop around every sampler.

The chain is drawn in segments. Convergence is judged after the first `FIRST_JUDGED`
steps, and then each time the number of steps has grown by a factor of `JUDGED_AGAIN`.
The walk ends when the Monte Carlo error of the 5 and 95 % quantiles is below the
requested precision, at the most steps, or at Ctrl-C, and draws made until then are
returned.

A walk can be stored and resumed: a folder of numbered `.npz` files, one for each
segment, with arrays only, each written completely or not at all.
"""

import signal
import threading
import time
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.files import replacing
from jblast.inference.mcmc.convergence import (
    Convergence,
    Pace,
    Report,
    convergence,
    nothing,
)
from jblast.inference.mcmc.engines import (
    Emcee,
    Engine,
    Scan,
    Segment,
    WalkState,
    mixture_of,
)
from jblast.inference.whitening import Density, densities

Sampler = Literal["emcee", "scan"]
ENGINES: dict[str, Engine] = {"emcee": Emcee(), "scan": Scan()}
# A fit raises it to 4 per unknown: half of the walkers move by the differences of the
# other half, which have to span all unknowns.
WALKERS = 64
# Monte Carlo error of a quantile [sd]: the width of a 90 % interval is then precise to
# 2 %. It takes some 1,800 effective samples of a normal.
PRECISION = 0.05
# Enough for autocorrelation times up to 400 steps (`convergence.LONG_ENOUGH`). A chain
# that needs more is reported, not continued.
MAX_STEPS = 20_000
BLOCK = 100
"""Steps of a segment, which is the unit that is stored: Ctrl-C loses no more."""
# Earlier checks could not pass: even an autocorrelation time of 8 steps needs as many.
FIRST_JUDGED = 400
JUDGED_AGAIN = 1.15
"""Factor on the number of steps from one check to the next: no more than 15 % of the
steps are superfluous, and the checks take a constant share of the time."""
RETRY_SHRINK = 0.5
"""Factor on the distance from the optimum of a walker whose density is zero."""
# 0.5^40 is 1e-12: such a walker starts at the optimum itself
TRIES = 40
TOLERANCE = 1e-6
"""Relative and absolute difference of densities above which a stored chain is of
another posterior. Rounding on another processor is far smaller."""
RANDOM = "random_"  # prefix of arrays with the state of the random numbers


class Start(NamedTuple):
    """A normal from which a share of the walkers starts, and of the independence moves.

    Attributes:
        center: Mean.
        root: One standard deviation along each axis, one column each.
        share: Share of the walkers.
    """

    center: Float[np.ndarray, " free"]
    root: Float[np.ndarray, "free free"]
    share: float


class Sampled(NamedTuple):
    """A chain of an ensemble.

    Attributes:
        chain: All steps, from the first.
        log_density: ln of the density at each.
        convergence: Convergence of the chain.
        reached: True if the requested precision was reached.
        interrupted: True if Ctrl-C ended it.
        resumed: Number of steps stored by earlier runs.
        seconds: Duration of this run.
    """

    chain: Float[np.ndarray, "step walker free"]
    log_density: Float[np.ndarray, "step walker"]
    convergence: Convergence
    reached: bool
    interrupted: bool
    resumed: int
    seconds: float


@dataclass(frozen=True)
class Store:
    """A folder with a stored chain.

    Attributes:
        folder: Its path; created by the first write.
    """

    folder: Path

    def begin(self, about: Mapping[str, np.ndarray]) -> None:
        """Write the identity of the chain.

        Raises:
            InputError: The folder cannot be written.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._write("about.npz", about)
        except OSError as error:
            raise InputError(
                f"{self.folder}: cannot be written ({error.strerror}); expected a "
                "folder for the chain"
            ) from None

    def about(self) -> dict[str, np.ndarray] | None:
        """Return the identity of the stored chain; None if there is none."""
        path = self.folder / "about.npz"
        return _read(path) if path.exists() else None

    def keep(self, first: int, segment: Segment) -> None:
        """Write a segment that begins after `first` steps."""
        if len(segment.chain):
            random = {RANDOM + name: array for name, array in segment.random.items()}
            self._write(
                f"steps-{first:08d}.npz",
                {
                    "chain": segment.chain,
                    "log_density": segment.log_density,
                    **random,
                },
            )

    def segments(self) -> list[Segment]:
        """Return all stored segments, in order.

        Raises:
            InputError: A file is damaged, or one is missing between others.
        """
        found, steps = [], 0
        for path in sorted(self.folder.glob("steps-*.npz")):
            arrays = _read(path)
            if path.name != f"steps-{steps:08d}.npz" or not {
                "chain",
                "log_density",
            } <= set(arrays):
                raise InputError(
                    f"{path}: expected the segment that begins after step {steps}, got "
                    "another file: one is missing, or is of another chain; remove the "
                    "folder to start again"
                )
            random = {
                name.removeprefix(RANDOM): array
                for name, array in arrays.items()
                if name.startswith(RANDOM)
            }
            found.append(Segment(arrays["chain"], arrays["log_density"], random))
            steps += len(arrays["chain"])
        return found

    def _write(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        with replacing(self.folder / name) as part, part.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)


def sample(
    density: Density,
    starts: Sequence[Start],
    axes: Float[np.ndarray, "free free"],
    *,
    seed: int = 0,
    walkers: int = WALKERS,
    precision: float = PRECISION,
    most_steps: int = MAX_STEPS,
    sampler: Sampler = "emcee",
    store: Store | None = None,
    report: Report = nothing,
) -> Sampled:
    """Draw from a density until its quantiles are precise enough.

    Args:
        density: Density in whitened coordinates $w$.
        starts: Normals from which the walkers start.
        axes: Matrix $A$: convergence is checked for $A w$.
        seed: Seed of all random numbers.
        walkers: Number of walkers; even, and at least twice the unknowns.
        precision: Largest Monte Carlo error of the 5 and 95 % quantile of any
            coordinate, in its standard deviations.
        most_steps: Largest number of steps.
        sampler: Name of the sampler.
        store: Folder in which the chain is stored, and from which it is resumed.
        report: Function that is called with `Progress`.

    Raises:
        InputError: An argument is out of range, or `store` has another chain.
    """
    _check(walkers, len(axes), precision, most_steps, sampler)
    begun = time.monotonic()
    engine = ENGINES[sampler]
    done = [] if store is None else _kept(store, density, sampler, walkers, axes)
    state = done[-1].end if done else _first(density, starts, seed, walkers, sampler)
    steps = resumed = sum(len(segment.chain) for segment in done)
    center, root, share = map(np.array, zip(*starts, strict=True))
    mixture = mixture_of(center, root, share)
    # at fixed numbers of steps, so that a resumed chain is checked when an unbroken one
    # is
    check, checks = float(FIRST_JUDGED), []
    while check < most_steps:
        checks.append(int(check // BLOCK) * BLOCK)
        check *= JUDGED_AGAIN
    pace = Pace(steps, most_steps, walkers, precision, checks)

    def tick():
        pace.done += engine.tick_steps
        report(pace.now())

    interrupted = False
    with interrupts() as noted:
        while steps < most_steps and not (interrupted or noted):
            if steps in checks:
                judged = _judged(done, axes)
                if judged.reached(precision):
                    break
                pace.judged = judged
                report(pace.now())
            # up to the next full block: after an interruption the segments are the same
            # as those of an unbroken chain
            ahead = min(BLOCK - steps % BLOCK, most_steps - steps)
            segment = engine.walk(density, mixture, state, ahead, tick)
            interrupted = segment.interrupted
            if len(segment.chain):
                # appended before it is written: what is on the disk is always reported
                done.append(segment)
                if store is not None:
                    store.keep(steps, segment)
                state = segment.end
                steps = pace.done = steps + len(segment.chain)
    interrupted = interrupted or bool(noted)
    if not done:  # interrupted before the first segment
        raise KeyboardInterrupt
    judged = _judged(done, axes)
    return Sampled(
        np.concatenate([segment.chain for segment in done]),
        np.concatenate([segment.log_density for segment in done]),
        judged,
        judged.reached(precision),
        interrupted,
        resumed,
        time.monotonic() - begun,
    )


def _check(walkers, free, precision, most_steps, sampler) -> None:
    if sampler not in ENGINES:
        raise InputError(f"sampler: expected emcee or scan, got {sampler!r}")
    if walkers < 2 * free or walkers % 2:
        raise InputError(
            f"walkers: expected an even number, at least twice the {free} unknowns, "
            f"got {walkers}"
        )
    if not precision > 0:
        raise InputError(f"precision: expected a positive number, got {precision}")
    if most_steps < 1:
        raise InputError(f"most_steps: expected at least 1, got {most_steps}")


def _judged(done: Sequence[Segment], axes) -> Convergence:
    return convergence(np.concatenate([segment.chain for segment in done]) @ axes.T)


def _first(density, starts: Sequence[Start], seed, walkers, sampler) -> WalkState:
    """Draw the starting points of the walkers, each with a finite density."""
    rng = np.random.default_rng(seed)
    shares = np.cumsum([start.share for start in starts])
    # systematic sampling: each start gets its share of the walkers, rounded
    of = np.searchsorted(shares / shares[-1], (np.arange(walkers) + 0.5) / walkers)
    center = np.array([start.center for start in starts])[of]
    root = np.array([start.root for start in starts])[of]
    away = np.einsum("nij,nj->ni", root, rng.standard_normal(center.shape))
    for _ in range(TRIES):
        value = np.array(densities(density, jnp.asarray(center + away)), float)
        if np.isfinite(value).all():
            return WalkState(center + away, value, ENGINES[sampler].first_random(seed))
        away = np.where(np.isfinite(value)[:, None], away, RETRY_SHRINK * away)
    raise InputError(
        "the posterior density is zero or NaN at the optimum from which the walkers "
        "start; expected a finite density"
    )


def _kept(store: Store, density, sampler, walkers, axes) -> list[Segment]:
    """Return the segments stored in a folder, if they are of this density."""
    about = {
        "sampler": np.array(sampler),
        "walkers": np.array(walkers),
        "axes": np.asarray(axes),
    }
    of = store.about()
    if of is None:
        store.begin(about)
        return []
    for name in ("sampler", "walkers"):
        if str(of.get(name)) != str(about[name]):
            raise InputError(
                f"{store.folder}: expected a chain of {name} {about[name]}, got one of "
                f"{of.get(name)}; give another folder, or the same {name}"
            )
    done = store.segments()
    # the density is not stored: it is evaluated again at the last positions and
    # compared
    same = "axes" in of and of["axes"].shape == axes.shape
    if same and done:
        end = done[-1].end
        value = np.asarray(densities(density, jnp.asarray(end.walkers)))
        same = np.allclose(value, end.log_density, rtol=TOLERANCE, atol=TOLERANCE)
    if not same:
        raise InputError(
            f"{store.folder}: expected a chain of this log and scene, got one of "
            "another: its densities differ; give another folder"
        )
    return done


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        raise InputError(
            f"{path}: expected a segment of a chain, got a file that is damaged or of "
            "another kind; remove the folder to start again"
        ) from None


@contextmanager
def interrupts() -> Iterator[list[int]]:
    """Leave the block at Ctrl-C and record it.

    A KeyboardInterrupt raised within a destructor is swallowed by Python. Then the
    record remains, which the loop checks.

    Yields:
        A list with one entry for each interrupt. Only the main thread receives signals.
    """
    noted: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()

    def note(number, frame):
        noted.append(number)
        raise KeyboardInterrupt

    if main and before is signal.default_int_handler:
        signal.signal(signal.SIGINT, note)
    try:
        yield noted
    except KeyboardInterrupt:
        noted.append(signal.SIGINT)
    finally:
        if signal.getsignal(signal.SIGINT) is note:
            signal.signal(signal.SIGINT, before)
