"""Film a scene's blast with its camera: frames as PNG, events of an event camera.

Frame k stands at START + k / frames_hz. Into the directory go frames/0000.png and so on
(sRGB; `jblast events DIR/frames --srgb` reads them), events.h5 (times in microseconds
from frame 0) and contact_sheet.png. Frames end at white; events are of the light
itself, and bright fire sends more of them than its frames tell. Their times owe nothing
to the frames: with --noise off they are solved for, unless --views, --supersample or a
directory as --background is given. Else the light is looked at as often as it takes to
know 99 in 100 of them to 0.1 ms (of a real camera by trial, noise aside). What holds is
printed.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import (
    positive_of_any_size,
    seed,
    threshold_pair,
    time_span,
)
from jblast.cli.arguments.paths import path

MOST = 1000
"""Frames where nothing is said of how many."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there, with a [camera]; numbers with a prior are drawn",
    )
    verb.add_argument(
        "--out", required=True, metavar="DIR", type=path, help="directory to write to"
    )
    verb.add_argument(
        "--mode",
        choices=("rgb", "events", "both"),
        default="both",
        help="write frames, events or both (default: both)",
    )
    verb.add_argument(
        "--times",
        type=time_span,
        metavar="START:STOP",
        help="from when to when, on the scene's clock [s]; STOP is no frame any more "
        "(default: from the first explosion until no fireball glows, but at most "
        f"{MOST:,} frames)",
    )
    verb.add_argument(
        "--seconds",
        type=positive_of_any_size,
        metavar="S",
        help="so long from the first explosion on [s]",
    )
    verb.add_argument(
        "--fps",
        type=positive_of_any_size,
        metavar="HZ",
        help="frames a second (default: the camera's frames_hz)",
    )
    verb.add_argument(
        "--background",
        metavar="GREY|R,G,B|FILE.png|DIR",
        type=path,
        help="linear light from 0 to 1, an sRGB image, or a directory with one for "
        "each frame (default: a grey of 0.18)",
    )
    verb.add_argument(
        "--views",
        metavar="DIR",
        type=path,
        help="pictures of an explosion from several sides, with views.toml, in place "
        "of the fireball that is computed",
    )
    verb.add_argument(
        "--supersample",
        metavar="N",
        type=int,
        default=1,
        help="rays along each side of a pixel (default: 1)",
    )
    verb.add_argument(
        "--threshold",
        type=threshold_pair,
        metavar="STEP[,DARKER]",
        help="change of the logarithm of light that gives an event (default: the "
        "camera's)",
    )
    verb.add_argument(
        "--noise",
        choices=("on", "off"),
        default="on",
        help="off: the ideal event camera; on (default): with its imperfections",
    )
    verb.add_argument(
        "--seed", type=seed, default=0, help="of noise and of priors (default: 0)"
    )
    verb.add_argument("--json", action="store_true", help="print a summary as JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what DIR holds of these files"
    )


def run(asked: argparse.Namespace) -> int:
    """Render, convert and write block by block; say what was written."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    lasts = {"starting": 3.0, "filming": 9.0, "finding events": 9.0}
    begin = stages({**lasts, "drawing the sheet": 0.5})
    begin("starting")
    start_jax()
    from jblast.cli.arguments.film import film_asked
    from jblast.cli.arguments.film_files import FilmWriter, cleared
    from jblast.cli.arguments.paths import writing
    from jblast.report.film.answer import FilmAnswer, FilmEvents, as_json
    from jblast.report.film.text import film_text

    film = film_asked(asked, MOST)
    next(film.frames())  # what cannot be rendered is refused with all files in place
    out, noise = Path(asked.out), asked.noise == "on"
    writer = FilmWriter(film, out, asked.mode)
    camera, times = film.camera, film.times
    found = None
    begin("filming")
    with writing(asked.out):
        read = asked.background, asked.views
        cleared(out, asked.mode, force=asked.force, read=read)
        writer.write_frames()
        if asked.mode != "rgb":
            begin("finding events")
            written, stamps = writer.write_events(noise, asked.seed)
            found = FilmEvents(
                threshold=tuple(camera.threshold.tolist()),
                noise=asked.noise,
                **written._asdict(),
                stamps=stamps.how,
                stamp_error_s=stamps.error_s,
            )
        begin("drawing the sheet")
        writer.write_sheet()
    answer = FilmAnswer(
        scene=asked.scene,
        mode=asked.mode,
        frames=len(times),
        width=camera.width,
        height=camera.height,
        fps=float(camera.frames_hz),
        start_s=float(times[0]),
        duration_s=float(times[-1] - times[0]),
        seed=asked.seed,
        found=found,
        files=writer.files(),
    )
    sys.stdout.write(as_json(answer) if asked.json else film_text(answer))
    return 0
