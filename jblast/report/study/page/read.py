"""The reader of a study's store: its samples, or their statistics."""

import warnings

from jblast.errors import InputError
from jblast.report.study.page.columns import INCOMPLETE, StudyColumns, columns_of
from jblast.report.study.page.summary_columns import summary_columns
from jblast.study.engine.store import open_store


def read_columns(path: str) -> StudyColumns:
    """Read a store.

    Raises:
        InputError: There is none, or it is of another kind or of a newer schema.
    """
    import xarray

    try:
        with warnings.catch_warnings():
            # a store has a lock, and statistics, beside its columns
            warnings.filterwarnings("ignore", message=".*not recognized as a component")
            dataset = xarray.open_zarr(path, consolidated=False)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: expected the store of a study, as `jblast study` writes it: "
            f"{error}"
        ) from None
    found = columns_of(dataset, path)
    if dataset.attrs.get("keep", "all") == "all":
        return found
    store = open_store(path)
    assert store is not None, "it was read"
    return summary_columns(store, found if found.samples else None, INCOMPLETE)
