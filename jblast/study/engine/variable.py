"""One column of a study's store, and what it means."""

from typing import Literal, NamedTuple

import numpy as np

Role = Literal["input", "axis", "outcome", "weight"]
Kind = Literal["number", "yes_no"]

NO_ANSWER = -1
"""Of a yes-or-no: the sample failed. A number that failed is NaN."""


class Variable(NamedTuple):
    """A column of a study.

    Attributes:
        name: As it is asked for.
        role: What it is to the study: drawn by a prior, set by an axis, an answer.
        units: Of its values; "1" of none.
        long_name: In words.
        kind: A number, or yes (1) and no (0).
        sensors: Names of the sensors it has a value for; () for one a sample.
        names: What its whole numbers stand for, of an axis over words.
    """

    name: str
    role: Role
    units: str
    long_name: str
    kind: Kind = "number"
    sensors: tuple[str, ...] = ()
    names: tuple[str, ...] = ()

    @property
    def dtype(self) -> np.dtype:
        """Of the stored values."""
        if self.kind == "yes_no":
            return np.dtype("<i1")
        return np.dtype("<i2" if self.names else "<f8")

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return ("sample", "sensor") if self.sensors else ("sample",)

    def shape(self, samples: int) -> tuple[int, ...]:
        """Return the shape of so many samples."""
        return (samples, len(self.sensors)) if self.sensors else (samples,)

    @property
    def missing(self) -> float | int:
        """What stands where there is no answer."""
        return NO_ANSWER if self.dtype.kind == "i" else float("nan")

    def attributes(self) -> dict[str, object]:
        """Return what the store says of it."""
        said: dict[str, object] = {
            "role": self.role,
            "units": self.units,
            "long_name": self.long_name,
        }
        if self.role == "outcome":
            said["kind"] = self.kind
        if self.names:
            said["names"] = list(self.names)
        return said
