"""Detect a blast in sound, film or camera events: its arrival time and uncertainty.

Sound is searched for a template (--template), for the pulse of a charge (--charge and
--range), or for a bank of pulses made from blast laws. Frames, video and camera events
are searched for a growing flash. Exit code 3: nothing is found.

example:
  jblast detect recording.wav --charge 5 --range 80

input:
  RECORDING...              path; WAV or FLAC files of one to eight channels, each
                            searched; several files start simultaneously, unless
                            --positions has their clocks. Or one folder of PNG frames,
                            one file of camera events (.h5, .npz, .raw, .aedat4, .dat,
                            .csv, .txt), or one or more videos, whose sound tracks are
                            searched
  --fps HZ                  size; frame rate [Hz]: frame k is at k/fps; required for a
                            folder; of a video in slow motion the rate of the camera
                            (default: clock of the video)
  --positions STATIONS.csv  path; positions of microphones or clips: columns sensor
                            (stem of a file's name, or stem.channel, from 1), east_m,
                            north_m, up_m, and optionally clock; requires --out
  --scene SCENE.toml        path; scene file of the camera, whose pose and lens convert
                            the image position to a direction, and with --out to a log
                            for jblast fit
  --size WIDTHxHEIGHT       text; image size of camera events [px], for files that
                            do not state it: 640x480
model:
  --template TEMPLATE.wav   path; sound to search for, one channel at any sampling rate;
                            the arrival is the time of its first sample
  --charge KG               positive; TNT mass of a charge on the ground [kg], whose
                            pulse is searched for; requires --range
  --range M                 positive; distance of --charge [m]
output:
  --out DIR                 path; folder for detect.json, report.html and detection.png;
                            for sound also filtered.wav (filter output in standard
                            deviations of the noise); with --positions or --scene also
                            observations.csv, a log for jblast fit
  ...out
advanced:
  --false-alarms PER_HOUR   positive; accepted false alarms per hour: due to noise in
                            each channel of sound, due to scenes that resemble a blast
                            in film (default: 1)
  --all-sounds              search without a template for impulsive sounds of any form:
                            also reverberant or distant blasts, but doors, clicks and
                            thunder as well (default: sounds with the form of a blast
                            pulse)
"""

import argparse
from dataclasses import replace
from pathlib import Path

from jblast.cli.options import fit_command, given
from jblast.errors import InputError, whole_number
from jblast.files import check_out

FILES = (
    "detect.json",
    "detection.png",
    "observations.csv",
    "filtered.wav",
)
"""Files of `--out` for one recording."""


def run(options: argparse.Namespace) -> int:
    """Search, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.signals.detect_arguments import check_arguments

    arguments = {
        "template": options.template,
        "mass_kg": options.charge,
        "range_m": options.range,
        "all_sounds": options.all_sounds,
        "positions": options.positions,
        "fps": options.fps,
        "scene": options.scene,
        "size": options.size and image_size(options.size),
    }
    check_arguments(options.recording, arguments)
    if options.positions and not options.out:
        raise InputError("--positions: expected --out to write the log to, got none")
    if options.out:
        check_out(options.out, FILES, force=options.force)
    start_jax(quick=True)
    from jblast.report.detect import LOG, detect_answer
    from jblast.report.output import deliver
    from jblast.signals.detect_files import detect

    rate = given(options, false_alarms="false_alarms_per_hour")
    answer = detect_answer(detect(options.recording, **arguments, **rate))
    if options.out and LOG in answer.files:
        command = fit_command(Path(options.out) / LOG, options.scene)
        answer = replace(answer, after=[f"Fit it with: {command}"])
    return deliver(answer, options, folder=options.out, names=[LOG])


def image_size(text: str) -> tuple[int, int]:
    """Return width and height of `640x480`.

    Raises:
        InputError: The text has another form.
    """
    sides = [whole_number(side) for side in text.lower().split("x")]
    if len(sides) != 2 or not all(sides):
        raise InputError(
            f"--size: expected width and height, such as 640x480, got {text!r}"
        )
    return sides[0] or 0, sides[1] or 0
