"""Monte Carlo studies of a scene: samples, outcomes and their statistics.

A study draws a scene N times and computes the requested outcomes of each sample: `run`
makes a data set of `read_study`'s study, `outcomes` is one sample as a pure function,
`own_outcome` describes a function of yours.
Names are imported on first use.
"""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.study.columns import (
        columns_of as columns_of,
        read_columns as read_columns,
    )
    from jblast.study.file import Axis as Axis, Study as Study, read_study as read_study
    from jblast.study.filming import FilmOptions as FilmOptions, film_of as film_of
    from jblast.study.outcome.family import own_outcome as own_outcome
    from jblast.study.run_detectors import RunDetectors as RunDetectors
    from jblast.study.running import (
        packets_of as packets_of,
        prepare_run as prepare_run,
    )
    from jblast.study.runs import run as run, run_into as run_into
    from jblast.study.sensitivity import lane_shares as lane_shares
    from jblast.study.slabs import draw as draw, outcomes as outcomes

__getattr__, __dir__ = lazy_face(__name__)
