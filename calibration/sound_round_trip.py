"""From sound back to the blast: do 90 % intervals hold the truth?

    python -m calibration.sound_round_trip > calibration/results/sound_round_trip.txt

Four microphones on the ground hear a charge whose mass, place and time are drawn from
their priors, in pink ambient noise; each record is searched by a matched filter as
`jblast detect` does it, the arrivals and their sigmas become a log, and the log is
fitted. The noise is as loud as makes 2E/N0 = 20 dB of the middle charge at the middle
range, at 48,000 samples a second. All is simulated, seed 19; laws are exact, so that
nothing but the sound makes an error.

The template is that of the middle charge at the middle range (5 kg, 80 m), as one who
knows nothing better would take; or, for comparison, that of the very blast at the very
microphone.
"""

import sys
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.cli.jax_start import start_jax
from jblast.inference import ManyFits, batch_of, fit_many
from jblast.observations import Observations
from jblast.observations.records.stations import Station
from jblast.progress import each
from jblast.scene import (
    Ambient,
    Charge,
    Instrument,
    LogNormal,
    Normal,
    Scene,
    Sensor,
    UncertainScene,
    draw_scene,
)
from jblast.sensors import recording, waves
from jblast.sensors.simulated_readings import Noise
from jblast.signals.arrival_log import log_of
from jblast.signals.matched_filter import matched_kernel
from jblast.signals.noise import noise_spectrum
from jblast.signals.sound_watch import Channel, Searched, search
from jblast.signals.templates import blast_template

SCENES, SEED = 200, 19
RATE_HZ, SECONDS = 48_000.0, 1.5
PLACES = (
    *((75.0, 10.0, 0.0), (-15.0, 85.0, 0.0)),
    *((-70.0, -30.0, 0.0), (25.0, -80.0, 0.0)),
)
MASS_KG, RANGE_M = 5.0, 80.0
SNR_DB = 20.0
"""2E/N0 of the middle charge at the middle range [dB]."""
SLOPE = -3.0
"""Of the noise [dB/octave]: pink."""
LAWS = {"air_arrival_s": "shock_kinematics"}
BELIEFS = {
    "charge_mass_kg": LogNormal(MASS_KG, 1.3),
    "charge_east_m": Normal(0.0, 10.0),
    "charge_north_m": Normal(0.0, 10.0),
    "origin_time_s": Normal(0.5, 0.1),
}
NOISES: tuple[Noise, ...] = ("student", "gaussian")
"""Errors that the fit takes for granted; `jblast fit` takes the first by default."""
Q95 = 1.6449


class RoundTrip(NamedTuple):
    """What came back.

    Attributes:
        z: By the errors that the fit takes for granted, then by unknown: errors over
            standard deviations, of each scene.
        arrival_z: Of the arrivals that were heard.
        missed: Scenes left out: a microphone heard nothing, or more than one bang.
    """

    z: dict[str, dict[str, Float[np.ndarray, " scene"]]]
    arrival_z: Float[np.ndarray, "scene sensor"]
    missed: int


def ambient_pa() -> float:
    """Return the level of the noise, rms [Pa]."""
    quiet = Scene(Charge(time_s=np.inf), ambient=Ambient(level=1.0, slope=SLOPE))
    place, instrument = np.array(PLACES[0]), Instrument(RATE_HZ)
    sensor = Sensor("m", place, "microphone", instrument=instrument)
    noise = recording(quiet, sensor, jax.random.key(SEED)).samples(60.0)
    spectrum = noise_spectrum(np.asarray(noise), RATE_HZ)
    pulse = blast_template(MASS_KG, RANGE_M, RATE_HZ)
    return matched_kernel(pulse, RATE_HZ, spectrum).response / 10 ** (SNR_DB / 20)


def planned(level_pa: float) -> UncertainScene:
    """Return the scene in noise of a level [Pa], and what is not known of it."""
    scene = Scene(
        Charge(mass_kg=MASS_KG),
        sensors=tuple(
            Sensor(f"m.{n}", np.array(at), "microphone", instrument=Instrument(RATE_HZ))
            for n, at in enumerate(PLACES, start=1)
        ),
        ambient=Ambient(level=level_pa, slope=SLOPE),
        law=tuple(LAWS.items()),
        scatter=False,
    )
    return UncertainScene(scene, BELIEFS)


@eqx.filter_jit
def recorded(scene: Scene, key: Array) -> Float[Array, "sensor sample"]:
    """Return what the microphones of a scene write down [Pa]."""
    keys = jax.random.split(key, len(scene.sensors))
    return jnp.stack(
        [
            recording(scene, sensor, one).samples(SECONDS)
            for sensor, one in zip(scene.sensors, keys, strict=True)
        ]
    )


