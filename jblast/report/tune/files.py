"""What was tuned as files: the scene, the answer, the figure."""

import tomllib
from functools import partial
from pathlib import Path

import jblast
from jblast.files import write_text
from jblast.inference.tuning.result import Tuned
from jblast.report.figure_files import write_drawn
from jblast.report.tune.answer import as_json, tune_answer
from jblast.report.tune.scene_file import moved, scene_text, tuned_document

SCENE, JSON, FIGURE = "scene.toml", "tune.json", "tune.png"


def write_tuned(
    tuned: Tuned, directory: Path, scene: str, recorded: str
) -> tuple[str, ...]:
    """Write what was tuned into a directory; return the names of the files.

    A figure that cannot be drawn costs nothing but itself: a warning names it.

    Args:
        tuned: What was found.
        directory: Where to; made if it is not there.
        scene: The file of the scene, which is read again.
        recorded: The record.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    document = moved(tomllib.loads(Path(scene).read_text("utf-8")), scene, directory)
    index = tuned.problem.evidence.index
    sensor = tuned.scene.sensors[index].name if index >= 0 else None
    values = {name: one.fitted for name, one in tuned.numbers.items()}
    untold = [name for name, one in tuned.numbers.items() if one.value is None]
    comments = [
        f"tuned by jblast {jblast.__version__}: {', '.join(values)} of "
        f"{Path(scene).name} to {Path(recorded).name}",
    ]
    if untold:
        comments.append(f"not told by the record: {', '.join(untold)}")
    text = scene_text(tuned_document(document, values, sensor), comments)
    for name in (SCENE, JSON, FIGURE):
        (directory / name).unlink(missing_ok=True)
    write_text(directory / SCENE, text)
    from jblast.report.tune.figure import tune_figure

    names = [SCENE, JSON]
    if write_drawn(partial(tune_figure, tuned), directory / FIGURE) is not None:
        names.append(FIGURE)
    answer = tune_answer(tuned, scene, recorded, tuple(names))
    write_text(directory / JSON, as_json(answer))
    return tuple(names)
