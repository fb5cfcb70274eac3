"""Recovery, deviation and detection over charge and distance: 1,000 random worlds.

python -m calibration.world_studies

A world is one blast on the ground: 1 to 100 kg, 10 m to 10 km away, both uniform in the
logarithm, from any side. A Hummingbird holds its place 3 m up with integral action, all
flown as one batch; it carries a microphone and a camera. Seed 0.

- Thrown: its greatest path error, past Z = 40 m/kg^(1/3) by laws carried on; recovered:
  when it is back within 5 cm for good.
- Heard: 8,000 samples a second in white noise of 100 dB (2 Pa, declared: rotors), by
  the house's matched filter with one template, 10 kg at 300 m, at one false alarm an
  hour, within 20 ms of the arrival. The air absorbs, and does not refract.
- Seen: by the rate of the house's test of growing discs at one false alarm an hour,
  0.990 of fireballs 10 to 50 px wide (`visual_detector.txt`); smaller ones count as not
  seen, which nobody measured, larger ones as those. The lens has 260 px.

Shares have Wilson's 95 % intervals.
"""

import argparse
import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.figure import Figure

from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.colours import COLOURS, MUTED
from jblast.report.figures import new_figure, quiet, titled, write_figure
from jblast.report.view import aligned
from jblast.scene import Charge, Instrument, Scene, Sensor, VehicleSpec
from jblast.sensors import recording
from jblast.signals import (
    blast_template,
    filtered,
    matched_kernel,
    threshold_for,
    white_noise,
)
from jblast.study.statistics import wilson_interval
from jblast.vehicle import (
    blast_load,
    flight_metrics,
    hold_of,
    simulate,
    start_of,
    vehicle_of,
)
from jblast.waves.fireball import fireball, fireball_duration

WORLDS, SEED = 1000, 0
MASSES_KG, DISTANCES_M = (1.0, 100.0), (10.0, 1e4)
UP_M, ARRIVAL_S, SECONDS, STEP_S = 3.0, 0.25, 8.0, 1e-3
TOLERANCE_M = 0.05
RATE_HZ, NOISE_PA, NEAR_S = 8000.0, 2.0, 0.02
TEMPLATE_KG, TEMPLATE_M = 10.0, 300.0
FOCAL_PX, LEAST_PX, SEEN = 260.0, 10.0, 0.990
EDGES_M = np.geomspace(*DISTANCES_M, 13)
CLASSES_KG = (1.0, 10.0**0.667, 10.0**1.333, 100.0)


class Worlds(NamedTuple):
    """What was drawn, and what came of it; a world in each place.

    Attributes:
        mass_kg: Of the charge.
        distance_m: On the ground.
        deviation_m: Greatest path error; NaN of one that crashed.
        recovery_s: From the arrival; infinite: not within the flight.
        crashed: Whether it hit the ground or was lost.
        heard: Whether the filter told.
        seen: Whether the test of the camera told.
    """

    mass_kg: Float[np.ndarray, " world"]
    distance_m: Float[np.ndarray, " world"]
    deviation_m: Float[np.ndarray, " world"]
    recovery_s: Float[np.ndarray, " world"]
    crashed: Bool[np.ndarray, " world"]
    heard: Bool[np.ndarray, " world"]
    seen: Bool[np.ndarray, " world"]


def worlds() -> Worlds:
    """Draw the worlds, and return what came of them."""
    rng = np.random.default_rng(SEED)
    mass, distance = (
        np.exp(rng.uniform(np.log(least), np.log(most), WORLDS))
        for least, most in (MASSES_KG, DISTANCES_M)
    )
    side, luck = rng.uniform(0.0, 2.0 * np.pi, WORLDS), rng.uniform(size=WORLDS)
    spec = VehicleSpec("hummingbird", np.array([0.0, 0.0, UP_M]), integral=True)

    def scene_of(mass: Any, east: Any, north: Any) -> Scene:
        charge = Charge(mass, (east, north, 0.0 * east), 0.0, burst="surface")
        comes = blast_load(Scene(charge)).arrival_time_s(spec.position)[0]
        time = ARRIVAL_S - comes
        return Scene(Charge(mass, charge.position_m, time, burst="surface"))

    places = distance * np.cos(side), distance * np.sin(side)
    scenes = jax.jit(jax.vmap(scene_of))(*map(jnp.asarray, (mass, *places)))
    deviation, recovery, crashed = _flown(scenes, spec)
    width = FOCAL_PX * _widest(mass) / distance
    return Worlds(
        mass,
        distance,
        np.where(crashed, np.nan, deviation),
        np.where(crashed, np.inf, recovery),
        crashed,
        _heard(scenes),
        (width >= LEAST_PX) & (luck < SEEN),
    )


