"""What is left of a blast's impulse at a step longer than its pulse."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.scene import Charge, Scene
from jblast.vehicle import blast_load, named
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.flights.hold_limits import hovering

RATIOS = np.geomspace(0.03, 100.0, 15)
"""Steps, over the positive phase."""
PHASES = (np.arange(8) + 0.5) / 8
"""Where in a step the front arrives."""
LOST = 0.1
FINE = 200
"""Steps to a positive phase, of the truth."""
AFTER = 20.0
"""Positive phases after which the wave is over."""
SIZE = 6144
"""Steps that are asked about at once, at most."""
INSTANT = 1e-4
"""Of a phase: so long is a force looked at where it is sampled."""


@functools.cache
def impulse_errors() -> tuple[
    Float[np.ndarray, " ratio"],
    Float[np.ndarray, " ratio"],
    Float[np.ndarray, " ratio"],
]:
    """Return ratios of step to positive phase, and errors of the whole impulse.

    First of a force looked at where RK4 does, at both ends and in the middle, then of
    the load's own impulse; the largest of `PHASES`. Drag alone: the vehicle stays, 7 m
    from 1 kg of TNT.
    """
    load = blast_load(
        Scene(charge=Charge(mass_kg=1.0, position_m=(5.0, 0.0, 0.0))),
        front=False,
        rotors=False,
    )
    heavy = eqx.tree_at(lambda v: v.mass_kg, named("crazyflie"), jnp.asarray(1e9))
    state = hovering(heavy)
    wave = load.wave_of(load.blasts[0], state.position_m)
    arrival = float(load.arrival_time_s(state.position_m)[0])
    phase = float(wave.duration_s)
    given = jax.jit(jax.vmap(lambda a, b: load.impulse(a, b, state, heavy)[0]))

    def impulses(starts: np.ndarray, length: float) -> Float[np.ndarray, "..."]:
        # one size for all, so that it is compiled once; before the blast there is none
        filled = np.full(SIZE, -1.0)
        filled[: starts.size] = starts.ravel()
        ends = jnp.asarray(filled + length)
        found = np.asarray(given(jnp.asarray(filled), ends))[: starts.size]
        return found.reshape(*starts.shape, 3)

    fine = arrival + phase * np.arange(-1.0, AFTER, 1 / FINE)
    truth = impulses(fine, phase / FINE).sum(axis=0)
    bare, ours = [], []
    for ratio in RATIOS:
        step = ratio * phase
        count = int(np.ceil((AFTER + 1) / ratio)) + 2
        starts = arrival + step * (np.arange(count) - 1 - PHASES[:, None])
        begin, middle, end = (
            impulses(starts + along * step, INSTANT * phase) / (INSTANT * phase)
            for along in (0.0, 0.5, 1.0)
        )
        sampled = step / 6 * (begin + 4 * middle + end)
        for errors, parts in ((bare, sampled), (ours, impulses(starts, step))):
            off = np.linalg.norm(parts.sum(axis=1) - truth, axis=1)
            errors.append(off.max() / np.linalg.norm(truth))
    return RATIOS, np.array(bare), np.array(ours)


def pulse_failure() -> FailureMode:
    """Measure at which step a sampled force loses a hundredth of the impulse."""
    ratio, bare, ours = impulse_errors()
    begins = float(ratio[np.argmax(bare > LOST)])
    ten = int(np.argmin(abs(ratio - 10.0)))
    return FailureMode(
        area="flights",
        method="blast pulse as a force, RK4",
        failure=f"{LOST:.0%} of its impulse is lost or made up between the stages",
        boundary=begins,
        unit="positive phases, the step",
        beyond=f"a step of {ratio[ten]:.0f} positive phases: wrong by {bare[ten]:.0%}",
        response=verified("holds", ours.max() < 1e-3, "pulses"),
        message="a step takes its share of the impulse: wrong by "
        f"{ours.max():.1g} at most, steps of {ratio[0]:g} to {ratio[-1]:g} phases",
    )
