"""The recordings of Ford et al. (2021), as the calibration sees them."""

import csv
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.constants import (
    STANDARD_SOUND_SPEED,
    STANDARD_TEMPERATURE,
)

DATA = Path(__file__).parent / "data" / "acoustic_ford2021.csv"

QUANTITIES = ("positive_impulse_pa_s", "positive_duration_s")
CAMPAIGNS = ("HRI", "HRII", "HTA", "HTP")


class Records(NamedTuple):
    """One row a record.

    A path is a pair of places, the same in every shot; the first part of its name is
    the site, so HRI and HRII are one site. A number stands for each name.
    """

    shot: np.ndarray
    campaign: np.ndarray
    site: np.ndarray
    path: np.ndarray
    charge_mass: np.ndarray
    height_of_burst: np.ndarray
    slant_range: np.ndarray
    ambient_pressure: np.ndarray
    sound_speed: np.ndarray
    value: dict[str, np.ndarray]

    def where(self, keep: np.ndarray) -> "Records":
        """Pick rows."""
        values = {quantity: value[keep] for quantity, value in self.value.items()}
        return Records(*(column[keep] for column in self[:-1]), value=values)

    def scaled_height(self) -> np.ndarray:
        """Return h/W^(1/3) [m/kg^(1/3)]."""
        return self.height_of_burst / self.charge_mass ** (1 / 3)

    def scaled_range(self) -> np.ndarray:
        """Return R/W^(1/3) [m/kg^(1/3)]."""
        return self.slant_range / self.charge_mass ** (1 / 3)


@cache
def read_records() -> Records:
    """Read all 189 records; sound speeds are those of dry air at the temperature."""
    with DATA.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))

    def column(name: str, convert: Callable[[str], object] = float) -> np.ndarray:
        return np.array([convert(row[name]) for row in rows])

    warmth = column("T_ambient_K") / STANDARD_TEMPERATURE
    return Records(
        shot=column("source", str),
        campaign=column("source", lambda name: name.split("-")[0]),
        site=column("path", lambda name: name.split("-")[0]),
        path=column("path", str),
        charge_mass=column("yield_kg"),
        height_of_burst=column("hob_m"),
        slant_range=column("range_m"),
        ambient_pressure=1e3 * column("P_ambient_kPa"),
        sound_speed=STANDARD_SOUND_SPEED * np.sqrt(warmth),
        value={
            "positive_impulse_pa_s": column("impulse_Pa_s"),
            "positive_duration_s": column("duration_s"),
        },
    )
