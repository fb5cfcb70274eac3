"""Convert frames, or a video, to the events of an event camera.

example:
  jblast events frames/ --fps 1000 --noise off --out events.h5

input:
  FRAMES_DIR|VIDEO   path; folder of PNG frames (or of .npy files with linear light as
                     floats, full scale 1) in the order of their names, or a video
  --fps HZ           size; frame rate [Hz]: frame k is at k/fps; required for a folder
                     (default: clock of the video, which is wrong for slow motion)
  --srgb             sRGB values in PNG frames (default: linear light)
model:
  --threshold STEP[,DARKER]  pair; change of ln(light) that triggers an event, brighter
                     and darker (default: 0.2 for both)
  --noise on|off     choice = on; camera model: ideal (off), or with scattered
                     thresholds, limited bandwidth, leak, hot pixels, shot noise and
                     refractory time (on)
output:
  --out FILE!        path; file of events: .h5 (HDF5 in the layout of DSEC), .npz, .raw
                     (EVT3) or .aedat4
  --json             summary as JSON, instead of text
  --force            permission to overwrite an existing --out
advanced:
  --seed N           seed = 0; seed of the noise
  --darkest LIGHT    share; linear light, as a part of full scale, below which changes
                     trigger no event (default: half a step of the file's bit depth,
                     0.00196 for 8 bits; 1e-6 for floats)
"""

import argparse


def run(options: argparse.Namespace) -> int:
    """Read, convert and write block by block; print the number of events."""
    from jblast.cli.jax_start import start_jax

    # Each block runs the same program, so that optimised code pays in long films.
    start_jax()
    from jblast.report.film import events_answer, events_view
    from jblast.report.output import Answer, deliver
    from jblast.sensors.camera.film import film_to_events

    noise = options.noise == "on"
    given = {} if options.threshold is None else {"threshold": options.threshold}
    made = film_to_events(
        options.frames_dir,
        options.out,
        fps=options.fps,
        noise=noise,
        seed=options.seed,
        srgb=options.srgb,
        darkest=options.darkest,
        force=options.force,
        **given,
    )
    answer = events_answer(
        made, srgb=options.srgb, noise=noise, seed=options.seed, out=options.out
    )
    after = [f"Written: {options.out}"]
    return deliver(Answer(answer, events_view(answer), after=after), options)
