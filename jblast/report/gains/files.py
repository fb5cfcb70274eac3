"""Tuned gains as files: the scene with them, the answer, the figure."""

import copy
import json
import tomllib
from functools import partial
from pathlib import Path
from typing import Any

import jblast
from jblast.files import write_text
from jblast.report.figure_files import write_drawn
from jblast.report.gains.answer import GainsAnswer, gains_answer, keys_of_gains
from jblast.report.tune.files import FIGURE, JSON, SCENE
from jblast.report.tune.scene_file import moved, scene_text
from jblast.study.gains.records import TunedGains


def write_gains(tuned: TunedGains, directory: Path, scene: str) -> tuple[str, ...]:
    """Write tuned gains into a directory; return the names of the files.

    A figure that cannot be drawn costs nothing but itself: a warning names it.

    Args:
        tuned: What was found.
        directory: Where to; made if it is not there.
        scene: The file of the scene, which is read again.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    document = moved(tomllib.loads(Path(scene).read_text("utf-8")), scene, directory)
    comment = f"gains tuned by jblast {jblast.__version__} to the blasts of this scene"
    for name in (SCENE, JSON, FIGURE):
        (directory / name).unlink(missing_ok=True)
    write_text(directory / SCENE, scene_text(with_gains(document, tuned), [comment]))
    from jblast.report.gains.figure import gains_figure

    names = [SCENE, JSON]
    if write_drawn(partial(gains_figure, tuned), directory / FIGURE) is not None:
        names.append(FIGURE)
    write_text(directory / JSON, as_json(gains_answer(tuned, scene, tuple(names))))
    return tuple(names)


def with_gains(document: dict[str, Any], tuned: TunedGains) -> dict[str, Any]:
    """Return a scene's tables with the tuned gains in them."""
    changed = copy.deepcopy(document)
    control = changed["vehicle"].setdefault("control", {})
    found = keys_of_gains(tuned.after.gains)
    control["integral"] = "ki_pos" in found
    for key, value in found.items():
        control[key] = list(value) if isinstance(value, tuple) else value
    return changed


def as_json(answer: GainsAnswer) -> str:
    """Return what `--json` prints, and tune.json holds."""
    document = {"schema": 1} | answer.to_dict()
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
