"""Sampling until the quantiles are precise enough: the loop around every sampler.

The walk is drawn in segments. Convergence is judged after the first `FIRST_JUDGED`
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
    Mixture,
    Scan,
    Segment,
    WalkState,
    mixture_of,
)
from jblast.inference.whitening import Density, densities

Sampler = Literal["emcee", "scan"]
ENGINES: dict[str, Engine] = {"emcee": Emcee(), "scan": Scan()}
WALKERS = 64
PRECISION = 0.05
MOST_STEPS = 20_000
BLOCK = 100
"""Steps between what is kept."""
FIRST_JUDGED = 400
JUDGED_AGAIN = 1.15
"""The next judgement comes after so many times as many steps."""
RETRY_SHRINK = 0.5
"""A walker that starts where the density is zero tries again so much nearer."""
TRIES = 40
TOLERANCE = 1e-6
"""Densities, or positions in standard deviations, that differ by more are different."""
RANDOM = "random_"


class Start(NamedTuple):
    """Where some of the walkers start, and return to now and then: a normal.

    Attributes:
        center: Its mean.
        root: One standard deviation along each axis, a column each.
        share: Of the walkers.
    """

    center: Float[np.ndarray, " free"]
    root: Float[np.ndarray, "free free"]
    share: float


class Sampled(NamedTuple):
    """A chain of an ensemble.

    Attributes:
        chain: Every step, from the first on.
        log_density: ln of the density there.
        convergence: How far it came.
        reached: Whether that is as far as wanted.
        interrupted: Whether Ctrl-C ended it.
        resumed: Steps that were kept from an earlier run.
        seconds: Taken by this one.
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
    """A folder that holds a walk.

    Attributes:
        folder: Made when something is kept.
    """

    folder: Path

    def begin(self, about: Mapping[str, np.ndarray]) -> None:
        """Keep what the walk is of.

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
        """Return what the walk kept here is of; None if there is none."""
        path = self.folder / "about.npz"
        return _read(path) if path.exists() else None

    def keep(self, first: int, stretch: Segment) -> None:
        """Keep a stretch that begins after so many steps."""
        if len(stretch.chain):
            random = {RANDOM + name: array for name, array in stretch.random.items()}
            self._write(
                f"steps-{first:08d}.npz",
                {
                    "chain": stretch.chain,
                    "log_density": stretch.log_density,
                    **random,
                },
            )

    def stretches(self) -> list[Segment]:
        """Return all that was kept, in order.

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
                    f"{path}: expected a stretch that begins after step {steps}, got "
                    "another; a file of the chain is missing or foreign: remove the "
                    "folder to start anew"
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
    most_steps: int = MOST_STEPS,
    sampler: Sampler = "emcee",
    store: Store | None = None,
    report: Report = nothing,
) -> Sampled:
    """Draw from a density until the quantiles are known well enough.

    Args:
        density: In coordinates $w$ in which it is about round.
        starts: Where walkers start.
        axes: What is judged is $A w$, with this $A$.
        seed: Of all random numbers.
        walkers: How many; even, and at least twice the unknowns.
        precision: Largest Monte Carlo error of the 5 and 95 % quantile of any
            coordinate, in its standard deviations.
        most_steps: Stop here whatever was reached.
        sampler: Which.
        store: Where the walk is kept, and gone on from.
        report: Called with `Progress` as it goes.

    Raises:
        InputError: A number asked for makes no sense, or `store` is of something else.
    """
    _check(walkers, len(axes), precision, most_steps, sampler)
    begun = time.monotonic()
    engine = ENGINES[sampler]
    done = [] if store is None else _kept(store, density, sampler, walkers, axes)
    state = done[-1].end if done else _first(density, starts, seed, walkers, sampler)
    steps = resumed = sum(len(stretch.chain) for stretch in done)
    mixture = _mixture(starts)
    checks = _checks(most_steps)
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
            # so that a stretch cut short changes nothing of what follows
            ahead = min(BLOCK - steps % BLOCK, most_steps - steps)
            stretch = engine.walk(density, mixture, state, ahead, tick)
            interrupted = stretch.interrupted
            if len(stretch.chain):
                done.append(stretch)  # first: what is on the disk is always reported
                if store is not None:
                    store.keep(steps, stretch)
                state = stretch.end
                steps = pace.done = steps + len(stretch.chain)
    interrupted = interrupted or bool(noted)
    if not done:  # nothing to keep
        raise KeyboardInterrupt
    judged = _judged(done, axes)
    return Sampled(
        np.concatenate([stretch.chain for stretch in done]),
        np.concatenate([stretch.log_density for stretch in done]),
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


def _checks(most_steps: int) -> list[int]:
    """After how many steps a run judges itself: the same for one that was resumed."""
    steps, checks = float(FIRST_JUDGED), set()
    while steps < most_steps:
        checks.add(int(steps // BLOCK) * BLOCK)
        steps *= JUDGED_AGAIN
    return sorted(checks)


def _judged(done: Sequence[Segment], axes) -> Convergence:
    return convergence(np.concatenate([stretch.chain for stretch in done]) @ axes.T)


def _mixture(starts: Sequence[Start]) -> Mixture:
    """Return the normals that walkers start from, as independence moves take them."""
    center, root, share = zip(*starts, strict=True)
    return mixture_of(np.array(center), np.array(root), np.array(share))


def _first(density, starts: Sequence[Start], seed, walkers, sampler) -> WalkState:
    """Draw where the walkers start, each where the density is not zero."""
    rng = np.random.default_rng(seed)
    shares = np.cumsum([start.share for start in starts])
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
        "the posterior density is zero, or no number, at the optimum the walkers start "
        "from"
    )


def _kept(store: Store, density, sampler, walkers, axes) -> list[Segment]:
    """Return the walk kept in a folder, if it is of this density."""
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
    done = store.stretches()
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
            f"{path}: expected a stretch of a chain, got a file that is damaged or "
            "something else; remove the folder to start anew"
        ) from None


@contextmanager
def interrupts() -> Iterator[list[int]]:
    """End what is inside at Ctrl-C, and note it.

    One that Python raises within a destructor is swallowed there: then the note alone
    is left, for the loop to look at.

    Yields:
        A list that grows by each. Only the main thread receives signals.
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
