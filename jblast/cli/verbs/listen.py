"""Simulate the recordings of a scene's sensors over time.

Microphones write WAV files in pascals; pressure gauges, anemometers and geophones write
CSV files. A record begins at 0 on its sensor's clock. A sensor without rate_hz has
48,000 samples per second.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import add_force, add_json, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import save_text, writing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file; each [[sensor]] of kind microphone, pressure, anemometer or "
        "geophone gives one file; parameters with a prior are sampled",
    )
    verb.inputs.add_argument(
        "--ambient",
        metavar="FILE.wav",
        type=path,
        help="recording of the background sound, looped; a sample of 1 is "
        "full_scale_pa of [ambient], or 1 Pa",
    )
    verb.model.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="duration of the recordings [s] (default: until the last blast is over)",
    )
    verb.advanced.add_argument(
        "--packets",
        type=positive,
        metavar="HZ",
        help="packets per second, for the same samples in constant memory; an "
        "interrupted run keeps the samples written so far (default: one packet)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of priors and noise (default: 0)"
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        required=True,
        type=path,
        help="folder for one file for each sensor, truth.csv, listen.json, "
        "waveforms.png and spectrograms.png",
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Record, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "recording": 4.0, "drawing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.fit.files import check_directory
    from jblast.report.listen import ListenAnswer, listening_text, recordings_answer
    from jblast.report.listen_files import (
        JSON,
        TRUTH,
        provenance,
        write_pictures,
        write_tracks,
    )
    from jblast.study.running import listening_of

    check_directory(options.out, options.force, "the recordings")
    listening, notes = listening_of(
        options.scene, options.seconds, options.seed, options.ambient
    )
    comments = [*provenance(listening, options.scene, options.seed), *notes]
    begin("recording")
    with writing(options.out):
        # With --packets the files grow packet by packet, in constant memory.
        tracks = write_tracks(listening, Path(options.out), comments, options.packets)
    recordings = recordings_answer(listening, tracks, notes)
    text = ListenAnswer(options.scene, options.seed, recordings).to_json()
    save_text(text, Path(options.out) / JSON)
    begin("drawing")
    # After the JSON file: a failed figure leaves complete recordings.
    pictures = write_pictures(listening, tracks, Path(options.out))
    if options.json:
        sys.stdout.write(text)
    else:
        sys.stdout.write(listening_text(listening, tracks, notes))
        sys.stdout.write(f"\nWritten to {options.out}: ")
        sys.stdout.write(f"{', '.join([JSON, TRUTH, *pictures])} and the files above\n")
    return 0
