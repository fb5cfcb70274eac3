"""Film a scene's blast with its camera: frames as PNG, events of an event camera.

Frame k stands at START + k / frames_hz. Into the directory go frames/0000.png and so on
(sRGB; `jblast events DIR/frames --srgb` reads them), events.h5 (times in microseconds
from frame 0), contact_sheet.png, and a video where --video says. Light above white
keeps its hue in frames and tends to white; events are of the light itself, and bright
fire sends more of them than its frames show.
Their times owe nothing to the frames: with --noise off they are solved for, unless
--views, --supersample or a --background that moves is given. Else the light is looked
at as often as it takes to know 99 in 100 of them to 0.1 ms (of a real camera by trial,
noise aside). What holds is printed.
"""

import argparse
import sys

from jblast.cli.arguments.numbers import (
    azimuth_and_elevation,
    positive_of_any_size,
    seed,
    share,
    threshold_pair,
    time_span,
)
from jblast.cli.arguments.options import given, path


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
        help="write frames, events or both (default: both)",
    )
    verb.add_argument(
        "--times",
        type=time_span,
        metavar="START:STOP",
        help="from when to when, on the scene's clock [s]; STOP is no frame any more "
        "(default: from the first explosion until no fireball glows, with --views to "
        "the last picture, but at most 1,000 frames)",
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
        metavar="GREY|R,G,B|FILE.png|DIR|VIDEO|sky",
        type=path,
        help="linear light from 0 to 1, an sRGB image, a directory with one for each "
        "frame, a video that runs from the first frame on, or sky: ground and a clear "
        "sky (default: a grey of 0.18; sky behind a camera that moves)",
    )
    verb.add_argument(
        "--views",
        metavar="explosion|DIR",
        type=path,
        help="pictures in place of the smooth fireball: explosion is the set that "
        "comes with jblast, turbulent fire and smoke scaled and lit by the laws; DIR "
        "holds another such set, or pictures of your own, with views.toml (a folder "
        "that is called explosion is ./explosion)",
    )
    verb.add_argument(
        "--ground",
        metavar="FILE.png:M",
        type=path,
        help="texture of the ground, sRGB, its middle at the origin, north up, and how "
        "many metres a pixel of it is; tiled, under a clear sky",
    )
    verb.add_argument(
        "--sun",
        metavar="AZIMUTH,ELEVATION",
        type=azimuth_and_elevation,
        help="put the sun into the sky, with glare around it: degrees clockwise from "
        "north, and above the horizon",
    )
    verb.add_argument(
        "--flight",
        metavar="FILE.csv",
        type=path,
        help="where the vehicle was that carries the camera, as `jblast fly` writes it "
        "(default: the scene's vehicle is flown)",
    )
    verb.add_argument(
        "--depth",
        metavar="FILE.png|FILE.npy",
        type=path,
        help="how far away what stands in the background is, along the camera's axis: "
        "16 bits of millimetres (0: nothing there), or floats in metres; it hides the "
        "fire behind it, and is lit by it",
    )
    verb.add_argument(
        "--daylight",
        metavar="LUX",
        type=positive_of_any_size,
        help="light of sky and sun on the ground, for which the picture is exposed; "
        "ground and sky are shown darker in less of it (default: 94,000, full sun; an "
        "overcast day has 10,000, dusk 10)",
    )
    verb.add_argument(
        "--flash",
        choices=("on", "off"),
        default="on",
        help="whether the fire lights the ground, and what --depth tells of (default: "
        "on)",
    )
    verb.add_argument(
        "--bloom",
        metavar="PART",
        type=share,
        help="part of the light of frames that the lens spreads over pixels around, "
        "before highlights are compressed, as 0.05; events have none (default: 0)",
    )
    verb.add_argument(
        "--supersample",
        metavar="N",
        type=int,
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
    verb.add_argument(
        "--events-format",
        choices=("h5", "npz", "raw", "aedat4"),
        help="of the file of events: HDF5 in the layout of DSEC (default), npz, EVT3 "
        "or AEDAT4",
    )
    verb.add_argument(
        "--video",
        metavar="FILE.mp4",
        type=path,
        help="write the frames as a video, too: H.264 in .mp4, .mov or .mkv",
    )
    verb.add_argument(
        "--video-fps",
        type=positive_of_any_size,
        metavar="HZ",
        help="its frames a second (default: the camera's frames_hz up to 60, and 30 "
        "for faster ones: slow motion)",
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
    from jblast.report.film import FilmAnswer, film_text
    from jblast.report.film_files import film_outputs, write_film
    from jblast.study.filming import FilmOptions, film_of, folder_named, lifted

    options = FilmOptions(
        seed=asked.seed,
        times=asked.times,
        seconds=asked.seconds,
        fps=asked.fps,
        background=asked.background,
        views=asked.views,
        ground=asked.ground,
        sun=asked.sun,
        flight=asked.flight,
        depth=asked.depth,
        daylight=asked.daylight,
        threshold=asked.threshold,
        flash=asked.flash == "on",
        **given(asked, mode="mode", bloom="bloom", supersample="supersample"),
    )
    film = film_of(asked.scene, options)
    camera, times = film.camera, film.times
    outputs = film_outputs(
        asked.out,
        float(camera.frames_hz),
        mode=options.mode,
        video=asked.video,
        video_fps=asked.video_fps,
        **given(asked, events_format="events_format"),
    )
    found = write_film(
        film,
        outputs,
        noise=asked.noise == "on",
        seed=asked.seed,
        force=asked.force,
        read=(asked.background, folder_named(asked.views), asked.depth, asked.flight),
        begin=begin,
    )
    answer = FilmAnswer(
        scene=asked.scene,
        mode=options.mode,
        frames=len(times),
        width=camera.width,
        height=camera.height,
        fps=float(camera.frames_hz),
        video_fps=None if outputs.video is None else outputs.video_hz,
        start_s=float(times[0]),
        duration_s=float(times[-1] - times[0]),
        seed=asked.seed,
        found=found,
        lifted_m=lifted(film),
        files=outputs.files(),
    )
    sys.stdout.write(answer.to_json() if asked.json else film_text(answer))
    return 0
