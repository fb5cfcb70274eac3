"""Rows that are records of samples: a file, and no value."""

import numpy as np
from jaxtyping import Bool

from jblast.observations.rows.fields import Fields
from jblast.observations.table import SAMPLES


def take_samples(rows: Fields, kind: np.ndarray) -> Bool[np.ndarray, " row"]:
    """Return which rows are records of samples, and give them a value, passed over.

    Args:
        rows: The log.
        kind: Quantity of each row.
    """
    sampled = kind == SAMPLES
    texts, files = rows.texts["value"], rows.text("record")
    rows.refuse(
        sampled & np.array([bool(text) for text in texts], bool),
        "value",
        lambda row: f"nothing, as {SAMPLES} is a file of samples, got {texts[row]}",
    )
    rows.refuse(
        sampled & np.array([not file for file in files], bool),
        "record",
        lambda _: "a file of samples, got nothing",
    )
    pairs = zip(sampled, texts, strict=True)
    rows.texts["value"] = ["1" if own else text for own, text in pairs]
    return sampled
