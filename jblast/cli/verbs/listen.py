"""Simulate the recordings of a scene's sensors over time.

Microphones write WAV files in pascals; pressure gauges, anemometers and geophones write
CSV files. A record begins at 0 on its sensor's clock. A sensor without rate_hz has
48,000 samples per second.

example:
  jblast listen scene.toml --out recordings --seconds 10

input:
  SCENE.toml           path; scene file; each [[sensor]] of kind microphone, pressure,
                       anemometer or geophone gives one file; parameters with a prior
                       are sampled
  --ambient FILE.wav   path; recording of the background sound, looped; a sample of 1 is
                       full_scale_pa of [ambient], or 1 Pa
model:
  --seconds S          positive; duration of the recordings [s] (default: until the last
                       blast is over)
output:
  --out DIR!           path; folder for one file for each sensor, truth.csv,
                       listen.json, waveforms.png, spectrograms.png and report.html
  ...out
advanced:
  --packets HZ         positive; packets per second, for the same samples in constant
                       memory; an interrupted run keeps the samples written so far
                       (default: one packet)
  --seed N             seed = 0; seed of priors and noise
"""

import argparse
from pathlib import Path


def run(options: argparse.Namespace) -> int:
    """Record, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "recording": 4.0, "drawing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.files import check_out, writing
    from jblast.report.listen import (
        PICTURES,
        ListenAnswer,
        listen_view,
        recordings_answer,
    )
    from jblast.report.output import Answer, deliver
    from jblast.sensors.record_writer import (
        TRUTH,
        record_comments,
        record_names,
        write_records,
    )
    from jblast.study.running import listening_of

    out = Path(options.out)
    check_out(out, ("listen.json", TRUTH), force=options.force)
    listening, notes = listening_of(
        options.scene, options.seconds, options.seed, options.ambient
    )
    # the names of the records are known only now, and a recording is not overwritten
    names = record_names(listening.sensors).values()
    check_out(out, (*names, *PICTURES), force=options.force)
    comments = [*record_comments(listening, options.scene, options.seed), *notes]
    begin("recording")
    with writing(out):
        # With --packets the files grow packet by packet, in constant memory.
        records = write_records(listening, out, comments, options.packets)
    begin("drawing")
    recordings = recordings_answer(listening, records, notes)
    document = ListenAnswer(options.scene, options.seed, recordings)
    written = dict.fromkeys([TRUTH, *(record.file for record in records)])
    answer = Answer(document, listen_view(recordings, out), files=written)
    return deliver(answer, options, folder=options.out)
