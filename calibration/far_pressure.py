r"""Which law does the peak follow past the tables? Shots of Ford et al. against two.

    python -m calibration.far_pressure

Past Z = 40 `swisdak` goes on as $Z^{-1.41}$, the fit that DDESB's tables print, and
`shock_kinematics` as a weak shock, $Z^{-1.1}$: 452 and 668 Pa at Z = 130. Recorded are
impulse $i$ and duration $t_d$ (`data/acoustic_ford2021.csv`); a far wave is a triangle
to begin with, so its peak is $2 i/t_d$, and where the wave is bent (at Z = 20 still by
14 %, by Kingery's and Bulmash's shape) more. Taken are chemical shots at most 0.1
m/kg^(1/3) above or below the ground and records from Z = 20 to 300: farther, weather
decides. Each shot has a level of its own, which burial and ground set; what is asked is
the slope of ln(recorded/law) against ln Z, and the scatter that is left.
"""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from scipy.stats import t as student

from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_PRESSURE
from jblast.waves import (
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    shock_kinematics_pressure,
    swisdak_pressure,
)

FILE = Path(__file__).parent / "data" / "acoustic_ford2021.csv"
SPAN = (20.0, 300.0)
SHALLOW = 0.1
"""Scaled height or depth up to which a charge counts as on the ground [m/kg^(1/3)]."""


def records() -> dict[str, np.ndarray]:
    """Return shot, Z, and the peak of a triangle over the ambient pressure [1 atm]."""
    lines = [line for line in FILE.read_text().splitlines() if line[:1] != "#"]
    rows = [row for row in csv.DictReader(lines) if row["kind"] == "chemical"]
    number = {
        name: np.array([float(row[name]) for row in rows])
        for name in ("yield_kg", "hob_m", "range_m", "P_ambient_kPa")
    }
    impulse = np.array([float(row["impulse_Pa_s"] or "nan") for row in rows])
    duration = np.array([float(row["duration_s"] or "nan") for row in rows])
    relative = 1e3 * number["P_ambient_kPa"] / STANDARD_PRESSURE
    size = np.cbrt(number["yield_kg"] / relative)
    z = number["range_m"] / size
    good = (np.abs(number["hob_m"]) <= SHALLOW * size) & np.isfinite(impulse * duration)
    good &= (z >= SPAN[0]) & (z <= SPAN[1])
    shot = np.array([row["source"] for row in rows])
    peak = 2.0 * impulse / duration / relative
    return {"shot": shot[good], "z": z[good], "peak": peak[good]}


def slope_of(
    shot: np.ndarray, z: np.ndarray, log_ratio: np.ndarray
) -> tuple[float, float, float]:
    """Return the slope against ln Z with a level for each shot, its sd, the scatter."""
    names = np.unique(shot)
    design = np.column_stack([np.log(z), *(shot == name for name in names)])
    found, *_ = np.linalg.lstsq(design, log_ratio, rcond=None)
    left = log_ratio - design @ found
    freedom = len(z) - design.shape[1]
    scatter = np.sqrt(left @ left / freedom)
    sd = scatter * np.sqrt(np.linalg.inv(design.T @ design)[0, 0])
    return float(found[0]), float(sd), float(scatter)


def bend(z: np.ndarray) -> np.ndarray:
    """Return the peak over that of a triangle, by Kingery and Bulmash, 1 past 40."""
    at = jnp.asarray(np.minimum(z, 40.0))
    peak, impulse, duration = (
        law(at, 1.0)
        for law in (
            kingery_bulmash_pressure,
            kingery_bulmash_impulse,
            kingery_bulmash_duration,
        )
    )
    there = np.asarray(peak * duration / (2.0 * impulse))
    return np.where(z < 40.0, there, there[np.argmin(np.abs(z - 40.0))])


def text() -> str:
    """Return the tables."""
    found = records()
    shot, z, peak = found["shot"], found["z"], found["peak"]
    laws = {"swisdak": swisdak_pressure, "shock_kinematics": shock_kinematics_pressure}
    lines = [
        f"{len(z)} records of {len(np.unique(shot))} shots, Z = {z.min():.0f} to "
        f"{z.max():.0f}; peak = 2 impulse/duration",
        "",
        "slope of ln(recorded/law) in ln Z, a level a shot; 90 % interval; scatter",
    ]
    for words, factor in (("triangle", 1.0), ("bent as Kingery-Bulmash", bend(z))):
        for name, law in laws.items():
            ratio = np.log(factor * peak / np.asarray(law(z, 1.0)))
            slope, sd, scatter = slope_of(shot, z, ratio)
            wide = sd * student.ppf(0.95, len(z) - 1 - len(np.unique(shot)))
            lines.append(
                f"  {words:24s} {name:18s}{slope:+6.2f} ({slope - wide:+.2f} to "
                f"{slope + wide:+.2f})   {scatter:.2f}"
            )
    lines += [
        "",
        "recorded/law, the median by Z (a level a shot taken out at 20 to 40)",
    ]
    lines.append("  Z            records   " + "".join(f"{n:>18s}" for n in laws))
    near = z < 40.0
    levels = {
        name: {
            s: np.median(np.log(peak / np.asarray(law(z, 1.0)))[near & (shot == s)])
            for s in np.unique(shot[near])
        }
        for name, law in laws.items()
    }
    for low, high in ((20, 40), (40, 70), (70, 100), (100, 160), (160, 300)):
        some = (z >= low) & (z < high) & np.isin(shot, list(levels["swisdak"]))
        cells = ""
        for name, law in laws.items():
            ratio = np.log(peak / np.asarray(law(z, 1.0)))
            ratio = ratio - np.array([levels[name].get(s, np.nan) for s in shot])
            cells += f"{np.exp(np.median(ratio[some])):18.2f}"
        lines.append(f"  {low:3d} to {high:3d}   {some.sum():6d}    {cells}")
    lines += [
        "",
        "at Z = 130 [Pa]: "
        + ", ".join(
            f"{name} {float(law(130.0, 1.0)):.0f}" for name, law in laws.items()
        ),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    start_jax()
    print(text())
