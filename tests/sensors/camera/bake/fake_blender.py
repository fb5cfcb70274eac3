#!/usr/bin/env python3
"""Stands for Blender in tests: reads the same configurations, draws a growing ball.

The variable FAKE_BLENDER says what goes wrong: `fail`, `kill` or `quiet` (ends
too early) after so many pictures, as `kill:5`; `nothing` that is simulated.
"""

import json
import os
import signal
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[4]))
from tests.sensors.camera.bake.exr_file import exr_bytes

WRONG, _, AFTER = os.environ.get("FAKE_BLENDER", "").partition(":")


def installed(folder: Path) -> Path:
    """Put a program into a folder that is this one, run by this Python."""
    program = folder / "blender"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{__file__}" "$@"\n')
    program.chmod(0o755)
    return program


def main() -> None:
    if sys.argv[1:] == ["--version"]:
        print(os.environ.get("FAKE_VERSION", "Blender 3.4.1"))  # noqa: T201
        return
    config = json.loads(Path(sys.argv[-1]).read_text())
    if sys.argv[-3].endswith("simulate.py"):
        simulate(config)
    else:
        render(config)


def simulate(config: dict) -> None:
    if WRONG == "nothing":
        return
    cache = Path(config["cache"]) / "data"
    cache.mkdir(parents=True)
    (cache / "fluid_data_0001.vdb").write_bytes(b"")
    Path(config["blend"]).write_bytes(b"")
    seen = [
        {"frame": step, "hot": 1.0, "reach": 0.5 + 0.01 * step, "top": 0.02 * step}
        for step in config["frames"]
    ]
    Path(config["baked"]).write_text(json.dumps(seen))


def render(config: dict) -> None:
    drawn = 0
    for view in config["views"]:
        folder = Path(view["folder"])
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(len(config["frames"])):
            for layer in ("glow", "shade"):
                path = folder / f"{number:04d}.{layer}.exr"
                if path.exists():
                    continue
                if drawn == int(AFTER or -1):
                    wrong()
                data = exr_bytes(ball(config["size"], number, layer))
                path.with_name("part").write_bytes(data)
                path.with_name("part").rename(path)
                drawn += 1


def wrong() -> None:
    if WRONG == "fail":
        sys.exit("Error: out of memory")
    if WRONG == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if WRONG == "quiet":
        sys.exit(0)


def ball(size: int, number: int, layer: str) -> dict[str, list[list[float]]]:
    radius = size * (0.15 + 0.02 * number)
    middle = (size - 1) / 2
    inside = [
        [float((x - middle) ** 2 + (y - middle) ** 2 < radius**2) for x in range(size)]
        for y in range(size)
    ]
    light = 1.0 if layer == "glow" else 0.25
    lit = [[light * value for value in row] for row in inside]
    return {"R": lit, "G": lit, "B": lit, "A": inside}


if __name__ == "__main__":
    main()