def _flown(scenes: Scene, spec: VehicleSpec) -> tuple[np.ndarray, ...]:
    vehicle, start = vehicle_of(spec), start_of(spec)
    starts = jax.tree.map(lambda x: jnp.broadcast_to(x, (WORLDS, *x.shape)), start)
    flown = simulate(
        vehicle,
        starts,
        duration_s=SECONDS,
        step_s=STEP_S,
        control=hold_of(spec, integral=True),
        loads=(jax.vmap(blast_load)(scenes),),
        ground_up_m=0.0,
        store_every=10,
    )
    metrics = flight_metrics(
        flown,
        jnp.asarray(spec.held),
        ARRIVAL_S,
        tolerance_m=TOLERANCE_M,
        ground_up_m=0.0,
    )
    crashed = np.asarray(metrics.crashed) | np.asarray(flown.lost)
    return (
        np.asarray(metrics.peak_deviation_m),
        np.asarray(metrics.recovery_time_s),
        crashed,
    )


def _heard(scenes: Scene) -> Bool[np.ndarray, " world"]:
    """Return which blasts the matched filter finds at the arrival's sample."""
    ear = Sensor(
        "ear",
        np.array([0.0, 0.0, UP_M]),
        "pressure",
        instrument=Instrument(rate=RATE_HZ, noise=NOISE_PA),
    )
    record = jax.jit(jax.vmap(lambda s, key: recording(s, ear, key).samples(1.0)))
    samples = np.asarray(record(scenes, jax.random.split(jax.random.key(SEED), WORLDS)))
    template = blast_template(TEMPLATE_KG, TEMPLATE_M, RATE_HZ)
    kernel = matched_kernel(template, RATE_HZ, white_noise(NOISE_PA, RATE_HZ))
    first, last = (round((ARRIVAL_S + d) * RATE_HZ) for d in (-NEAR_S, NEAR_S))
    found = np.zeros(WORLDS, bool)
    for n, one in enumerate(samples):
        found[n] = filtered(one, kernel)[first:last].max() > threshold_for(kernel)
    return found


def _widest(mass: np.ndarray) -> np.ndarray:
    """Return the greatest diameter of fireballs while they glow [m]."""
    share = jnp.linspace(0.01, 1.0, 100)
    life = fireball_duration(jnp.asarray(mass))
    radius = jax.vmap(lambda s: fireball(jnp.asarray(mass), s * life).radius)(share)
    return 2.0 * np.asarray(radius).max(axis=0)


def wilson(kept: int, of: int) -> tuple[float, float, float]:
    """Return a share and the ends of Wilson's 95 % interval."""
    if not of:
        return np.nan, np.nan, np.nan
    low, high = wilson_interval(kept / of, of, 0.95)
    return kept / of, float(low), float(high)


def outcomes(found: Worlds) -> dict[str, Bool[np.ndarray, " world"]]:
    """Return what there is a probability of."""
    return {
        "crashes": found.crashed,
        "thrown past 5 cm": found.crashed | (found.deviation_m > TOLERANCE_M),
        "seen": found.seen,
        "heard": found.heard,
    }


def table(found: Worlds) -> str:
    """Return medians and shares by distance."""
    rows = [["from m", "to m", "worlds", "deviation m", "95 %", "recovery s", "95 %"]]
    rows[0] += [f"{name} [95 %]" for name in outcomes(found)]
    for low, high in itertools.pairwise(EDGES_M):
        here = (found.distance_m >= low) & (found.distance_m < high)
        deviation, recovery = found.deviation_m[here], found.recovery_s[here]
        row = [f"{low:.0f}", f"{high:.0f}", f"{here.sum()}"]
        for values in (deviation[np.isfinite(deviation)], recovery):
            some = np.quantile(values, (0.5, 0.95), method="higher")
            row += [f"{x:.3g}" if np.isfinite(x) else "-" for x in some]
        for what in outcomes(found).values():
            share, least, most = wilson(int(what[here].sum()), int(here.sum()))
            row.append(f"{share:.3f} {least:.3f} to {most:.3f}")
        rows.append(row)
    lead = (
        f"{WORLDS} random worlds, one blast each; written by "
        "calibration/world_studies.py, seed 0. A dash: not back within the flight."
    )
    return "\n".join([lead, "", *aligned(rows, right=range(len(rows[0])))]) + "\n"


