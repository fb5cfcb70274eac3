"""Render a scene's blast with its camera: PNG frames, and events of an event camera.

The folder gets frames/0000.png and so on (sRGB; `jblast events DIR/frames --srgb` reads
them), events.h5 (times in microseconds from frame 0), contact_sheet.png, and a video
with --video. Frame k is at START + k / frames_hz. In frames, light above white keeps
its hue and tends to white. Events are computed from the light itself, so that a bright
fire triggers more of them than its frames show.

Event times do not depend on the frame rate. The light is sampled until 99 of 100 event
times are known to 0.1 ms (by trial, apart from the noise), and to 1 us with --noise
off. The accuracy is printed.

example:
  jblast render scene.toml --out film --views explosion

input:
  SCENE.toml              path; scene file with a [camera]; parameters with a prior are
                          sampled
  --background GREY|R,G,B|FILE.png|DIR|VIDEO|sky  path; background: linear light from 0
                          to 1, an sRGB image, a folder with one image for each frame, a
                          video that starts with the first frame, or sky (ground and a
                          clear sky) (default: a grey of 0.18; sky for a moving camera)
  --views explosion|DIR   path; images in place of the smooth fireball: explosion, a set
                          of turbulent fire and smoke that is part of jblast, scaled and
                          lit by the laws; or DIR with such a set or with photographs
                          and their views.toml (write ./explosion for a folder of that
                          name)
  --ground FILE.png:M     path; texture of the ground, sRGB, tiled, its centre at the
                          origin and north up, with the size of a pixel [m]; under a
                          clear sky
  --depth FILE.png|FILE.npy  path; depth of the background along the camera's axis: 16
                          bits in millimetres (0: no surface) or floats in metres;
                          nearer surfaces hide the fire, and the fire lights them
  --flight FILE.csv       path; flight of the vehicle that carries the camera, from
                          `jblast fly` (default: simulated from the scene)
model:
  --times START:STOP      span; time span on the scene's clock [s], without a frame at
                          STOP (default: from the first explosion until no fireball
                          glows, with --views until the last image, but at most 1,000
                          frames)
  --seconds S             size; duration from the first explosion [s], in place of
                          --times
  --fps HZ                size; frame rate [Hz] (default: the camera's frames_hz)
  --daylight LUX          size; illuminance of the ground by sky and sun, for which the
                          film is exposed; with less of it ground and sky are darker
                          (default: 94,000, full sun; overcast 10,000, dusk 10)
  --noise on|off          choice = on; event camera: ideal (off), or with its
                          imperfections (on)
output:
  --out DIR!              path; folder for the film
  --mode rgb|events|both  choice = both; frames (rgb), events or both
  --events-format h5|npz|raw|aedat4  choice = h5; format of the events: h5 (HDF5 in the
                          layout of DSEC), npz, raw (EVT3) or aedat4
  --video FILE.mp4        path; video of the frames: H.264 in .mp4, .mov or .mkv
  --video-fps HZ          size; frame rate of the video [Hz] (default: the camera's
                          frames_hz up to 60, and 30 for faster cameras, as slow motion)
  --json                  summary as JSON, instead of text
  --force                 permission to overwrite existing files in --out
advanced:
  --flash on|off          choice = on; light of the fire on the ground and on the
                          surfaces of --depth
  --threshold STEP[,DARKER]  pair; change of ln(light) that triggers an event (default:
                          the camera's)
  --seed N                seed = 0; seed of noise and priors
"""

import argparse


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
    from jblast.report.film import film_answer, film_lines, film_view
    from jblast.report.output import Answer, deliver
    from jblast.results import filled
    from jblast.sensors.camera.film_writer import write_film
    from jblast.study.filming import FilmOptions, film_of, folder_named

    # Everything is read and checked before the first frame is written.
    film_options = filled(FilmOptions, vars(options), flash=options.flash == "on")
    film = film_of(options.scene, film_options)
    made = write_film(
        film,
        options.out,
        mode=options.mode,
        events_format=options.events_format,
        video=options.video,
        video_fps=options.video_fps,
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
    answer = film_answer(
        film, made, scene=options.scene, mode=options.mode, seed=options.seed
    )
    shown = Answer(answer, film_view(answer), after=film_lines(answer))
    return deliver(shown, options)
