"""Who may import whom, read from the source: inside functions too."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from calibration.rooms import (
    PACKAGE,
    ROOMS,
    imported,
    module_of,
    package_of,
)

SOURCES = sorted(PACKAGE.rglob("*.py"))

# Each may import what stands above it, and its own.
ORDER = [
    ("types", "constants", "lazy", "errors", "progress"),
    ("progress_line",),
    ("registry",),
    ("addresses", "files", "results"),
    ("parameters", "quantities"),
    ("units",),
    ("kept_programs",),
    *((room,) for room in ROOMS),
]
LEVEL = {name: level for level, names in enumerate(ORDER) for name in names}

# Folders and modules within a room, in their order; what is not named goes where it
# must.
WITHIN = {
    "waves": ("curves", "propagation", "shock", "laws", "waveform", "pulse"),
    "vehicle": (
        *("quadrotor", "state", "dynamics", "control", "loads", "rollout"),
        "warp",
    ),
    "sensors.camera": (
        *("image", "geometry", "fireball", "billboards", "baked_explosion"),
        *("surroundings", "rendering", "events", "files", "film", "bake"),
    ),
    "signals": ("flash", "picks"),
    "inference": (
        *("consensus", "sanity", "posterior", "mode", "identifiability"),
        *("whitening", "importance", "mcmc", "fitting", "design", "tuning"),
    ),
    "world": ("server", "remote"),
    "inference.many": (
        *("fold", "solver", "residuals", "lanes", "starts", "engine", "fit_many"),
    ),
    "cli": ("arguments", "verbs"),
}
BESIDE = {
    "inference": {"many": ("mcmc", "fitting", "design")},
}
"""Folders that stand beside others: none of the two imports the other."""

# What a bare GPU machine runs.
BARE = {"jax", "equinox", "jaxtyping", "numpy", "jblast"}


def imports_of(source: str, package: str) -> set[str]:
    """Every module a source imports, by its full name; `package` resolves dots."""
    found = set()
    for base, names in imported(source, package):
        # `from jblast import scene` imports jblast.scene
        whole = {f"{base}.{name}" for name in names} if base == "jblast" else set()
        found |= whole or {base}
    return found


def level_of(module: str) -> int | None:
    """Place in the order of a module of ours; None for jblast itself and others."""
    parts = module.split(".")
    if parts[0] != "jblast" or len(parts) == 1:
        return None
    return LEVEL.get(parts[1])


def wrong_way(source: str, module: str, package: str) -> list[str]:
    """Imports of ours that stand below the importer."""
    # the front door names what it offers for type checkers, and imports it when asked
    if module == "jblast.__main__":  # is the command
        return []
    own = LEVEL["study"] if module == "jblast" else level_of(module)
    return sorted(
        name
        for name in imports_of(source, package)
        if (level := level_of(name)) is not None and (own is None or level > own)
    )


def test_imports_point_up_the_list_only():
    wrong = {
        module_of(path): found
        for path in SOURCES
        if (found := wrong_way(path.read_text(), module_of(path), package_of(path)))
    }
    assert wrong == {}


def rooms_between(room: str) -> set[tuple[str, str]]:
    """Which folder of a room imports from which other one."""
    prefix = f"jblast.{room}."
    found = set()
    for path in SOURCES:
        module = module_of(path)
        if not module.startswith(prefix):
            continue
        own = module.removeprefix(prefix).partition(".")[0]
        for name in imports_of(path.read_text(), package_of(path)):
            if name.startswith(prefix):
                found.add((own, name.removeprefix(prefix).partition(".")[0]))
    return {(own, other) for own, other in found if own != other}


@pytest.mark.parametrize("room", WITHIN)
def test_folders_of_a_room_import_those_before_them_only(room):
    place = {name: index for index, name in enumerate(WITHIN[room])}
    wrong = {
        (own, other)
        for own, other in rooms_between(room)
        if own in place and other in place and place[other] > place[own]
    }
    assert wrong == set()


@pytest.mark.parametrize("room", BESIDE)
def test_folders_that_stand_beside_each_other_do_not_meet(room):
    apart = {(a, b) for a, others in BESIDE[room].items() for b in others}
    met = rooms_between(room)
    assert met & (apart | {(b, a) for a, b in apart}) == set()


def test_every_folder_of_an_ordered_room_is_in_the_order():
    for room, ordered in WITHIN.items():
        folder = PACKAGE.joinpath(*room.split("."))
        folders = {path.parent.name for path in folder.glob("*/__init__.py")}
        modules = {path.stem for path in folder.glob("*.py")}
        named = {*ordered, *BESIDE.get(room, ())}
        assert folders <= named <= folders | modules


def test_every_folder_and_module_has_its_place_in_the_list():
    tops = {module_of(path).split(".")[1] for path in SOURCES if path.parent != PACKAGE}
    tops |= {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert tops <= set(LEVEL)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("jblast.waves.laws.wu_hao", "from jblast.inference import fit"),
        ("jblast.waves.laws.wu_hao", "def late():\n    import jblast.sensors.record"),
        ("jblast.scene.scene", "from jblast import waves"),
        ("jblast.scene.scene", "from ..waves import wu_hao"),
        ("jblast.registry", "from jblast.scene.scene import Air"),
        ("jblast", "from jblast.cli import main"),
    ],
)
def test_an_import_down_the_list_is_found(module, source):
    assert wrong_way(source, module, module.rpartition(".")[0] or module)


def test_scene_and_waves_need_jax_equinox_and_jaxtyping_alone():
    needed = {
        (module_of(path), name.partition(".")[0])
        for path in SOURCES
        if path.relative_to(PACKAGE).parts[0] in ("scene", "waves")
        for name in imports_of(path.read_text(), package_of(path))
    }
    allowed = BARE | set(sys.stdlib_module_names)
    assert {(module, top) for module, top in needed if top not in allowed} == set()


def modules_after(statement: str, home: Path) -> set[str]:
    """What is loaded after a statement, run by a fresh Python from an empty home."""
    run = subprocess.run(
        [sys.executable, "-B", "-c", f"{statement}; import sys; print(*sys.modules)"],
        check=True,
        capture_output=True,
        text=True,
        cwd=home,
        env={**os.environ, "HOME": str(home), "PYTHONPATH": str(PACKAGE.parent)},
    )
    return set(run.stdout.split())


def test_import_jblast_pulls_in_nothing_heavy_and_writes_nothing(tmp_path):
    loaded = modules_after("import jblast", tmp_path)
    assert "jblast" in loaded
    assert loaded.isdisjoint(
        {"jax", "numpy", "equinox", "optimistix", "emcee"}
        | {"warp", "pysindy", "matplotlib"}
    )
    assert list(tmp_path.iterdir()) == []


def test_laws_pull_in_neither_warp_nor_pysindy_nor_matplotlib(tmp_path):
    loaded = modules_after("import jblast.waves", tmp_path)
    assert "jax" in loaded
    assert loaded.isdisjoint({"warp", "pysindy", "matplotlib", "optimistix"})
    assert list(tmp_path.iterdir()) == []


def test_the_calculator_pulls_in_neither_inference_nor_slow_parts_of_scipy(tmp_path):
    calculation = (
        "import jblast.report.calculator.terminal; from jblast.cli.parsers import "
        "parsed; from jblast.cli.verbs.calc import question_of, selection; "
        "options = parsed(['calc', '--mass', '1', '--range', '9']); "
        "question_of(options); selection(options)"
    )
    loaded = modules_after(calculation, tmp_path)
    assert "jblast.waves" in loaded
    assert loaded.isdisjoint(
        {"jblast.inference", "optimistix", "scipy.interpolate", "scipy.special"}
        # sensors that it does not simulate, logs that it does not read
        | {f"jblast.sensors.{one}" for one in ("anemometer", "geophone", "arrivals")}
        | {"jblast.sensors.camera", "jblast.observations.log_io"}
    )
