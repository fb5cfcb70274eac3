"""What is each correction of the thesis worth, on its own cases?

python -m calibration.thesis_worlds

The cases of Parab's thesis by three: as it prints them, as its plugins compute them
(`calibration/thesis`), and as blasts are by jblast's own laws. A Hummingbird hovers
with a microphone on it.

1. Single cases: that of its table 4.1, corners of the worlds that it prints (charges
   on the ground), and of those that its plugin draws (charges as far above the vehicle
   as east and north of it; corrected by the free-air curves). Times since
   the detonation; loudness is that of the peak, re 20 micropascals. The force's impulse
   is the greatest momentum given to a vehicle that is held; the moment's, likewise.
   Deviation is the largest path error after the blast, of the scene's hold with
   integral action.
2. 200 cases drawn from each of both worlds.
3. Events of one blast, by a camera of 346 x 260 pixels.

No noise. Seed 0 draws the cases.
"""

import argparse
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from calibration.thesis.loads import coded_angular_impulse
from calibration.thesis.physics import (
    CODED,
    PRINTED,
    Physics,
    frame_differences,
    grey_bytes,
)
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.view import aligned
from jblast.scene import (
    Camera,
    Charge,
    Scene,
    Sensor,
    UncertainScene,
    Uniform,
    look_at,
)
from jblast.scene.reader import scene_from_document
from jblast.sensors.camera import film_events, joined
from jblast.sensors.camera.film import Film
from jblast.sensors.listening import truth_of
from jblast.study.flight_results import Flown, Options
from jblast.study.flights import fly
from jblast.vehicle import start_of, vehicle_of

LAWS = Physics({}, Options.load)
WAYS = {"printed": PRINTED, "coded": CODED, "corrected": LAWS}
UP_M, TIME_S, SECONDS = 3.0, 0.5, 8.0
"""Of the hovering vehicle; of the detonation; of a flight."""
REFERENCE_PA, LISTENED = 20e-6, ("air_arrival_s", "ground_arrival_s")
PEAK = "peak_overpressure_pa"
DRAWN, SEED = 200, 0
EDGES = 4001
"""Of the steps that an impulse is added up over, 50 microseconds each."""


class Case(NamedTuple):
    """A blast as the thesis has it.

    Attributes:
        name: What it is.
        mass_kg: Of the charge.
        place_m: East, north, up.
    """

    name: str
    mass_kg: float
    place_m: tuple[float, float, float]


def cases() -> list[Case]:
    """Return the single cases."""
    found = []
    for name, mass, distance in (
        ("table 4.1", 15.0, 20.0),
        ("printed, least near", 5.0, 10.0),
        ("printed, least far", 5.0, 20.0),
        ("printed, most near", 15.0, 10.0),
    ):
        along = float(np.sqrt(distance**2 - UP_M**2))
        found.append(Case(name, mass, (along, 0.0, 0.0)))
    for name, side in (("coded, near", 10.0), ("coded, mean", 15.0), ("far", 20.0)):
        name = "coded, far" if name == "far" else name
        found.append(Case(name, 10.5, (side, side, side + UP_M)))
    return found


def scene_of(case: Case, way: Physics) -> Scene:
    """Return a case as a scene."""
    up = case.place_m[2]
    document: dict[str, Any] = {
        **way.tables,
        "charge": {
            "mass_kg": case.mass_kg,
            "position_m": list(case.place_m),
            "time_s": TIME_S,
            "burst": "free-air" if up > 0 else "surface",
        },
        "vehicle": {
            "model": "hummingbird",
            "position_m": [0.0, 0.0, UP_M],
            "control": {"integral": True},
        },
    }
    return scene_from_document(document, case.name).scene


def heard(scene: Scene, way: Physics) -> dict[str, float]:
    """Return when and how loud a blast is, and when it pushes."""
    ear = (Sensor("ear", np.array([0.0, 0.0, UP_M]), "microphone"),)
    sound = truth_of(scene, ear, {}, (*LISTENED, PEAK))
    values = {name: float(rows[0, 0]) for name, rows in sound.values.items()}
    pressure = values["air_arrival_s"] - TIME_S
    if way.pressure_speed_m_s is not None:
        away = np.asarray(scene.charge.position_m) - ear[0].position_m
        pressure = float(np.linalg.norm(away)) / way.pressure_speed_m_s
    return {
        "sound": 1e3 * (values["air_arrival_s"] - TIME_S),
        "ground": 1e3 * (values["ground_arrival_s"] - TIME_S),
        "pressure": 1e3 * pressure,
        "loudness": 20.0 * float(np.log10(values[PEAK] / REFERENCE_PA)),
    }


def given(scene: Scene, way: Physics) -> tuple[float, float]:
    """Return the greatest momentum and angular momentum given to a held vehicle."""
    assert scene.vehicle is not None
    load, vehicle = way.load(scene), vehicle_of(scene.vehicle)
    state = start_of(scene.vehicle)
    arrival = jnp.min(load.arrival_time_s(state.position_m))
    edges = arrival - 0.005 + 5e-5 * jnp.arange(EDGES, dtype=float)

    @jax.jit
    def summed(edges):
        def step(start, end):
            return load.impulse(start, end, state, vehicle)

        push, turn = jax.vmap(step)(edges[:-1], edges[1:])
        return tuple(
            jnp.max(jnp.linalg.norm(jnp.cumsum(x, axis=0), axis=-1))
            for x in (push, turn)
        )

    push, turn = summed(edges)
    return float(push), float(turn)


