"""What the readings of a world tell of its blasts, beside the truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jblast.errors import InputError
from jblast.inference import fit_each
from jblast.inference.fitting.place.confidence_ellipse import (
    ConfidenceEllipse,
    charge_ellipse,
)
from jblast.inference.fitting.summary import Estimate
from jblast.observations import read
from jblast.observations.grouping import by_shot
from jblast.report.estimates import printed_estimate
from jblast.report.words import capitalised, parameter_words
from jblast.world import scene_to_fit

TRUTH = {
    "charge_mass_kg": lambda blast: blast["mass_kg"],
    "charge_east_m": lambda blast: blast["position_m"][0],
    "charge_north_m": lambda blast: blast["position_m"][1],
    "charge_up_m": lambda blast: blast["position_m"][2],
    "origin_time_s": lambda blast: blast["time_s"],
}
"""What a fit may be asked, by what run.json says of a blast."""


@dataclass(frozen=True)
class ShotAnswer:
    """What the readings of one blast tell.

    Attributes:
        shot: Its name.
        rows: Parameter, truth, answer and 90 % interval in words, and whether the
            truth lies inside.
        ellipse: Where it stood, 90 %; None where that was not told.
        said: Why there is no answer, or that it is doubtful; "" where there is nothing
            to say.
    """

    shot: str
    rows: tuple[tuple[str, str, str, str, bool], ...]
    ellipse: ConfidenceEllipse | None
    said: str = ""


def answers_of(
    directory: Path, document: dict[str, Any], scene: str | Path
) -> tuple[ShotAnswer, ...]:
    """Fit the readings of each blast of a world by itself.

    Args:
        directory: The world's folder.
        document: What its run.json says.
        scene: The scene that it was drawn from; [world] becomes the prior.

    Raises:
        InputError: The scene or the readings cannot be used.
    """
    uncertain = scene_to_fit(scene)
    logs = by_shot(read(directory / "observations.csv"))
    blasts = {blast["shot"]: blast for blast in document["blasts"]}
    found = fit_each(logs, uncertain)
    return tuple(
        _answer(shot, found[shot], blasts[shot]) for shot in logs if shot in blasts
    )


def _answer(shot: str, found: Any, blast: dict[str, Any]) -> ShotAnswer:
    if isinstance(found, InputError):
        return ShotAnswer(shot, (), None, str(found))
    rows = [
        _row(name, found.summary.estimates[name], TRUTH[name](blast))
        for name in found.summary.free
        if name in TRUTH
    ]
    said = "" if found.exit_code == 0 else "doubtful: see what `jblast fit` says"
    return ShotAnswer(shot, tuple(rows), charge_ellipse(found), said)


def _row(
    name: str, estimate: Estimate, truth: float
) -> tuple[str, str, str, str, bool]:
    printed = printed_estimate(name, estimate)
    low, high = estimate.q05, estimate.q95
    held = low is not None and high is not None and low <= truth <= high
    words = capitalised(parameter_words(name))
    return words, f"{truth:.6g}", printed.value_and_beside, printed.interval, held
