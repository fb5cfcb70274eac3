"""A set of views is made: simulated, rendered view by view, and gone on with if killed.

What is not finished stands in `.bake` within the set's folder, with the recipe. Views
are written as they are finished, the index at the end, and then `.bake` goes.
"""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, argument
from jblast.files import write_text
from jblast.progress import counted, stages
from jblast.sensors.camera.bake import blender_program
from jblast.sensors.camera.bake.configuration import (
    rendering_settings,
    simulation_settings,
)
from jblast.sensors.camera.bake.framing import picture_sides
from jblast.sensors.camera.bake.own_files import baked_views, read_json, recipe_views
from jblast.sensors.camera.bake.recipe import Recipe, differences
from jblast.sensors.camera.bake.set_files import (
    LAYERS,
    is_whole_view,
    view_file,
    write_index,
    write_view,
)
from jblast.sensors.camera.bake.timeline import Instant, timeline
from jblast.sensors.camera.files.view_index import INDEX
from jblast.sensors.camera.sampling.lattices import Directions, azimuth_elevation

WORK = ".bake"
"""Folder of what is not finished."""


class Baking:
    """A set that is being made.

    Attributes:
        recipe: What it is made from.
        out: Its folder.
        direction: From where it is seen.
        instants: Of its frames.
    """

    def __init__(
        self,
        recipe: Recipe,
        out: Path,
        direction: Directions | None = None,
        instants: list[Instant] | None = None,
    ):
        self.recipe, self.out = recipe.checked(), out
        self.direction = recipe.directions() if direction is None else direction
        self.instants = timeline(recipe.frames) if instants is None else instants
        self.work = out / WORK
        self.log = self.work / "blender.log"

    def begin(self, *, force: bool) -> None:
        """Make the folder, or go on in one that holds a part of the same set.

        Raises:
            InputError: It holds a finished set, or a part of another one, and is not
                to be overwritten; or a file stands where a view goes, and was not
                baked.
        """
        recipe = self.work / "recipe.json"
        ours = self._identity()
        theirs = read_json(recipe, "the recipe of a set") if recipe.exists() else None
        index = self.out / INDEX
        if index.exists() and not force:
            raise InputError(
                f"{index}: exists already; expected a new directory, or "
                f"{argument('force')} to overwrite it"
            )
        known = baked_views(index) | recipe_views(theirs)
        for number in range(len(self.direction)):
            if (
                view_file(number) not in known
                and (self.out / view_file(number)).exists()
            ):
                raise InputError(
                    f"{self.out / view_file(number)}: is in the way of a view, and of "
                    "no set that was baked here; expected a directory without it"
                )
        if force and (index.exists() or theirs != ours):
            self._clear(known)
            theirs = None
        if theirs is not None:
            wrong = differences(ours, theirs)
            if wrong:
                raise InputError(
                    f"{self.out}: holds a part of a set of another recipe "
                    f"({'; '.join(wrong[:4])}); expected the same, a new directory, or "
                    f"{argument('force')} to begin anew"
                )
            return
        self.work.mkdir(parents=True, exist_ok=True)
        write_text(recipe, json.dumps(ours, indent=1))

    def make(self, program: str, version: str) -> list[str]:
        """Make what is missing; return the names of the files.

        Raises:
            InputError: Blender fails, is killed, or leaves something out; what is
                finished is kept.
        """
        begin = stages({"simulating": 0.3, "rendering": 1.0})
        begin("simulating")
        self._simulate(program)
        begin("rendering")
        self._render(program)
        write_index(
            self.out,
            self.recipe,
            self.instants,
            self.direction,
            self._sides(),
            version,
        )
        shutil.rmtree(self.work)
        views = range(len(self.direction))
        return [INDEX, *(view_file(number) for number in views)]

    def finished(self) -> list[int]:
        """Return which views are there and whole; one that is not whole goes."""
        found = []
        for number in range(len(self.direction)):
            path = self.out / view_file(number)
            if not path.exists():
                continue
            if is_whole_view(path, self.recipe.size, len(self.instants)):
                found.append(number)
            else:
                path.unlink()
        return found

    def _simulate(self, program: str) -> None:
        """Let Mantaflow bake, from the start: half a cache is none."""
        baked = self.work / "baked.json"
        if baked.exists():
            return
        cache = self.work / "cache"
        shutil.rmtree(cache, ignore_errors=True)
        settings = simulation_settings(self.recipe, self.instants, self.work)
        grids = 2 if self.recipe.physics["noise"] else 1
        through = counted(grids * int(self.recipe.physics["last"]), "steps")

        def looked() -> None:
            through(len(list(cache.glob("*/fluid_*.vdb"))))

        self._run(program, None, "simulate", settings, looked)
        if not baked.exists():
            raise self._failed("ended without a simulated explosion")

    def _render(self, program: str) -> None:
        """Render what is missing, and write views as their frames come."""
        done = set(self.finished())
        missing = [n for n in range(len(self.direction)) if n not in done]
        if not missing:
            return
        settings = rendering_settings(
            self.recipe,
            self.instants,
            [extent["hot"] for extent in self._extents()],
            self._sides().tolist(),
            self.direction,
            {number: self._folder(number) for number in missing},
        )
        each = len(self.instants) * len(LAYERS)
        through = counted(len(self.direction) * each, "pictures")

        def looked() -> None:
            count = len(done) * each
            for number in missing:
                if number in done:
                    continue
                there = len(list(self._folder(number).glob("[0-9]*.exr")))
                if there == each:
                    write_view(
                        self.out / view_file(number),
                        self._folder(number),
                        self.recipe.size,
                        len(self.instants),
                    )
                    shutil.rmtree(self._folder(number))
                    done.add(number)
                count += there
            through(count)

        blend = self.work / "baked.blend"
        self._run(program, blend, "render_views", settings, looked)
        if len(done) < len(self.direction):
            raise self._failed("ended before all views were rendered")

    def _run(
        self,
        program: str,
        blend: Path | None,
        script: str,
        settings: dict[str, Any],
        looked: Callable[[], None],
    ) -> None:
        path = self.work / f"{script}.json"
        write_text(path, json.dumps(settings))
        wrong = blender_program.run(program, blend, script, path, self.log, looked)
        if wrong:
            raise self._failed(wrong)

    def _failed(self, wrong: str) -> InputError:
        """Return an error that says what Blender did, and what is kept."""
        kept = len(self.finished())
        hint = ""
        if self.recipe.engine == "eevee":
            hint = " (eevee may need a display; cycles does without)"
        return InputError(
            f"{self.log}: Blender {wrong}{hint}; expected it to finish; {kept} of "
            f"{len(self.direction)} views are finished and kept, and the same command "
            "goes on from there"
        )

    def _sides(self) -> np.ndarray:
        """Return the side of each frame [Blender's metre]."""
        extents = self._extents()
        reach, top = (np.array([e[k] for e in extents]) for k in ("reach", "top"))
        _, elevation = azimuth_elevation(self.direction)
        return picture_sides(reach, top, elevation)

    def _extents(self) -> list[dict[str, Any]]:
        """Return how hot each frame is and how far it reaches, as was simulated."""
        return read_json(self.work / "baked.json", "what was simulated")

    def _folder(self, number: int) -> Path:
        return self.work / "frames" / f"{number:03d}"

    def _identity(self) -> dict[str, Any]:
        """Return what makes the set this one and no other."""
        return self.recipe.as_json() | {
            "directions": np.round(self.direction, 6).tolist()
        }

    def _clear(self, known: set[str]) -> None:
        """Remove a set, or a part of one, that is overwritten, and nothing else."""
        shutil.rmtree(self.work, ignore_errors=True)
        (self.out / INDEX).unlink(missing_ok=True)
        for name in known:
            (self.out / name).unlink(missing_ok=True)
