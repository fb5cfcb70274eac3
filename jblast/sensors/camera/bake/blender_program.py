"""Blender as another program: found, asked its version, run, and what it died of."""

import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from jblast.errors import InputError, argument

SCRIPTS = Path(__file__).parent / "blender"
"""Scripts that Blender runs; its Python does not know jblast."""

OLDEST = (3, 4)
"""Version that the scripts are written for."""

LOOK_S = 0.5
"""How often is looked how far Blender is [s]."""


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
        script: Name of one of `SCRIPTS`.
        settings: File that the script reads.
        log: What is said is added to this file.
        looked: Called twice a second meanwhile, and once when it is over.

    Returns:
        What went wrong, in words; None if nothing did.
    """
    command = [
        *(
            str(Path(program).resolve()),
            _option("background"),
            _option("python-exit-code"),
            "3",
        ),
        *([] if blend is None else [str(blend.resolve())]),
        *(_option("factory-startup"), _option("python")),
        *(str(SCRIPTS / f"{script}.py"), "--", str(settings.resolve())),
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
