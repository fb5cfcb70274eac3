"""An answer that rests on recordings outside the range of their laws is doubtful."""

import csv
from pathlib import Path

import numpy as np
import pytest

import jblast
from jblast.inference import fit
from jblast.report import summary
from jblast.scene import Air, Charge, Scene, UncertainScene, freed
from jblast.waves import ford_2021_impulse, ground_motion_displacement
from tests.inference.logs import log

DATA = Path(jblast.__path__[0]).parent / "calibration" / "data"
COLUMNS = {
    "acoustic_ford2021.csv": {
        "positive_impulse_pa_s": "impulse_Pa_s",
        "positive_duration_s": "duration_s",
    },
    "seismic_ford2021.csv": {
        "ground_displacement_m": "p_wave_displacement",
        "ground_peak_velocity_m_s": "p_wave_max_velocity",
    },
}


def read_shot(shot):
    """Return rows of a recorded shot for `log`, and its first acoustic row.

    Three stations of each kind are enough, and quicker.
    """
    rows, first = [], {}
    for name, columns in COLUMNS.items():
        text = (DATA / name).read_text(encoding="utf-8").splitlines()
        table = csv.DictReader(line for line in text if line[0] != "#")
        for row in [row for row in table if row["source"] == shot][:3]:
            first = first or row
            for quantity, column in columns.items():
                far = (float(row["range_m"]), 0.0, float(row["hob_m"]))
                station = f"{name[0]}{row['station']}"
                rows.append((station, quantity, float(row[column]), None, far))
    return rows, first


@pytest.mark.slow
def test_ground_motion_does_not_make_the_answer_of_a_deep_shot_valid():
    # HTP-7: 175 kg, 2.1 m deep, h/W^(1/3) = -0.38; ford_2021 ends at -0.2
    rows, first = read_shot("HTP-7")
    assert len(rows) == 12
    scene = Scene(
        Charge(mass_kg=100.0, position_m=(0.0, 0.0, float(first["hob_m"]))),
        air=Air(
            temperature=float(first["T_ambient_K"]),
            pressure=1e3 * float(first["P_ambient_kPa"]),
            relative_humidity=0.0,
        ),
    )
    uncertain = freed(UncertainScene(scene), ["charge_mass_kg"])
    found = fit(log(*rows), uncertain)
    assert 0 < found.summary.law_valid_rows < len(rows)
    assert not found.summary.law_valid
    assert found.summary.extrapolated == ("charge_mass_kg",)
    assert found.exit_code == 4
    assert "OUTSIDE THE LAWS: most of the information" in summary(found)


@pytest.mark.slow
def test_few_rows_outside_their_law_do_not_spoil_an_answer():
    # Impulses inside their law have 5 %; the displacement, beyond Z = 1000, 1.9 in ln
    height, mass = -0.5, 300.0
    far = 10_000.0
    rows = [
        (name, "positive_impulse_pa_s", value, 0.05 * value, (r, 0.0, 0.0))
        for name, r in (("a", 300.0), ("b", 500.0), ("c", 700.0))
        for value in [
            float(
                ford_2021_impulse(np.hypot(r, height), mass, height, 101325.0, 340.29)
            )
        ]
    ]
    value = float(ground_motion_displacement(far, mass, height))
    rows.append(("d", "ground_displacement_m", value, 0.05 * value, (far, 0.0, 0.0)))
    scene = Scene(Charge(mass_kg=mass, position_m=(0.0, 0.0, height)))
    uncertain = freed(UncertainScene(scene), ["charge_mass_kg"])
    found = fit(log(*rows), uncertain)
    assert found.summary.law_valid_rows == 3
    assert found.summary.extrapolated == ()
    assert found.exit_code == 0
