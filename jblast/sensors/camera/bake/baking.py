"""Baking of a set of views: simulation, then rendering; resumed if interrupted.

Unfinished files are in `.bake` within the set's folder, with the recipe. Views are
written as they are finished, the index at the end, and then `.bake` is removed. In an
existing folder only baked files are overwritten; all others belong to the user.

Blender is a separate program, which is searched, run and monitored. The scripts run in
its own Python, which has no jblast. Each reads its settings from a JSON file.
"""

import json
import re
import shutil
import signal
import subprocess
import time
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import InputError, argument, read_text
from jblast.files import replacing, write_text
from jblast.progress import counted, stages
from jblast.sensors.camera.bake.coding import (
    AIR_TEMPERATURE,
    REFERENCE_TEMPERATURE,
    Channels,
    columns_for,
    frames_of_sheet,
    layers_of,
    read_exr,
    sheet,
    sheet_layout,
    visible_radius,
)
from jblast.sensors.camera.bake.recipe import (
    LIGHT,
    LOOK,
    SAMPLES,
    Directions,
    Instant,
    Recipe,
    anchor_px,
    anchor_share,
    azimuth_elevation,
    differences,
    picture_sides,
    timeline,
)
from jblast.sensors.camera.files.views import INDEX

WORK = ".bake"
"""Folder of unfinished files."""
MAKER = "jblast bake"
"""Maker, as stated in an index."""
LAYERS = ("glow", "shade")
"""Pictures of a frame: light of the gas itself, and of the sky."""
QUALITY, ALPHA_QUALITY, EFFORT = 88, 90, 4
"""Options of lossy WebP. Heat and opacity are data, so the quality is high; artefacts
in transparent parts are removed on reading (`views.FAINTEST`)."""
SCRIPTS = Path(__file__).parent
"""Scripts that Blender runs, in a Python without jblast."""
OLDEST_BLENDER = (3, 4)
"""Version for which the scripts are written."""
LOOK_S = 0.5
"""Interval between two checks of Blender's progress [s]: a progress bar needs no more,
and a check lists folders."""
COLDEST = 0.05
"""Smallest heat of a frame's hot gas [unit of the simulation]. Gas mixed with air has
less, and does not glow."""


