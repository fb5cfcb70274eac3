"""Kinds of recordings, and the arguments of `detect` that apply to each.

Nothing here needs JAX, so that a command refuses its arguments before JAX starts.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from jblast.errors import InputError, argument
from jblast.observations.records.clips import VIDEOS

Kind = Literal["sound", "frames", "video", "events"]
SOUNDS = (".wav", ".flac")
"""Suffixes that are recognised without the imports of cameras."""
OF_SOUND = ("template", "mass_kg", "range_m", "all_sounds", "positions")
ARGUMENTS: dict[Kind, tuple[str, ...]] = {
    "frames": ("fps", "scene"),
    "video": ("fps", "scene", *OF_SOUND),
    "events": ("scene", "size"),
    "sound": OF_SOUND,
}
"""Arguments that apply to recordings of each kind."""
EXCLUSIVE = (
    *(("template", "mass_kg"), ("template", "range_m"), ("scene", "positions")),
    *(("all_sounds", "template"), ("all_sounds", "mass_kg")),
)
"""Arguments that exclude each other."""


def kind_of(path: Path) -> Kind | None:
    """Return the kind of a recording; None if it depends on the formats of events."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return "frames"
    if suffix in VIDEOS:
        return "video"
    return "sound" if suffix in SOUNDS else None


def check_arguments(
    recordings: Sequence[str],
    arguments: Mapping[str, Any],
    kind_of: Callable[[Path], Kind | None] = kind_of,
) -> Kind | None:
    """Check the arguments of `detect`, and return the kind of its recordings.

    Args:
        recordings: The recordings.
        arguments: Arguments by name; None and False are not given.
        kind_of: Function that returns the kind of a recording; None is not checked.

    Raises:
        InputError: There is no recording, sound and pictures are combined, there are
            several films, an argument does not apply to the kind, or arguments exclude
            each other.
    """
    if not recordings:
        raise InputError(f"{argument('recordings')}: expected a file, got none")
    given = [k for k, v in arguments.items() if v is not None and v is not False]
    kinds: list[Kind | None] = [kind_of(Path(file)) for file in recordings]
    first, kind = recordings[0], kinds[0]
    if None in kinds:
        kind = None
    elif len(kinds) > 1 and {*kinds} not in ({"sound"}, {"video"}):
        seen = next(f for f, k in zip(recordings, kinds, strict=True) if k != "sound")
        raise InputError(
            f"{seen}: expected one folder of frames, file of events, or videos, "
            f"without sound; got {len(kinds)} recordings"
        )
    for name in given if kind else ():
        fitting: list[str] = [k for k, names in ARGUMENTS.items() if name in names]
        if name == "scene" and len(kinds) > 1:
            fitting = ["one video"]
        if kind not in fitting:
            if not Path(first).exists():
                raise InputError(f"{first}: no such file or directory")
            raise InputError(
                f"{argument(name)}: expected it with {' or '.join(fitting)} only, "
                f"got {first}"
            )
    for one, other in EXCLUSIVE:
        if one in given and other in given:
            raise InputError(
                f"{argument(one)}: expected it or {argument(other)}, got both"
            )
    for one, other in (("mass_kg", "range_m"), ("range_m", "mass_kg")):
        if one in given and other not in given:
            raise InputError(
                f"{argument(one)}: expected {argument(other)} with it, got none"
            )
    return kind
