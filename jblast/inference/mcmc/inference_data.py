"""Draws in the schema of ArviZ, for whatever reads that: one tree, one NetCDF file.

ArviZ's two lines differ: up to 0.23 (Python 3.11) `from_dict` takes a keyword for each
group and returns its own InferenceData; from 1.0 (Python 3.12) it takes one mapping and
returns xarray's DataTree. Here both give a DataTree.
"""

import os
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.files import replacing
from jblast.inference.mcmc.ensemble import Ensemble
from jblast.inference.posterior.posterior import Posterior
from jblast.observations import Observations

if TYPE_CHECKING:
    import xarray

NEEDED = "expected ArviZ and a writer: pip install arviz h5netcdf h5py"
MOST_DRAWS = 200_000
"""Steps are thinned so that no more draws than this are kept."""


def inference_data(
    ensemble: Ensemble,
    posterior: Posterior,
    observations: Observations,
    notes: Sequence[str] = (),
) -> "xarray.DataTree":
    """Return an ensemble as ArviZ knows it, each walker a chain.

    Groups: `posterior` (every number, in the units of its name), `sample_stats` (`lp`,
    ln of the density per unit of the fitted coordinates), `observed_data`.

    Args:
        ensemble: The walk.
        posterior: What was walked.
        observations: The log.
        notes: What to say beside the draws.

    Raises:
        InputError: ArviZ is not installed.
    """
    stride = max(-(-ensemble.log_density.size // MOST_DRAWS), 1)
    z = ensemble.z[:, ::stride]
    values = posterior.parameters.values_of_each(
        jnp.asarray(z.reshape(-1, z.shape[-1]))
    )
    rows = [
        f"{sensor} {quantity}"
        for sensor, quantity in zip(
            observations.sensor, observations.quantity, strict=True
        )
    ]
    groups: dict[str, dict[str, Any]] = {
        "posterior": {
            name: np.asarray(values[name]).reshape(z.shape[:2])
            for name in ensemble.names
        },
        "sample_stats": {"lp": ensemble.log_density[:, ::stride]},
        "observed_data": {"reading": np.asarray(observations.value)},
    }
    tree = _tree(groups, {"row": rows}, {"reading": ["row"]})
    tree["posterior"].attrs.update(_about(ensemble, stride, notes))
    return tree


def write_inference_data(tree: "xarray.DataTree", path: str | os.PathLike[str]) -> None:
    """Write a tree as a NetCDF file, whole or not at all.

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
        with warnings.catch_warnings():  # 0.23 announces 1.0 when it is imported
            warnings.simplefilter("ignore", FutureWarning)
            import arviz
    except ImportError:
        raise InputError(f"the ArviZ schema: {NEEDED}") from None
    from_dict: Any = arviz.from_dict  # its arguments are those of one of two lines
    if int(arviz.__version__.split(".")[0]) < 1:
        return from_dict(**groups, coords=coords, dims=dims).to_datatree()
    return from_dict(groups, coords=coords, dims=dims)


def _about(ensemble: Ensemble, stride: int, notes: Sequence[str]) -> dict[str, Any]:
    """What NetCDF keeps beside the draws: numbers and text only."""
    judged = ensemble.convergence
    return {
        "inference_library": "emcee" if ensemble.sampler == "emcee" else "jblast",
        "sampling_time": ensemble.seconds,
        "tuning_steps": judged.warm_up,
        "thinned_by": stride,
        "converged": int(ensemble.converged),
        "autocorrelation_time": judged.tau,
        "effective_sample_size": judged.ess,
        "r_hat": judged.r_hat,
        "why": "; ".join(notes),
    }
