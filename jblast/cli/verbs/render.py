"""Render a scene's blast with its camera: PNG frames, and events of an event camera.

The folder gets frames/0000.png and so on (sRGB; `jblast events DIR/frames --srgb` reads
them), events.h5 (times in microseconds from frame 0), contact_sheet.png, and a video
with --video. Frame k is at START + k / frames_hz. In frames, light above white keeps
its hue and tends to white. Events are computed from the light itself, so that a bright
fire triggers more of them than its frames show.

Event times do not depend on the frame rate. With --noise off they are solved for,
unless --views or a moving --background is given. Otherwise the light is sampled until
99 of 100 event times are known to 0.1 ms (for the camera with noise by trial, apart
from the noise). The accuracy reached is printed.
"""

import argparse
import sys

from jblast.cli.arguments.numbers import (
    positive_of_any_size,
    seed,
    threshold_pair,
    time_span,
)
from jblast.cli.arguments.options import add_force, add_json, given, path
from jblast.cli.arguments.verb_parser import VerbParser


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with a [camera]; parameters with a prior are sampled",
    )
    verb.inputs.add_argument(
        "--background",
        metavar="GREY|R,G,B|FILE.png|DIR|VIDEO|sky",
        type=path,
        help="background: linear light from 0 to 1, an sRGB image, a folder with one "
        "image for each frame, a video that starts with the first frame, or sky "
        "(ground and a clear sky) (default: a grey of 0.18; sky for a moving camera)",
    )
    verb.inputs.add_argument(
        "--views",
        metavar="explosion|DIR",
        type=path,
        help="images in place of the smooth fireball: explosion, a set of turbulent "
        "fire and smoke that is part of jblast, scaled and lit by the laws; or DIR "
        "with such a set or with photographs and their views.toml (write ./explosion "
        "for a folder of that name)",
    )
    verb.inputs.add_argument(
        "--ground",
        metavar="FILE.png:M",
        type=path,
        help="texture of the ground, sRGB, tiled, its centre at the origin and north "
        "up, with the size of a pixel [m]; under a clear sky",
    )
    verb.inputs.add_argument(
        "--depth",
        metavar="FILE.png|FILE.npy",
        type=path,
        help="depth of the background along the camera's axis: 16 bits in millimetres "
        "(0: no surface) or floats in metres; nearer surfaces hide the fire, and the "
        "fire lights them",
    )
    verb.inputs.add_argument(
        "--flight",
        metavar="FILE.csv",
        type=path,
        help="flight of the vehicle that carries the camera, from `jblast fly` "
        "(default: simulated from the scene)",
    )
    verb.model.add_argument(
        "--times",
        type=time_span,
        metavar="START:STOP",
        help="time span on the scene's clock [s], without a frame at STOP (default: "
        "from the first explosion until no fireball glows, with --views until the last "
        "image, but at most 1,000 frames)",
    )
    verb.model.add_argument(
        "--seconds",
        type=positive_of_any_size,
        metavar="S",
        help="duration from the first explosion [s], in place of --times",
    )
    verb.model.add_argument(
        "--fps",
        type=positive_of_any_size,
        metavar="HZ",
        help="frame rate [Hz] (default: the camera's frames_hz)",
    )
    verb.model.add_argument(
        "--daylight",
        metavar="LUX",
        type=positive_of_any_size,
        help="illuminance of the ground by sky and sun, for which the film is exposed; "
        "with less of it ground and sky are darker (default: 94,000, full sun; "
        "overcast 10,000, dusk 10)",
    )
    verb.model.add_argument(
        "--noise",
        choices=("on", "off"),
        default="on",
        help="event camera: ideal (off), or with its imperfections (on) (default: on)",
    )
    verb.advanced.add_argument(
        "--flash",
        choices=("on", "off"),
        default="on",
        help="light of the fire on the ground and on the surfaces of --depth (default: "
        "on)",
    )
    verb.advanced.add_argument(
        "--threshold",
        type=threshold_pair,
        metavar="STEP[,DARKER]",
        help="change of ln(light) that triggers an event (default: the camera's)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of noise and priors (default: 0)"
    )
    verb.outputs.add_argument(
        "--out", required=True, metavar="DIR", type=path, help="folder for the film"
    )
    verb.outputs.add_argument(
        "--mode",
        choices=("rgb", "events", "both"),
        help="frames (rgb), events or both (default: both)",
    )
    verb.outputs.add_argument(
        "--events-format",
        choices=("h5", "npz", "raw", "aedat4"),
        help="format of the events: h5 (HDF5 in the layout of DSEC), npz, raw (EVT3) "
        "or aedat4 (default: h5)",
    )
    verb.outputs.add_argument(
        "--video",
        metavar="FILE.mp4",
        type=path,
        help="video of the frames: H.264 in .mp4, .mov or .mkv",
    )
    verb.outputs.add_argument(
        "--video-fps",
        type=positive_of_any_size,
        metavar="HZ",
        help="frame rate of the video [Hz] (default: the camera's frames_hz up to 60, "
        "and 30 for faster cameras, as slow motion)",
    )
    add_json(verb, "summary as JSON, instead of text")
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Render, convert and write block by block; print the files written."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    # Approximate durations, from which the progress line estimates the time left.
    lasts = {"starting": 3.0, "filming": 9.0, "finding events": 9.0}
    begin = stages({**lasts, "drawing the sheet": 0.5})
    begin("starting")
    # Optimised code: a film has hundreds of frames of one program.
    start_jax()
    from jblast.report.film import FilmAnswer, film_text
    from jblast.report.film_files import film_outputs, write_film
    from jblast.study.filming import FilmOptions, film_of, folder_named, lifted

    film_options = FilmOptions(
        seed=options.seed,
        times=options.times,
        seconds=options.seconds,
        fps=options.fps,
        background=options.background,
        views=options.views,
        ground=options.ground,
        flight=options.flight,
        depth=options.depth,
        daylight=options.daylight,
        threshold=options.threshold,
        flash=options.flash == "on",
        **given(options, mode="mode"),
    )
    # Everything is read and checked before the first frame is written.
    film = film_of(options.scene, film_options)
    camera, times = film.camera, film.times
    outputs = film_outputs(
        options.out,
        float(camera.frames_hz),
        mode=film_options.mode,
        video=options.video,
        video_fps=options.video_fps,
        **given(options, events_format="events_format"),
    )
    found = write_film(
        film,
        outputs,
        noise=options.noise == "on",
        seed=options.seed,
        force=options.force,
        # Inputs within the output folder must not be overwritten by the film.
        read=(
            options.background,
            folder_named(options.views),
            options.depth,
            options.flight,
        ),
        begin=begin,
    )
    answer = FilmAnswer(
        scene=options.scene,
        mode=film_options.mode,
        frames=len(times),
        width=camera.width,
        height=camera.height,
        fps=float(camera.frames_hz),
        # A video plays slower than the camera runs: both rates are reported.
        video_fps=None if outputs.video is None else outputs.video_hz,
        start_s=float(times[0]),
        duration_s=float(times[-1] - times[0]),
        seed=options.seed,
        found=found,
        lifted_m=lifted(film),
        files=outputs.files(),
    )
    sys.stdout.write(answer.to_json() if options.json else film_text(answer))
    return 0
