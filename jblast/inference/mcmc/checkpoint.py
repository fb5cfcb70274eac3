"""What a sampler keeps on disk, so that one killed goes on where it was.

A folder of numbered `.npz` files, one for each stretch of the walk: arrays only, each
written whole or not at all.
"""

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jblast.errors import InputError
from jblast.files import replacing
from jblast.inference.mcmc.state import Segment

RANDOM = "random_"


@dataclass(frozen=True)
class Store:
    """A folder that holds a walk.

    Attributes:
        folder: Made when something is kept.
    """

    folder: Path

    def begin(self, about: Mapping[str, np.ndarray]) -> None:
        """Keep what the walk is of.

        Raises:
            InputError: The folder cannot be written.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._write("about.npz", about)
        except OSError as error:
            raise InputError(
                f"{self.folder}: cannot be written ({error.strerror}); expected a "
                "folder for the chain"
            ) from None

    def about(self) -> dict[str, np.ndarray] | None:
        """Return what the walk kept here is of; None if there is none."""
        path = self.folder / "about.npz"
        return _read(path) if path.exists() else None

    def keep(self, first: int, stretch: Segment) -> None:
        """Keep a stretch that begins after so many steps."""
        if len(stretch.chain):
            random = {RANDOM + name: array for name, array in stretch.random.items()}
            self._write(
                f"steps-{first:08d}.npz",
                {
                    "chain": stretch.chain,
                    "log_density": stretch.log_density,
                    **random,
                },
            )

    def stretches(self) -> list[Segment]:
        """Return all that was kept, in order.

        Raises:
            InputError: A file is damaged, or one is missing between others.
        """
        found, steps = [], 0
        for path in sorted(self.folder.glob("steps-*.npz")):
            arrays = _read(path)
            if path.name != f"steps-{steps:08d}.npz" or not {
                "chain",
                "log_density",
            } <= set(arrays):
                raise InputError(
                    f"{path}: expected a stretch that begins after step {steps}, got "
                    "another; a file of the chain is missing or foreign: remove the "
                    "folder to start anew"
                )
            random = {
                name.removeprefix(RANDOM): array
                for name, array in arrays.items()
                if name.startswith(RANDOM)
            }
            found.append(Segment(arrays["chain"], arrays["log_density"], random))
            steps += len(arrays["chain"])
        return found

    def _write(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        with replacing(self.folder / name) as part, part.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        raise InputError(
            f"{path}: expected a stretch of a chain, got a file that is damaged or "
            "something else; remove the folder to start anew"
        ) from None