class Baking:
    """A set of views in the making.

    Attributes:
        recipe: Its recipe.
        out: Its folder.
        direction: Directions from which it is seen.
        instants: Instants of its frames.
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
        """Create the folder, or continue in one with a part of the same set.

        Raises:
            InputError: It contains a finished set, or a part of another one, and may
                not be overwritten; or a file that was not baked has the name of a view.
        """
        recipe = self.work / "recipe.json"
        ours = self._identity()
        # the stored recipe decides whether unfinished work is of the same set
        theirs = read_json(recipe, "the recipe of a set") if recipe.exists() else None
        index = self.out / INDEX
        if index.exists() and not force:
            raise InputError(
                f"{index}: exists already; expected a new directory, or "
                f"{argument('force')} to overwrite it"
            )
        # only these names may be overwritten or removed
        known = baked_views(index) | recipe_views(theirs)
        for number in range(len(self.direction)):
            if (
                view_file(number) not in known
                and (self.out / view_file(number)).exists()
            ):
                raise InputError(
                    f"{self.out / view_file(number)}: has the name of a view, but "
                    "belongs to no baked set; expected a directory without it"
                )
        if force and (index.exists() or theirs != ours):
            self._clear(known)
            theirs = None
        if theirs is not None:
            problem = differences(ours, theirs)
            if problem:
                raise InputError(
                    f"{self.out}: contains part of a set with another recipe "
                    f"({'; '.join(problem[:4])}); expected the same, a new directory, "
                    f"or {argument('force')} to start again"
                )
            return
        self.work.mkdir(parents=True, exist_ok=True)
        write_text(recipe, json.dumps(ours, indent=1))

    def make(self, program: str, version: str) -> list[str]:
        """Make the missing parts; return the names of the files.

        Raises:
            InputError: Blender fails, is killed, or leaves out a part; finished parts
                are kept.
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
        """Return the complete views; incomplete ones are removed."""
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
        """Run Mantaflow from the start: an incomplete cache cannot be continued."""
        baked = self.work / "baked.json"
        if baked.exists():
            return
        cache = self.work / "cache"
        shutil.rmtree(cache, ignore_errors=True)
        settings = simulation_settings(self.recipe, self.instants, self.work)
        # noise is a second, finer grid with files of its own
        grids = 2 if self.recipe.physics["noise"] else 1
        through = counted(grids * int(self.recipe.physics["last"]), "steps")

        def update() -> None:
            through(len(list(cache.glob("*/fluid_*.vdb"))))

        self._run(program, None, "simulate", settings, update)
        if not baked.exists():
            raise self._failed("ended without a simulated explosion")

    def _render(self, program: str) -> None:
        """Render missing pictures, and write each view when its frames are complete."""
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

        def update() -> None:
            count = len(done) * each
            for number in missing:
                if number in done:
                    continue
                there = len(list(self._folder(number).glob("[0-9]*.exr")))
                # packed when complete: uncompressed pictures take far more space
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
        self._run(program, blend, "render_views", settings, update)
        if len(done) < len(self.direction):
            raise self._failed("ended before all views were rendered")

    def _run(
        self,
        program: str,
        blend: Path | None,
        script: str,
        settings: dict[str, Any],
        update: Callable[[], None],
    ) -> None:
        path = self.work / f"{script}.json"
        write_text(path, json.dumps(settings))
        problem = run_blender(program, blend, script, path, self.log, update)
        if problem:
            raise self._failed(problem)

    def _failed(self, problem: str) -> InputError:
        """Return the error for a failure of Blender, with the finished views."""
        kept = len(self.finished())
        hint = ""
        if self.recipe.engine == "eevee":
            hint = " (eevee may need a display; cycles does not)"
        return InputError(
            f"{self.log}: Blender {problem}{hint}; expected it to finish; {kept} of "
            f"{len(self.direction)} views are finished and kept, and the same command "
            "continues from there"
        )

    def _sides(self) -> np.ndarray:
        """Return the side of each frame [Blender's metre]."""
        extents = self._extents()
        reach, top = (np.array([e[k] for e in extents]) for k in ("reach", "top"))
        _, elevation = azimuth_elevation(self.direction)
        return picture_sides(reach, top, elevation)

    def _extents(self) -> list[dict[str, Any]]:
        """Return heat and extent of each frame, as simulated."""
        return read_json(self.work / "baked.json", "what was simulated")

    def _folder(self, number: int) -> Path:
        return self.work / "frames" / f"{number:03d}"

    def _identity(self) -> dict[str, Any]:
        """Return everything that distinguishes this set from others."""
        return self.recipe.as_json() | {
            "directions": np.round(self.direction, 6).tolist()
        }

    def _clear(self, known: set[str]) -> None:
        """Remove the overwritten set, or part of one, and nothing else."""
        shutil.rmtree(self.work, ignore_errors=True)
        (self.out / INDEX).unlink(missing_ok=True)
        for name in known:
            (self.out / name).unlink(missing_ok=True)


def view_file(number: int) -> str:
    """Return the name of a view's file."""
    return f"{number:02d}.webp"


def write_view(path: Path, folder: Path, size: int, frames: int) -> None:
    """Write a view's sheet from its pictures.

    Args:
        path: The file.
        folder: Folder with `0000.glow.exr`, `0000.shade.exr` and so on.
        size: Side of a frame [px].
        frames: Number of frames.

    Raises:
        InputError: A picture is incomplete, or has another size; it is removed.
    """
    from PIL import Image

    tiles = []
    for index in range(frames):
        pictures = (folder / f"{index:04d}.{layer}.exr" for layer in LAYERS)
        tiles.append(layers_of(*(_rendered_picture(file, size) for file in pictures)))
    pixels = Image.fromarray(sheet(tiles, columns_for(frames)))
    with replacing(path) as temporary:
        pixels.save(
            temporary,
            format="WEBP",
            quality=QUALITY,
            alpha_quality=ALPHA_QUALITY,
            method=EFFORT,
        )


