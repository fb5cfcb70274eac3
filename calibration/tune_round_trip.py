"""Do the intervals of `jblast tune` hold the truth? Records of which it is known.

    python -m calibration.tune_round_trip [sound|frames [SEEDS]]

Each case is simulated with every seed, what is named put wrong in the scene, and tuned
back. Counted is how often the truth is within the 90 % interval, how it lies in
standard deviations (mean and sd of the normal scores; 0 and 1 are wanted), and how
often the record counts as poorly explained.

Writes calibration/results/tune_round_trip.txt of sound (40 seeds) and
tune_round_trip_frames.txt (16).
"""

import copy
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import beta

from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.inference.tuning import Tuned, tune_sound
from jblast.inference.tuning.scene_file import put_values
from jblast.inference.tuning.tune_sight import look_of, tune_frames
from jblast.inference.tuning.tune_sound import RecordedSound
from jblast.inference.tuning.unknowns import tuned_value
from jblast.report.view import aligned
from jblast.scene import Scene
from jblast.scene.reader import scene_from_document
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.image import linear_to_srgb, luminance, srgb_to_linear
from jblast.sensors.camera.rendering import render
from jblast.sensors.listening import packets, plan

start_jax(quick=True)


RESULTS = Path(__file__).parent / "results"
KEPT = {
    "sound": "tune_round_trip.txt",
    "frames": "tune_round_trip_frames.txt",
}
SEEDS = {"sound": 40, "frames": 16}
NOMINAL = 0.9

MICROPHONE = {
    "name": "mic",
    "kind": "microphone",
    "position_m": [400.0, 0.0, 1.5],
    "rate_hz": 8000,
    "noise_pa": 0.002,
    "filter_hz": [30.0, 2500.0],
}
SOUND = {
    "charge": {"mass_kg": 15.0},
    "air": {"absorption": True, "absorption_scale": 1.4},
    "ambient": {"level_pa": 0.05, "slope_db_octave": -3.0},
    "sensor": [MICROPHONE],
}


CAMERA = {
    "charge": {"mass_kg": 15.0, "position_m": [0.0, 0.0, 1.0]},
    "law": {"fireball_growth_s": 0.004},
    "camera": {
        "position_m": [0.0, -40.0, 2.0],
        "look_at_m": [0.0, 0.0, 3.0],
        "width": 64,
        "height": 48,
        "focal_px": 100.0,
        "threshold": [0.25, 0.3],
        "daylight_lux": 5e4,
    },
}


class Case(NamedTuple):
    """What is simulated, and what of it is tuned.

    Attributes:
        words: What it is.
        document: The true scene's tables.
        wrong: What the scene says of what is tuned, by name.
        tuned: Returns what a seed's record tells, and the true scene.
    """

    words: str
    document: dict[str, Any]
    wrong: dict[str, float]
    tuned: "Callable[[Case, int], tuple[Tuned, Scene]]"


def heard(case: Case, seed: int) -> tuple[Tuned, Scene]:
    """Simulate what the microphone records, and tune the wrong scene to it."""
    listening = plan(scene_from_document(case.document, "true"), seed, 2.0)
    sensor = listening.sensors[0]
    samples = next(packets(listening, sensor))[:, 0]
    instrument = sensor.instrument
    assert instrument is not None
    pascals: float | None = 1.0
    if instrument.bits is not None:
        assert instrument.full_scale is not None
        samples, pascals = samples / float(instrument.full_scale), None
    wrong = put_values(copy.deepcopy(case.document), case.wrong, "mic")
    recorded = RecordedSound("mic.wav", np.asarray(samples), 0, pascals, ())
    uncertain = scene_from_document(wrong, "wrong")
    return tune_sound(uncertain, recorded, [*case.wrong]), listening.scene


def held_by(scene: Scene, index: int, name: str) -> float:
    """Return a number of a scene."""
    held = tuned_value(scene, index, name)
    assert held is not None
    return float(held)


def drawn(case: Case, seed: int) -> dict[str, Any]:
    """Return the tables of a true scene whose tuned numbers are drawn."""
    draw = np.random.default_rng(seed)
    truth = scene_from_document(case.document, "true").scene
    values = {
        name: held_by(truth, -1, name) * float(np.exp(0.3 * draw.normal()))
        for name in case.wrong
    }
    return put_values(copy.deepcopy(case.document), values, None)


