"""Fits a second of a study, and of `fit_many` from host to host."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from calibration.six_stations import LAWS, columns_of, draw, scene_of
from calibration.study_cases import AIR, sensors, study_of
from calibration.study_clock import best, platform, programs_of
from jblast.inference import fit_many
from jblast.inference.many.fit_many import fit_from_host
from jblast.sensors import planned_layout
from jblast.study.engine.tiles import calculated
from jblast.study.outcome.fit import AGAIN_Z
from jblast.study.sampling.work import Work

FITTED = {"cpu": 1 << 16, "gpu": 1 << 22}
LOGS = {"cpu": 1 << 16, "gpu": 1 << 23}
PIECES = {"cpu": (1 << 13, 1 << 14), "gpu": (1 << 18, 1 << 19, 1 << 20)}


def fit_lines() -> list[str]:
    """Measure fits, and `fit_many` of the same logs."""
    count = FITTED[platform()]
    records = 'records = { air_arrival_s = 2e-4, peak_overpressure_pa = "20%" }'
    scene = AIR.replace("[{ normal = [0.0, 1.0] }, 0.0, 0.0]", "[0.0, 0.0, 0.0]")
    study = study_of(
        scene + sensors(6, records), f'samples = {count}\noutcomes = ["fit_error"]\n'
    )
    work = Work(study)
    believed = study.believed[0]
    layout, sigma, _ = planned_layout(believed.scene)
    quantities: tuple[str, ...] = ("air_arrival_s", "peak_overpressure_pa")
    laws: dict[str, str] = dict.fromkeys(quantities, "kingery_bulmash")
    blocks = np.arange(count // work.numbering.block)
    drawn = work.launcher(0)(*work.given(blocks))["_readings"]
    readings = np.ascontiguousarray(drawn.reshape(count, -1))
    batch = max(work.at_once * work.numbering.tile, 1 << 16)

    def tiles() -> None:
        for _ in calculated(work, range(work.numbering.tiles)):
            pass

    def fit(**how: Any) -> None:
        for begin in range(0, count, batch):
            some = readings[begin : begin + batch]
            fits = fit_many(believed, layout, some, np.asarray(sigma), laws, **how)
            jax.device_get(jax.tree.leaves(fits))

    def alike() -> None:
        fit(again_z=AGAIN_Z)

    ours, draws, alone, same = best(tiles, programs_of(tiles), fit, alike)
    return [
        f"fits of a mass to 12 readings: {count:,}, float64",
        f"  fits/s, draws and outcomes included  {count / ours:14,.0f}",
        f"  by fit_many, host to host            {count / alone:14,.0f}"
        f"   (the study's share of it: {alone / ours:.1%})",
        f"  by fit_many, begun again as there    {count / same:14,.0f}"
        f"   (the study's share of it: {same / ours:.1%})",
        f"  draws of the readings alone          {count / draws:14,.0f}"
        f"   (its share of draws and fit_many: {(same + draws) / ours:.1%})",
    ]


def host_lines() -> list[str]:
    """Measure fits from host to host."""
    problem = draw(LOGS[platform()])
    uncertain = scene_of(problem)
    layout, sigma, _ = planned_layout(uncertain.scene)
    readings = np.ascontiguousarray(problem.readings[:, columns_of(layout)])
    given = (uncertain, layout, readings, np.asarray(sigma), LAWS)
    count = len(readings)
    names: list[str] = []
    calls: list[Callable[[], Any]] = []

    def whole() -> None:
        jax.device_get(jax.tree.leaves(fit_many(*given, noise="gaussian")))

    names.append("fit_many, the whole answer")
    calls.append(whole)
    here = jax.device_put(readings[: PIECES[platform()][-1]])

    def there() -> Any:
        fits = fit_many(uncertain, layout, here, given[3], LAWS, noise="gaussian")
        return fits.z, fits.covariance

    def add(name: str, **how: Any) -> None:
        names.append(name)
        calls.append(lambda: fit_from_host(*given, noise="gaussian", **how))

    for piece in PIECES[platform()]:
        add(f"z, sd, converged, {piece:,}", piece=piece)
    for piece in PIECES[platform()]:
        add(f"likewise in float32, {piece:,}", piece=piece, dtype=np.float32)
    for piece in PIECES[platform()]:
        for dtype in (None, np.float32):
            out = fit_from_host(*given, noise="gaussian", piece=piece, dtype=dtype)
            word = " float32," if dtype else ""
            add(f"into old arrays,{word} {piece:,}", piece=piece, dtype=dtype, out=out)
    add("z alone", keep=("z",))
    took = best(*calls)
    (on_device,) = best(there)
    lines = [
        f"fits from host to host, 12 readings, 4 unknowns: {count:,} logs",
        f"  {'fit_many, from device to device':38s}{len(here) / on_device:14,.0f}",
    ]
    rates = zip(names, took, strict=True)
    return [*lines, *(f"  {name:38s}{count / one:14,.0f}" for name, one in rates)]