def study_figure(found: Worlds) -> Figure:
    """Draw deviation, recovery and probabilities against distance."""
    figure = new_figure(11.0, 7.6)
    (thrown, back), (shares, by_mass) = figure.subplots(2, 2)
    for n, (low, high) in enumerate(itertools.pairwise(CLASSES_KG)):
        some = (found.mass_kg >= low) & (found.mass_kg <= high)
        label = f"{low:.2g} to {float(f'{high:.2g}'):g} kg"
        dots: dict[str, Any] = {"s": 8, "color": COLOURS[n], "linewidths": 0}
        thrown.scatter(
            found.distance_m[some], found.deviation_m[some], label=label, **dots
        )
        away = some & (found.recovery_s > 0) & np.isfinite(found.recovery_s)
        back.scatter(found.distance_m[away], found.recovery_s[away], **dots)
        _curve(by_mass, found, found.heard & some, some, n, label)
    thrown.axhline(TOLERANCE_M, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    thrown.set(xscale="log", yscale="log", ylim=(1e-6, 40.0))
    thrown.set_ylabel("greatest path error [m]")
    thrown.legend(frameon=False, fontsize=8)
    crashes = f"dashes: 5 cm; {found.crashed.sum()} of {WORLDS} crash, not shown"
    titled(thrown, "How far it is thrown", crashes)
    back.set(xscale="log", xlim=(9.0, 110.0))
    back.set_ylabel("back within 5 cm after [s]")
    never = int((~np.isfinite(found.recovery_s)).sum())
    note = f"if thrown farther; {never} not in {SECONDS:g} s"
    titled(back, "How soon it is back", note)
    everyone = np.ones(WORLDS, bool)
    for n, (name, what) in enumerate(outcomes(found).items()):
        if not what.any():
            continue  # the table has its interval
        _curve(shares, found, what, everyone, n, name)
    titled(shares, "What a blast is", "Wilson's 95 % intervals")
    titled(by_mass, "Heard, by charge", "in noise of 100 dB; 1 alarm an hour")
    for axes in (shares, by_mass):
        axes.set(xscale="log", ylim=(-0.03, 1.03), xlim=thrown.get_xlim())
        axes.set_ylabel("share of worlds")
        axes.legend(frameon=False, fontsize=8, loc="lower left")
    shares.legend(frameon=False, fontsize=8, loc=(0.03, 0.72))
    for axes in (thrown, back, shares, by_mass):
        quiet(axes)
        axes.set_xlabel("distance [m]")
    return figure


def _curve(
    axes: Any, found: Worlds, what: np.ndarray, among: np.ndarray, n: int, label: str
) -> None:
    """Draw a share by distance, with its intervals."""
    middles, rows = [], []
    for low, high in itertools.pairwise(EDGES_M):
        here = (found.distance_m >= low) & (found.distance_m < high) & among
        if here.any():
            middles.append(np.sqrt(low * high))
            rows.append(wilson(int(what[here].sum()), int(here.sum())))
    share, least, most = np.array(rows).T
    axes.plot(middles, share, color=COLOURS[n], linewidth=1.6, label=label)
    axes.fill_between(middles, least, most, color=COLOURS[n], alpha=0.18, linewidth=0)


def main() -> None:
    """Draw, fly, listen, keep and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", default="calibration/results/world_studies.png")
    options.add_argument("--table", default="calibration/results/world_studies.txt")
    asked = options.parse_args()
    start_jax(quick=True)
    found = worlds()
    write_text(asked.table, table(found))
    write_figure(study_figure(found), asked.out)
    print(table(found), end="")


if __name__ == "__main__":
    main()