def _rendered_picture(path: Path, size: int) -> Channels:
    """Return a rendered picture; an unusable one is removed, to be rendered again."""
    try:
        found = read_exr(path)
        missing = set("RGBA") - found.keys()
        if missing:
            raise InputError(f"{path}: expected channels R, G, B, A, got {set(found)}")
        if found["A"].shape != (size, size):
            height, width = found["A"].shape
            raise InputError(
                f"{path}: expected {size} x {size} pixels, got {width} x {height}"
            )
    except InputError:
        path.unlink(missing_ok=True)
        raise
    return found


def read_sheet(path: Path) -> UInt8[np.ndarray, "height width 4"]:
    """Return a view's sheet.

    Raises:
        InputError: It is not a complete WebP picture with alpha.
    """
    from PIL import Image

    try:
        with Image.open(path, formats=["WEBP"]) as picture:
            return np.asarray(picture.convert("RGBA"))
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        raise InputError(
            f"{path}: expected a complete WebP picture, but it cannot be read ({error})"
        ) from None


def is_whole_view(path: Path, size: int, frames: int) -> bool:
    """Return True for a view's file that is readable and has the expected tiles."""
    try:
        shape = read_sheet(path).shape[:2]
    except InputError:
        return False
    columns, rows = sheet_layout(shape, size)
    exact = (2 * rows * size, columns * size) == shape
    return exact and columns == columns_for(frames) and columns * rows >= frames


def write_index(
    out: Path,
    recipe: Recipe,
    instants: list[Instant],
    direction: Directions,
    sides: Float[np.ndarray, " frame"],
    version: str,
) -> None:
    """Write the index of a set whose views are complete.

    Args:
        out: Folder of the set.
        recipe: Its recipe.
        instants: Instants of the frames.
        direction: Directions of the views.
        sides: Side of each frame [Blender's metre].
        version: Version of Blender.
    """
    phases = ", ".join(f"{instant.phase:g}" for instant in instants)
    physics = ", ".join(f"{key} = {value}" for key, value in recipe.physics.items())
    lines = [
        "# Views of an explosion; `jblast bake` made them.",
        'kind = "explosion"',
        f"size_px = {recipe.size}",
        f"phases = [{phases}]",
        f"reference_temperature_k = {REFERENCE_TEMPERATURE}",
        f"air_temperature_k = {AIR_TEMPERATURE}",
        "",
        "[made]",
        f'by = "{MAKER}"',
        f'blender = "{version}"',
        f'engine = "{recipe.engine}"',
        'solver = "Mantaflow"',
        f"seed = {recipe.seed}",
        f'sampling = "{recipe.sampling}"',
        f"physics = {{ {physics} }}",
        f"sides = [{', '.join(f'{side:.4g}' for side in sides)}]",
        'licence = "CC0-1.0"',
    ]
    for number, (azimuth, elevation) in enumerate(
        zip(*azimuth_elevation(direction), strict=True)
    ):
        path = out / view_file(number)
        frames = frames_of_sheet(read_sheet(path), recipe.size, len(instants))
        radii = ", ".join(f"{visible_radius(frame.alpha):.2f}" for frame in frames)
        across, down = anchor_px(float(elevation), recipe.size)
        lines += [
            "",
            "[[view]]",
            f'file = "{view_file(number)}"',
            f"azimuth_deg = {azimuth:.4f}",
            f"elevation_deg = {elevation:.4f}",
            f"anchor_px = [{across:g}, {down:.3f}]",
            f"radius_px = [{radii}]",
        ]
    write_text(out / INDEX, "\n".join(lines) + "\n")


def read_json(path: Path, expected: str) -> Any:
    """Return the content of one of our JSON files.

    Raises:
        InputError: It does not exist, or is no JSON.
    """
    try:
        return json.loads(read_text(path, expected))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: expected {expected} in JSON, got something else ({error})"
        ) from None