def flown(uncertain: UncertainScene, way: Physics, count: int) -> Flown:
    """Return the flights of scenes by one load, with the scene's hold."""
    options = {"seconds": SECONDS, "load": way.load}
    return fly(uncertain, vehicles=count, seed=SEED, **options).first


def single() -> list[list[str]]:
    """Return the table of single cases."""
    rows = [
        [
            *("case", "by", "sound ms", "pressure ms", "ground ms", "loud dB"),
            *("force N s", "moment N m s", "deviation m", "recovers s", ""),
        ]
    ]
    for case in cases():
        for words, way in WAYS.items():
            scene = scene_of(case, way)
            times, (push, turn) = heard(scene, way), given(scene, way)
            one = flown(UncertainScene(scene, source=case.name), way, 1).metrics
            back = float(one.recovery_time_s)
            fate = "crashes" if bool(one.crashed) else ""
            rows.append(
                [
                    case.name,
                    words,
                    *(f"{times[key]:.2f}" for key in ("sound", "pressure", "ground")),
                    f"{times['loudness']:.1f}",
                    f"{push:.4f}",
                    f"{turn:.5f}",
                    "-" if fate else f"{float(one.peak_deviation_m):.3f}",
                    f"{back:.2f}" if np.isfinite(back) else "-",
                    fate,
                ]
            )
    return rows


def drawn() -> list[list[str]]:
    """Return the table of worlds that were drawn: quantiles over them."""
    rows = [
        ["world", "by", *("deviation m: 5 %", "50 %", "95 %"), "crash %", "recover %"]
    ]
    beside = {
        "charge_mass_kg": Uniform(5.0, 15.0),
        "charge_east_m": Uniform(10.0, 20.0),
    }
    above = {
        "charge_mass_kg": Uniform(10.0, 11.0),
        "charge_east_m": Uniform(10.0, 20.0),
        "charge_north_m": Uniform(10.0, 20.0),
        "charge_up_m": Uniform(10.0 + UP_M, 20.0 + UP_M),
    }
    for name, beliefs, place in (
        ("printed", beside, (15.0, 0.0, 0.0)),
        ("coded", above, (15.0, 15.0, 15.0 + UP_M)),
    ):
        for words, way in WAYS.items():
            scene = scene_of(Case(name, 10.0, place), way)
            many = UncertainScene(scene, beliefs, source=name)
            metrics = flown(many, way, DRAWN).metrics
            crashed = np.asarray(metrics.crashed)
            back = np.isfinite(np.asarray(metrics.recovery_time_s)) & ~crashed
            peaks = np.where(crashed, np.nan, np.asarray(metrics.peak_deviation_m))
            deviation = np.quantile(peaks, (0.05, 0.5, 0.95))
            rows.append(
                [
                    name,
                    words,
                    *("-" if np.isnan(x) else f"{x:.3f}" for x in deviation),
                    f"{100 * crashed.mean():.1f}",
                    f"{100 * back.mean():.1f}",
                ]
            )
    return rows


def events() -> list[list[str]]:
    """Return the table of events of one blast."""
    place, frames_hz, seconds = np.array([0.0, -60.0, 3.0]), 30.0, 1.0
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, 3.0])),
        focal=np.array([260.0, 260.0]),
        center=np.array([172.5, 129.5]),
        width=346,
        height=260,
    )
    scene = Scene(Charge(15.0, time_s=0.1))
    times = np.arange(0.0, seconds, 1.0 / frames_hz)
    film = Film(scene, camera, times)
    greys = (
        (float(time), grey_bytes(frame))
        for which, some in film.frames()
        for time, frame in zip(film.times[which], some, strict=True)
    )
    blocks = list(frame_differences(greys))
    coded = (
        np.concatenate([np.full(signs.size, time) for time, signs in blocks]),
        np.concatenate([signs for _, signs in blocks]),
    )
    found = joined(film_events(film))
    ours = found.time, found.polarity
    rows = [["by", "events", "told brighter %", "first ms", "times apart"]]
    for name, (time, sign) in (("coded", coded), ("corrected", ours)):
        rows.append(
            [
                name,
                f"{time.size}",
                f"{100 * np.mean(sign > 0):.1f}",
                f"{1e3 * (time.min() - 0.1):.3f}",
                f"{np.unique(np.round(time, 6)).size}",
            ]
        )
    return rows


def report() -> str:
    """Return all tables."""
    limit = float(coded_angular_impulse(jnp.array(20.0), jnp.array(15.0)))
    lines = [
        "written by calibration/thesis_worlds.py",
        "",
        f"Single cases, {UP_M:g} m up",
        "",
        *aligned(single(), right=range(2, 10)),
        "",
        "printed: moments of the thesis's file. coded: cut at 1 N m for 4 ms; meant at",
        f"20 m, 15 kg: {limit:.1f} N m s. A dash: it crashed.",
        "",
        f"{DRAWN} cases drawn from each world",
        "",
        *aligned(drawn(), right=range(2, 7)),
        "",
        "Events of 15 kg at 60 m in 0.9 s: coded from 30 frames a second of 8-bit",
        "grey, corrected from the logarithm of light",
        "",
        *aligned(events(), right=range(1, 5)),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Compute, keep and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", default="calibration/results/thesis_worlds.txt")
    asked = options.parse_args()
    start_jax(quick=True)
    text = report()
    write_text(asked.out, text)
    print(text, end="")


if __name__ == "__main__":
    main()