def filmed(case: Case, seed: int) -> tuple[Tuned, Scene]:
    """Film a fireball, as 8 bits hold it, and tune the wrong scene to it."""
    truth = scene_from_document(drawn(case, seed), "true").scene
    assert truth.camera is not None
    times = np.arange(60) * 1e-3
    look = look_of(truth.camera)
    frames = np.asarray(render(truth, truth.camera, times, appearance=look))
    light = luminance(srgb_to_linear(srgb_bytes(frames) / 255.0))
    values = 255.0 * linear_to_srgb(np.asarray(light))
    wrong = scene_from_document(
        put_values(copy.deepcopy(case.document), case.wrong, None), "w"
    )
    return tune_frames(wrong, values, times, [*case.wrong]), truth


def beside(document: dict[str, Any], **tables: Any) -> dict[str, Any]:
    """Return tables with some keys of theirs replaced."""
    changed = copy.deepcopy(document)
    for name, entry in tables.items():
        held = changed.setdefault(name, {})
        (held[0] if isinstance(held, list) else held).update(entry)
    return changed


CASES = {
    "air, filter and noise": Case(
        "a microphone 400 m from 15 kg: air, filter and noise",
        SOUND,
        {
            "absorption_scale": 1.0,
            "ambient_level_pa": 0.2,
            "ambient_slope_db_octave": 0.0,
            "noise_pa": 0.01,
            "high_pass_hz": 10.0,
            "low_pass_hz": 3300.0,
        },
        heard,
    ),
    "clock and charge": Case(
        "the same, its clock 0.3 s off, the charge known to a factor of 1.2",
        beside(
            SOUND,
            charge={"mass_kg": {"lognormal": [15.0, 1.2]}},
            sensor={"clock_offset_s": 0.3},
        ),
        {"absorption_scale": 1.0, "noise_pa": 0.01, "clock_offset_s.mic": 0.0},
        heard,
    ),
    "full scale": Case(
        "a recorder of 16 bits that clips at 300 Pa: what a sample of 1 is, and noise",
        beside(SOUND, sensor={"full_scale_pa": 300.0, "bits": 16}),
        {"full_scale_pa": 400.0, "ambient_level_pa": 0.2, "noise_pa": 0.01},
        heard,
    ),
    "frames": Case(
        "8-bit frames, 64 x 48 at 1 kHz: growth, exposure, lens; the truth is drawn",
        CAMERA,
        {"fireball_growth_s": 2.5e-3, "camera_daylight_lux": 9e4}
        | {"camera_focal_x_px": 90.0, "camera_focal_y_px": 90.0},
        filmed,
    ),
}


def counted(case: Case, seeds: int) -> list[list[str]]:
    """Return a row for each number of a case."""
    scores: dict[str, list[float]] = {}
    inside: dict[str, list[bool]] = {}
    poor, begun = [], time.perf_counter()
    for seed in range(seeds):
        tuned, truth = case.tuned(case, seed)
        poor.append(tuned.explained.is_poor or not tuned.converged)
        for number, one in enumerate(tuned.problem.unknowns):
            found = tuned.numbers[one.name]
            value = held_by(truth, tuned.problem.evidence.index, one.name)
            if not found.identified:
                continue
            z_true = float(one.belief.unconstrain(np.asarray(value)))
            z_high = float(one.belief.unconstrain(np.asarray(found.q95)))
            sd = max((z_high - tuned.z[number]) / 1.6448536, 1e-300)
            scores.setdefault(one.name, []).append((tuned.z[number] - z_true) / sd)
            held = bool(found.q05 <= value <= found.q95)
            inside.setdefault(one.name, []).append(held)
    seconds = (time.perf_counter() - begun) / seeds
    rows = []
    for name, held in inside.items():
        k, n = sum(held), len(held)
        low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
        high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
        score = np.array(scores[name])
        rows.append(
            [
                name,
                f"{k} of {n}",
                f"{100 * low:.0f} to {100 * high:.0f} %",
                f"{score.mean():+.2f}",
                f"{score.std(ddof=1):.2f}",
            ]
        )
    rows.append(["poor", f"{sum(poor)} of {seeds}", "", "", f"{seconds:.1f} s"])
    return rows


def main() -> None:
    """Count, print, and keep."""
    words = sys.argv[1:]
    for group in words[:1] or KEPT:
        seeds = int(words[1]) if len(words) > 1 else SEEDS[group]
        text = f"Truth within the {100 * NOMINAL:.0f} % interval of jblast tune, "
        text += f"{seeds} seeds\n"
        tuned = {"sound": heard, "frames": filmed}[group]
        for name, case in CASES.items():
            if case.tuned is tuned:
                head = [
                    "number",
                    "within",
                    "95 % of that",
                    "mean score",
                    "sd of scores",
                ]
                table = aligned([head, *counted(case, seeds)], right=(1, 2, 3, 4))
                text += "\n".join(["", f"{name}: {case.words}", *table, ""])
        print(text)
        if seeds == SEEDS[group]:
            write_text(RESULTS / KEPT[group], text)


if __name__ == "__main__":
    main()