def baked_views(index: Path) -> set[str]:
    """Return the files of a finished set, by its index; none for other makers."""
    try:
        found = tomllib.loads(index.read_text(encoding="utf-8"))
        if found["made"]["by"] != MAKER:
            return set()
        names = {str(view["file"]) for view in found["view"]}
    except (OSError, ValueError, KeyError, TypeError):  # no index, or another maker's
        return set()
    return names & {view_file(number) for number in range(len(names))}


def recipe_views(recipe: Any) -> set[str]:
    """Return the files of an unfinished set, by its recipe; none for None."""
    if not isinstance(recipe, dict) or not isinstance(recipe.get("directions"), list):
        return set()
    return {view_file(number) for number in range(len(recipe["directions"]))}


def blender_found(program: str | None) -> tuple[str, str]:
    """Return path and version of Blender.

    Args:
        program: Its path; None searches the PATH.

    Raises:
        InputError: It is not found, does not start, or is too old.
    """
    path = shutil.which(program or "blender")
    if path is None:
        raise InputError(
            f"{argument('blender')}: expected the program Blender"
            + (f" at {program}" if program else " on the PATH")
            + ", got none (Debian: apt-get install blender)"
        )
    try:
        answer = subprocess.run(
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
    version = re.search(r"Blender (\d+)\.(\d+)(?:\.\d+)?", answer.stdout)
    if version is None:
        raise InputError(
            f"{argument('blender')} {path}: expected the program Blender, but it does "
            "not print its version"
        )
    if (int(version[1]), int(version[2])) < OLDEST_BLENDER:
        raise InputError(
            f"{argument('blender')} {path}: expected Blender "
            f"{'.'.join(map(str, OLDEST_BLENDER))} or later, got {version[0]}"
        )
    return path, version[0].removeprefix("Blender ")


def run_blender(
    program: str,
    blend: Path | None,
    script: str,
    settings: Path,
    log: Path,
    update: Callable[[], None],
) -> str | None:
    """Run a script in Blender, without a window, and wait for it.

    Args:
        program: Path of Blender.
        blend: File that it opens; None for its default scene.
        script: Name of a script in `SCRIPTS`, without `blender_`.
        settings: File that the script reads.
        log: Blender's output is appended to this file.
        update: Called twice a second while it runs, and once after it ends.

    Returns:
        The failure as text, or None.
    """
    command = [
        str(Path(program).resolve()),
        # without python-exit-code Blender ends with 0 after an error of the script
        *(_option("background"), _option("python-exit-code"), "3"),
        *([] if blend is None else [str(blend.resolve())]),
        *(_option("factory-startup"), _option("python")),
        *(str(SCRIPTS / f"blender_{script}.py"), "--", str(settings.resolve())),
    ]
    with log.open("ab") as output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            cwd=log.parent,  # Mantaflow writes a file of noise to the working directory
        )
        try:
            while process.poll() is None:
                update()
                time.sleep(LOOK_S)
        finally:
            process.kill()  # on an interruption; otherwise it has ended already
            process.wait()
    update()
    code = process.returncode
    if code == 0:
        return None
    if code < 0:
        return f"was killed by signal {-code} ({signal.Signals(-code).name})"
    return f"ended with code {code}"


def _option(name: str) -> str:
    """Return an option of Blender."""
    return f"--{name}"


def simulation_settings(
    recipe: Recipe, instants: Sequence[Instant], work: Path
) -> dict[str, Any]:
    """Return the settings for `blender_simulate.py`.

    Args:
        recipe: Recipe of the set.
        instants: Frames whose extent is required.
        work: Folder of the cache, the scene and the extents.
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
    """Return the settings for `blender_render_views.py`.

    Args:
        recipe: Recipe of the set.
        instants: Instants of the frames.
        hot: Heat of each frame.
        sides: Side of each frame [Blender's metre].
        direction: Directions of the views of the set.
        folders: Folders of the views to render, by their number.
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
