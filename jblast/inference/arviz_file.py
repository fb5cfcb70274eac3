"""Draws of walkers in the schema of ArviZ, as one tree and one NetCDF file.

Up to ArviZ 0.23 (Python 3.11) `from_dict` takes a keyword for each group and returns
its own InferenceData; from 1.0 (Python 3.12) it takes one mapping and returns xarray's
DataTree. Both give a DataTree here.
"""

import os
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jblast.errors import InputError
from jblast.files import replacing
from jblast.inference.mcmc import Ensemble
from jblast.observations import Observations

if TYPE_CHECKING:
    import xarray

# a user without ArviZ reads this: the packages are optional
NEEDED = "expected ArviZ and a writer: pip install arviz h5netcdf h5py"
MAX_EXPORTED_DRAWS = 200_000
"""Largest number of exported draws: steps are thinned. 12 numbers each take 20 MB."""


def inference_data(
    ensemble: Ensemble,
    observations: Observations,
    notes: Sequence[str] = (),
) -> "xarray.DataTree":
    """Return an ensemble in the schema of ArviZ, each walker a chain.

    Groups: `posterior` (every number, in the units of its name), `sample_stats` (`lp`,
    ln of the density per unit of the sampled coordinates), `observed_data`.

    Args:
        ensemble: The draws.
        observations: The log.
        notes: Sentences to store with the draws.

    Raises:
        InputError: ArviZ is not installed.
    """
    # rounded up: the limit is never exceeded
    stride = max(-(-ensemble.log_density.size // MAX_EXPORTED_DRAWS), 1)
    values = ensemble.values[:, ::stride]
    rows = [
        f"{sensor} {quantity}"
        for sensor, quantity in zip(
            observations.sensor, observations.quantity, strict=True
        )
    ]
    groups: dict[str, dict[str, Any]] = {
        "posterior": {name: values[:, :, i] for i, name in enumerate(ensemble.names)},
        "sample_stats": {"lp": ensemble.log_density[:, ::stride]},
        "observed_data": {"reading": np.asarray(observations.value)},
    }
    tree = _tree(groups, {"row": rows}, {"reading": ["row"]})
    judged = ensemble.convergence
    tree["posterior"].attrs.update(
        inference_library="emcee",
        sampling_time=ensemble.seconds,
        tuning_steps=judged.warm_up,
        thinned_by=stride,
        converged=int(ensemble.converged),
        autocorrelation_time=judged.tau,
        effective_sample_size=judged.ess,
        r_hat=judged.r_hat,
        why="; ".join(notes),
    )
    return tree


def write_inference_data(tree: "xarray.DataTree", path: str | os.PathLike[str]) -> None:
    """Write a tree as a NetCDF file, completely or not at all.

    Raises:
        InputError: h5netcdf is not installed, or the file cannot be written.
    """
    try:
        with replacing(path) as temporary:
            tree.to_netcdf(temporary, engine="h5netcdf")
    except ImportError:
        raise InputError(f"{path}: {NEEDED}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def _tree(groups, coords, dims) -> "xarray.DataTree":
    try:
        # ArviZ 0.23 warns of the changes of 1.0 at import
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)
            import arviz
    except ImportError:
        raise InputError(f"the ArviZ schema: {NEEDED}") from None
    from_dict: Any = arviz.from_dict  # the signature depends on the version
    if int(arviz.__version__.split(".")[0]) < 1:
        return from_dict(**groups, coords=coords, dims=dims).to_datatree()
    return from_dict(groups, coords=coords, dims=dims)
