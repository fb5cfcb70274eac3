"""Write down what every sensor of a scene hears and feels over time.

Microphones write WAV files in pascals, pressure gauges, anemometers and geophones CSV.
A record begins at 0 on its sensor's clock. Where rate_hz is absent, 48,000 samples a
second are taken.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import path
from jblast.files import save_text, writing


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there; every [[sensor]] of kind microphone, pressure, anemometer "
        "or geophone writes a file; numbers with a prior are drawn",
    )
    verb.add_argument(
        "--out",
        metavar="DIR",
        required=True,
        type=path,
        help="where to write a file for each sensor, truth.csv, listen.json, "
        "waveforms.png and spectrograms.png",
    )
    verb.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="how long to record [s] (default: until the last blast has gone by)",
    )
    verb.add_argument(
        "--packets",
        type=positive,
        metavar="HZ",
        help="make the same samples in packets, so many a second, in constant memory; "
        "what a stream had that breaks is kept",
    )
    verb.add_argument(
        "--seed", type=seed, default=0, help="of priors and noise (default: 0)"
    )
    verb.add_argument(
        "--ambient",
        metavar="FILE.wav",
        type=path,
        help="recording of what is heard without a blast, looped; a sample of 1 is "
        "full_scale_pa of [ambient], or 1 Pa",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what --out holds of these files"
    )


def run(asked: argparse.Namespace) -> int:
    """Record, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "recording": 4.0, "drawing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.fit.files import check_directory
    from jblast.report.listen import listening_document, listening_text
    from jblast.report.listen_files import (
        JSON,
        TRUTH,
        provenance,
        write_pictures,
        write_tracks,
    )
    from jblast.results import to_json
    from jblast.scene import read_scene
    from jblast.sensors.listening import plan, with_ambient

    check_directory(asked.out, asked.force, "the recordings")
    scene, notes = with_ambient(read_scene(asked.scene), asked.ambient)
    listening = plan(scene, asked.seed, asked.seconds)
    comments = [*provenance(listening, asked.scene, asked.seed), *notes]
    begin("recording")
    with writing(asked.out):
        tracks = write_tracks(listening, Path(asked.out), comments, asked.packets)
    header = {"schema": 1, "scene": asked.scene, "seed": asked.seed}
    document = header | listening_document(listening, tracks, notes)
    text = to_json(document)
    save_text(text, Path(asked.out) / JSON)
    begin("drawing")
    pictures = write_pictures(listening, tracks, Path(asked.out))
    if asked.json:
        sys.stdout.write(text)
    else:
        sys.stdout.write(listening_text(listening, tracks, notes))
        sys.stdout.write(f"\nWritten: {asked.out}, ")
        sys.stdout.write(f"{', '.join([JSON, TRUTH, *pictures])} and the files above\n")
    return 0
