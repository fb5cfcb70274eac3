"""Arrivals and pressures a second, draws and statistics included."""

import tempfile

import jax

from calibration.study_cases import air_study
from calibration.study_clock import best, platform, programs_of
from jblast.study.engine.launch import mesh_of
from jblast.study.engine.summary import SummaryStore
from jblast.study.sampling.work import Reduced, Work

AIR_TILES = {"cpu": 1 << 21, "gpu": 1 << 29}
"""Samples of a tile at 16 sensors: about a second."""


def air(count: int, samples: int, devices: int | None = None) -> tuple[float, float]:
    """Return the seconds of a tile of so many samples, and of its programs alone."""
    study = air_study(count, 256 * samples)  # the most tiles there are
    reduced = Reduced(Work(study, mesh_of(devices)))
    assert reduced.tile == samples, (reduced.tile, samples)
    with tempfile.TemporaryDirectory() as folder:
        store = SummaryStore(folder, reduced.work.variables, 1, reduced.tiles)
        store.create(reduced.anchors, reduced.tile)

        def tile() -> None:
            store.write(0, reduced.states(0))

        whole, alone = best(tile, programs_of(tile))
    return whole, alone


def air_lines() -> list[str]:
    """Measure arrivals and pressures."""
    lines = ["arrival + pressure, draws and statistics included"]
    samples = AIR_TILES[platform()]
    for count in (16, 1):
        each = samples if count == 16 else 8 * samples
        whole, alone = air(count, each)
        lines.append(
            f"  {count:2} sensors, evaluations/s           {count * each / whole:14.3g}"
            f"   a tile {whole:.2g} s, {1 - alone / whole:.1%} of it the engine's"
        )
    if platform() == "gpu" and len(jax.devices()) > 1:
        one = samples / air(16, samples, 1)[0]
        two = 2 * samples / air(16, 2 * samples, 2)[0]
        lines.append(
            f"  16 sensors, 1 and 2 devices          {16 * one:14.3g}{16 * two:12.3g}"
            f"   weak scaling {two / one / 2:.1%}"
        )
    return lines