def heard(scene: Scene, samples: np.ndarray, *, own: bool) -> list[Searched]:
    """Return what is heard in each record, by its own template or the middle one."""
    mass, ranges = MASS_KG, [RANGE_M] * len(PLACES)
    if own:
        charge = scene.charge
        at = np.array(charge.position_m, float)
        mass = float(charge.mass_kg)
        ranges = np.linalg.norm(np.array(PLACES) - at, axis=1).tolist()
    return [
        search(
            Channel(f"m.{n}", "m.wav", n, row, RATE_HZ),
            [blast_template(mass, far, RATE_HZ)],
            forms=False,
        )
        for n, (row, far) in enumerate(zip(samples, ranges, strict=True), start=1)
    ]


def round_trip(scenes: int, level_pa: float, *, own: bool = False) -> RoundTrip:
    """Draw scenes, record, search, fit.

    Args:
        scenes: How many.
        level_pa: Of the noise, rms [Pa].
        own: Whether each record is searched for the very blast.
    """
    uncertain = planned(level_pa)
    stations = {f"m.{n}": Station(at, "") for n, at in enumerate(PLACES, start=1)}
    logs: list[Observations] = []
    truths: list[list[float]] = []
    arrivals = []
    missed = 0
    keys = jax.random.split(jax.random.key(SEED), (scenes, 2))
    for drawn, noise in each(list(keys), "scenes"):
        scene = draw_scene(drawn, uncertain)
        found = heard(scene, np.asarray(recorded(scene, noise)), own=own)
        log = log_of(found, stations).observations
        if log.sensor != tuple(stations):
            order = np.argsort(log.sensor)
            if [log.sensor[i] for i in order] != list(stations):
                missed += 1
                continue
            log = rows_in(log, order)
        logs.append(log)
        charge = scene.charge
        truth = [charge.mass_kg, charge.east, charge.north, charge.time_s]
        truths.append([float(x) for x in truth])
        arrivals.append((log.value - true_arrivals(scene)) / log.sigma)
    table = dict(zip(BELIEFS, np.array(truths).T, strict=True))
    batch = batch_of(logs, uncertain)
    z = {
        noise: errors_over_sd(fit_many(uncertain, *batch, noise=noise), table)
        for noise in NOISES
    }
    return RoundTrip(z, np.array(arrivals), missed)


def errors_over_sd(
    fits: ManyFits, truth_of: dict[str, Float[np.ndarray, " scene"]]
) -> dict[str, Float[np.ndarray, " scene"]]:
    """Return errors over standard deviations, by unknown; NaN where none converged."""
    # fitted coordinates count from the prior's median in its standard deviations
    z = {}
    for place, name in enumerate(fits.names):
        belief = BELIEFS[name]
        of = [belief.unconstrain(jnp.asarray(value)) for value in truth_of[name]]
        truth = np.array(of, float)
        sd = np.sqrt(np.asarray(fits.covariance)[:, place, place])
        error = (np.asarray(fits.z)[:, place] - truth) / sd
        z[name] = np.where(np.asarray(fits.converged), error, np.nan)
    return z


def rows_in(log: Observations, order: np.ndarray) -> Observations:
    """Return the rows of a log in another order."""
    names = {
        field: tuple(getattr(log, field)[i] for i in order)
        for field in ("sensor", "quantity", "path", "shot", "clock")
    }
    numbers = {
        field: getattr(log, field)[order]
        for field in ("value", "sigma", "position", "slant_range", "time")
    }
    return replace(log, **names, **numbers)


def true_arrivals(scene: Scene) -> Float[np.ndarray, " sensor"]:
    """Return when the front comes to each microphone, by the law [s]."""
    places = [sensor.position_m for sensor in scene.sensors]
    return np.array([float(waves(scene, x)[0].pulse.arrival_time) for x in places])


def table(scenes: int) -> list[str]:
    """Return the lines of the table."""
    level = ambient_pa()
    lines = [
        f"{scenes} scenes, four microphones, 2E/N0 = {SNR_DB:g} dB (pink noise of "
        f"{level:.3g} Pa): share of 90 % intervals that hold the truth",
        f"{'template':18s}{'errors':10s}{'missed':>8s}"
        + "".join(f"{name:>17s}" for name in BELIEFS)
        + f"{'arrivals: mean':>17s}{'sd':>7s}{'sd of the core':>16s}",
    ]
    for own, words in ((False, "5 kg at 80 m"), (True, "the very blast")):
        trip = round_trip(scenes, level, own=own)
        off = trip.arrival_z
        core = 1.4826 * np.median(np.abs(off - np.median(off)))
        for noise in NOISES:
            # a fit that has not converged holds nothing
            shares = [np.mean(np.abs(trip.z[noise][n]) < Q95) for n in BELIEFS]
            lines.append(
                f"{words:18s}{noise:10s}{trip.missed:8d}"
                + "".join(f"{share:17.3f}" for share in shares)
                + f"{off.mean():17.2f}{off.std():7.2f}{core:16.2f}"
            )
    return lines


def main() -> None:
    """Print the table."""
    start_jax()
    scenes = int(sys.argv[1]) if len(sys.argv) > 1 else SCENES
    print("\n".join(table(scenes)))


if __name__ == "__main__":
    main()
