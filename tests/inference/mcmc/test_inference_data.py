import numpy as np
import pytest

from jblast.inference.mcmc.ensemble import (
    ensemble,
    inference_data,
    write_inference_data,
)
from jblast.report.fit.findings import all_words
from tests.catalogue import AROUND
from tests.inference.logs import log
from tests.inference.shots import five_solved


@pytest.fixture(scope="module")
def walked():
    posterior, normal, told, _ = five_solved()
    return posterior, ensemble(posterior, normal, told, most_steps=60, walkers=8)


def made():
    return log(
        *(
            (f"m{i}", quantity, 1.0 + i, 0.1, (*place, 1.5))
            for i, place in enumerate(AROUND)
            for quantity in ("air_arrival_s", "peak_overpressure_pa")
        )
    )


@pytest.mark.slow
def test_draws_come_back_from_the_file(walked, tmp_path):
    pytest.importorskip("arviz", exc_type=ImportError)
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5py")
    posterior, found = walked
    tree = inference_data(found, posterior, made(), all_words(found.findings))
    write_inference_data(tree, tmp_path / "posterior.nc")
    with xarray.open_datatree(tmp_path / "posterior.nc", engine="h5netcdf") as back:
        mass = back["posterior"]["charge_mass_kg"]
        assert mass.dims == ("chain", "draw")
        np.testing.assert_allclose(mass, np.exp(found.z[:, :, 0]), rtol=1e-12)
        np.testing.assert_array_equal(back["sample_stats"]["lp"], found.log_density)
        assert list(back["observed_data"]["row"].values[:2]) == [
            "m0 air_arrival_s",
            "m0 peak_overpressure_pa",
        ]
        about = back["posterior"].attrs
        assert about["inference_library"] == "emcee"
        assert about["converged"] == 0
        assert "autocorrelation times" in about["why"]
