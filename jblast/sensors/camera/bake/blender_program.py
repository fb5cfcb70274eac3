"""Blender as another program: found, run, and the settings of its scripts.

The scripts run in Blender's own Python, which has no jblast. Each reads its settings
from a JSON file.
"""

import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from jblast.errors import InputError, argument
from jblast.sensors.camera.bake.recipe import (
    LIGHT,
    LOOK,
    SAMPLES,
    Directions,
    Instant,
    Recipe,
    anchor_share,
    azimuth_elevation,
)

SCRIPTS = Path(__file__).parent
"""Scripts that Blender runs, in a Python without jblast."""
OLDEST = (3, 4)
"""Version that the scripts are written for."""
LOOK_S = 0.5
"""Interval between two looks at Blender's progress [s]."""
COLDEST = 0.05
"""Least heat that counts as hot [unit of the simulation]: gas that has mixed with air
has less, and does not glow."""


def found(program: str | None) -> tuple[str, str]:
    """Return path and version of Blender.

    Args:
        program: Where it is; None: on the PATH.

    Raises:
        InputError: There is none, it does not start, or it is too old.
    """
    path = shutil.which(program or "blender")
    if path is None:
        raise InputError(
            f"{argument('blender')}: expected the program Blender"
            + (f" at {program}" if program else " on the PATH")
            + ", found none (of Debian: apt-get install blender)"
        )
    try:
        said = subprocess.run(
            [path, _option("version")],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=120,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(
            f"{argument('blender')} {path}: expected the program Blender, but it does "
            f"not start ({getattr(error, 'strerror', None) or 'no answer'})"
        ) from None
    version = re.search(r"Blender (\d+)\.(\d+)(?:\.\d+)?", said.stdout)
    if version is None:
        raise InputError(
            f"{argument('blender')} {path}: expected the program Blender, but it does "
            "not say its version"
        )
    if (int(version[1]), int(version[2])) < OLDEST:
        raise InputError(
            f"{argument('blender')} {path}: expected Blender "
            f"{'.'.join(map(str, OLDEST))} or later, got {version[0]}"
        )
    return path, version[0].removeprefix("Blender ")


def run(
    program: str,
    blend: Path | None,
    script: str,
    settings: Path,
    log: Path,
    looked: Callable[[], None],
) -> str | None:
    """Run a script in Blender, without a window, and wait for it.

    Args:
        program: Where Blender is.
        blend: File that it opens; None: its own, as it comes.
        script: Name of a script in `SCRIPTS`, without `blender_`.
        settings: File that the script reads.
        log: Blender's output is appended to this file.
        looked: Called twice a second meanwhile, and once when it is over.

    Returns:
        What went wrong, in words; None if nothing did.
    """
    command = [
        str(Path(program).resolve()),
        *(_option("background"), _option("python-exit-code"), "3"),
        *([] if blend is None else [str(blend.resolve())]),
        *(_option("factory-startup"), _option("python")),
        *(str(SCRIPTS / f"blender_{script}.py"), "--", str(settings.resolve())),
    ]
    with log.open("ab") as said:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            cwd=log.parent,  # Mantaflow leaves a file of noise where it is started
        )
        try:
            while process.poll() is None:
                looked()
                time.sleep(LOOK_S)
        finally:
            process.kill()  # if we are interrupted; else it is over already
            process.wait()
    looked()
    code = process.returncode
    if code == 0:
        return None
    if code < 0:
        return f"was killed by signal {-code} ({signal.Signals(-code).name})"
    return f"ended with code {code}"


def _option(name: str) -> str:
    """Return an option of Blender's."""
    return f"--{name}"


def simulation_settings(
    recipe: Recipe, instants: Sequence[Instant], work: Path
) -> dict[str, Any]:
    """Return what `blender_simulate.py` reads.

    Args:
        recipe: What the set is made from.
        instants: Frames of which is to be written down how far they reach.
        work: Where the cache, the scene and what was found go.
    """
    work = work.resolve()
    return {
        "physics": recipe.physics,
        "seed": recipe.seed,
        "cache": str(work / "cache"),
        "blend": str(work / "baked.blend"),
        "baked": str(work / "baked.json"),
        "frames": [instant.step for instant in instants],
    }


def rendering_settings(
    recipe: Recipe,
    instants: Sequence[Instant],
    hot: Sequence[float],
    sides: Sequence[float],
    direction: Directions,
    folders: dict[int, Path],
) -> dict[str, Any]:
    """Return what `blender_render_views.py` reads.

    Args:
        recipe: What the set is made from.
        instants: Of the frames.
        hot: How hot each is.
        sides: How much of the world each holds [Blender's metre].
        direction: From where each view of the set sees it.
        folders: Of the views that are to be rendered, by their number.
    """
    azimuth, elevation = (angle.tolist() for angle in azimuth_elevation(direction))
    return {
        "engine": recipe.engine,
        "size": recipe.size,
        "samples": SAMPLES,
        "look": LOOK,
        "light": LIGHT,
        "frames": [
            {
                "frame": instant.step,
                "hot": max(warmth, COLDEST),
                "fade": instant.fade,
                "extinction": LOOK["extinction"],
                "scale": float(side),
            }
            for instant, warmth, side in zip(instants, hot, sides, strict=True)
        ],
        "views": [
            {
                "folder": str(folder.resolve()),
                "azimuth": azimuth[number],
                "elevation": elevation[number],
                "anchor": anchor_share(elevation[number]),
            }
            for number, folder in folders.items()
        ],
    }
