"""Estimate sensor and medium parameters from a recording, or tune a vehicle's gains.

RECORDED is a sound file (WAV, FLAC, CSV) of a microphone or pressure gauge, a folder
of PNG frames, a video, or a file of camera events (.h5, .npz, .raw, .aedat4,
.dat). The blast is that of the scene. Parameters that the scene leaves free, or gives a
prior, are estimated together with those of --free. Exit code 3: the origin time is
free, and no blast is detected. Exit code 4: a parameter is not identifiable, the fit
did not converge, or the residuals are large.

--gains needs no recording. It tunes the gains of the vehicle's position controller by
gradient on blasts sampled from the scene's priors, within stability margins, and tests
them on 200 other blasts. Exit code 4: the search did not converge.

example:
  jblast tune scene.toml phone.wav --free noise_pa,low_pass_hz --out tuned

input:
  [SCENE.toml]          path; scene file
  [RECORDED]            path; recording of one of its sensors, or of its camera
  --sensor NAME         text; sensor of the recording (default: the one that the file is
      named after, or the only one)
  --full-scale PA       positive; pressure of a sample of 1 [Pa] (default: 1 for floats,
      the sensor's full_scale_pa for integers)
  --fps HZ              size; frame rate [Hz] (default: the camera's frames_hz)
  --start S             number; time of frame 0, or of time 0 of camera events, on the
      scene's clock [s] (default: the first explosion, as in jblast render)
  --background GREY|R,G,B|FILE.png  path; background of the film: linear light from 0 to
      1, or an sRGB image (default: a grey of 0.18)
model:
  --free NAME,...       names; parameters to estimate; --list prints their names
  --gains               tuning of the vehicle's controller to the scene's blasts
output:
  --out DIR             path; folder for the tuned scene.toml, tune.json, tune.png and
      report.html
  --list                list of the parameters that can be tuned, and of their keys in a
      scene
  ...out
advanced:
  --margin-db DB        positive; with --gains: minimum gain margin, up and down [dB]
      (default: 6)
  --margin-deg DEG      positive; with --gains: minimum phase margin [deg] (default: 35)
  --delay S             number; with --gains: additional loop delay [s], included in the
      stability margins but not in the flights (default: 0)
  --vehicles N          integer; with --gains: number of blasts to tune on (default: 32)
  --seed N              seed; with --gains: seed of the blasts (default: 0)
"""

import argparse
import sys

from jblast.cli.options import given, refuse_unused
from jblast.errors import InputError
from jblast.files import check_out

OF_GAINS = ("margin_db", "margin_deg", "delay", "vehicles", "seed")
HOW = ("sensor", "full_scale", "fps", "start", "background")
OF_RECORDS = ("recorded", "free", *HOW)
"""Options of one kind of tuning: the other kind rejects them."""


def run(options: argparse.Namespace) -> int:
    """Read, tune, write, print; return the exit code."""
    # before JAX starts, as these mistakes depend on the options alone
    if options.gains:
        refuse_unused(options, OF_RECORDS, "no recording with --gains")
    else:
        refuse_unused(options, OF_GAINS, "it with --gains only")
    if not (options.list or (options.scene and (options.recorded or options.gains))):
        raise InputError(
            "expected a scene and a recording: jblast tune SCENE.toml RECORDED "
            "--free NAME,...; or SCENE.toml --gains; or --list"
        )
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    # the search of gains flies each blast at every step; the other stages take seconds
    longest = 40.0 if options.gains else 8.0
    begin = stages({"starting": 2.0, "tuning": longest, "writing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.inference.tuning import NothingHeardError
    from jblast.inference.tuning.tune_recording import tune
    from jblast.report.output import NOT_FOUND, deliver
    from jblast.report.tune import FILES, gains_answer, parameters_view, tune_answer
    from jblast.report.view import terminal
    from jblast.scene import read_scene
    from jblast.study.gains import TuningSettings, tune_gains

    if options.list:
        sys.stdout.write(terminal(parameters_view()))
        return 0
    if options.out:
        check_out(options.out, ("tune.json", *FILES), force=options.force)
    begin("tuning")
    if options.gains:
        names = {name: name for name in OF_GAINS} | {"delay": "delay_s"}
        settings = TuningSettings(**given(options, **names))
        gains = tune_gains(read_scene(options.scene), settings)
        begin("writing")
        answer = gains_answer(gains, options.scene, options.out)
        return deliver(answer, options, folder=options.out, names=FILES)
    try:
        tuned = tune(
            options.scene,
            options.recorded,
            options.free,
            **given(options, **{name: name for name in HOW}),
        )
    except NothingHeardError as nothing:
        sys.stderr.write(f"jblast: {nothing}\n")
        return NOT_FOUND
    begin("writing")
    answer = tune_answer(tuned, options.scene, options.recorded, options.out)
    return deliver(answer, options, folder=options.out, names=FILES)
