r"""How far are laws off far away? Recorded peaks, impulses and durations against them.

    python -m calibration.far_pressure > calibration/results/far_pressure.txt

Writes jblast/waves/data/far_scatter.json. No random numbers. Data: the 189 records of
18 chemical shots in `data/acoustic_ford2021.csv`, Z = 22 to 838 m/kg^(1/3).

The peak is not in the data. It is computed as $2 i/t_d$, of impulse and duration: exact
for a triangle, to which a weak shock tends. By Kingery's and Bulmash's own shape it is
13 % lower than their peak at Z = 40. A far pulse whose front is worn is no triangle: of
a half sine $2 i/t_d$ is 27 % above the peak, of a raised cosine it equals it. So the
definition is good to about 20 %, and where a peak is read half the law's it is no
artefact of it: worn fronts make recorded peaks lower still. Echoes and several paths
lengthen $t_d$ (HTA-1: 1.6 times the law's), which lowers $2 i/t_d$; the impulse, which
they do not lower, falls to 0.6 of the law as well.

Slope. Past Z = 40 `swisdak` continues as $Z^{-1.41}$, the fit that DDESB's tables
print, and `shock_kinematics` as a weak shock, $Z^{-1.1}$: 452 and 668 Pa at Z = 130.
Used are shots at most 0.1 m/kg^(1/3) above or below the ground and records from Z = 20
to 300. Each shot has a level of its own, which burial and ground set; estimated is the
slope of ln(recorded/law) against ln Z, and the remaining scatter.

Far scatter. All records of all shots, each shot with a free level $a_s$:

$$y = \ln(recorded/law) = a_s + (F u_s - B)\,g(Z) + \epsilon, \qquad
  g = 1/(1 + (Z_k/Z)^n)$$

$u_s$ is a unit normal shared by the far records of a shot, $\epsilon$ Student-t with 4
degrees of freedom and scale $\sqrt{r^2 + (R g)^2}$. Levels and $u_s$ are integrated out
(`likelihood.py`). The package has $B = 0$: then $F$ holds the median loss as well.
A loss by half in all weathers would be a claim on four campaigns at three sites, and
downwind peaks are known to rise.

Masses of held-out shots from their peaks past Z = 300 alone are in
`results/far_pressure_masses.txt`: no model makes these intervals honest, since the loss
differs from campaign to campaign, and a heavier charge would place the same rows where
the laws hold. Therefore the laws end at `FAR_END`, and such an answer is outside them.
"""

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize
from scipy.stats import t as student

import jblast.waves
from calibration.likelihood import Records, marginal, read_records
from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_PRESSURE
from jblast.files import write_text
from jblast.waves import (
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    shock_kinematics_duration,
    shock_kinematics_impulse,
    shock_kinematics_pressure,
    swisdak_pressure,
    weak_shock_iso_pressure,
)
from jblast.waves.shock import FAR_SCATTER_EXPONENT, FarScatter

TABLE = Path(__file__).parent / "data" / "acoustic_ford2021.csv"
OUTPUT = Path(jblast.waves.__path__[0]) / "data" / "far_scatter.json"
SPAN = (20.0, 300.0)
SHALLOW = 0.1
"""Scaled height or depth up to which a charge counts as on the ground [m/kg^(1/3)]."""
DEEP = -0.2
"""Scaled height below which a shot is left out of a table, as for `ford_2021`."""
FAR = 300.0
"""Scaled distance past which peaks are far [m/kg^(1/3)]."""
EXPONENTS = (2.0, FAR_SCATTER_EXPONENT, 8.0)
QUANTITIES = ("peak_overpressure_pa", "positive_impulse_pa_s", "positive_duration_s")
BINS = ((20, 40), (40, 100), (100, 200), (200, 300), (300, 450), (450, 1000))
LAWS = {"swisdak": swisdak_pressure, "shock_kinematics": shock_kinematics_pressure}


class Far(NamedTuple):
    """All records, their scaled distances and heights, and what they measured.

    Attributes:
        records: The records.
        z: Scaled distance [m/kg^(1/3)].
        height: Scaled height of burst [m/kg^(1/3)].
        value: By quantity, in its unit.
    """

    records: Records
    z: np.ndarray
    height: np.ndarray
    value: dict[str, np.ndarray]

    def log_ratio(self, quantity: str) -> np.ndarray:
        """Return ln of recorded over `shock_kinematics` on the surface."""
        found, ambient = self.records, self.records.ambient_pressure()
        place = found.slant_range, found.charge_mass, ambient
        if quantity == "peak_overpressure_pa":
            law = shock_kinematics_pressure(*place)
        elif quantity == "positive_impulse_pa_s":
            law = shock_kinematics_impulse(*place, found.sound_speed())
        else:
            law = shock_kinematics_duration(*place, found.sound_speed())
        return np.log(self.value[quantity] / np.asarray(law))


@cache
def every_record() -> Far:
    """Return all records; the peak is that of a triangle."""
    found = read_records(TABLE)
    log_range, height = map(np.asarray, found.place(found.ambient_pressure()))
    impulse, duration = found.column("impulse_Pa_s"), found.column("duration_s")
    values = 2.0 * impulse / duration, impulse, duration
    named: dict[str, np.ndarray] = dict(zip(QUANTITIES, values, strict=True))
    return Far(found, np.exp(log_range), height, named)


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


class FarFit(NamedTuple):
    """Far scatter at the maximum of the likelihood.

    Attributes:
        far: Scatter far away.
        loss: $B$ [ln]; zero unless it was fitted.
        record: $r$, scale of a record near the charge [ln].
        log_likelihood: There.
    """

    far: FarScatter
    loss: float
    record: float
    log_likelihood: float


@cache
def _objective():
    """Return minus the log-likelihood and its gradient, compiled once.

    It takes ln F, ln R, ln Z_k, B, n and ln r, then y.
    """
    found = every_record()
    names, of_shot = np.unique(found.records.shot, return_inverse=True)
    n_shots, z = len(names), jnp.asarray(found.z)
    # A level with sd 100 is free.
    precision = jnp.concatenate([jnp.full(n_shots, 1e-4), jnp.ones(n_shots)])

    def parts(p: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        shared, own, knee, loss, exponent, near = p
        share = 1.0 / (1.0 + (knee / z) ** exponent)
        wider = jnp.sqrt(1.0 + (own * share / near) ** 2)
        return shared * share, loss * share, wider

    def cost(theta: jax.Array, y: jax.Array) -> jax.Array:
        def scaled(p: jax.Array, x: jax.Array) -> jax.Array:
            # residual over the growth of its scale, so that one scale serves all
            shared, loss, wider = parts(p)
            far = shared * x[n_shots:][of_shot] - loss
            return (x[:n_shots][of_shot] + far - y) / wider

        p = jnp.concatenate([jnp.exp(theta[:3]), theta[3:5], jnp.exp(theta[5:])])
        start = jnp.zeros(2 * n_shots)
        nothing = jnp.zeros(len(found.z))
        found_at = marginal(scaled, p, precision, start, nothing, 1.0 + nothing, 4.0)
        return jnp.sum(jnp.log(parts(p)[2])) - found_at.log_likelihood

    return jax.jit(jax.value_and_grad(cost))


def fit(
    quantity: str,
    *,
    exponent: float = FAR_SCATTER_EXPONENT,
    loss: bool = False,
) -> FarFit:
    """Estimate the far scatter of a quantity.

    Args:
        quantity: One of `QUANTITIES`.
        exponent: $n$.
        loss: Whether $B$ is fitted, or zero.
    """
    y = jnp.asarray(every_record().log_ratio(quantity))
    bounds = [(-3.0, 1.5), (-4.0, 1.0), (4.0, 7.0), (-2.0, 3.0), (exponent,) * 2]
    bounds += [(-4.0, 0.0)]
    if not loss:
        bounds[3] = (0.0, 0.0)

    def value_and_slope(theta: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = _objective()(jnp.asarray(theta), y)
        return float(value), np.asarray(slope)

    ends = []
    for knee in (200.0, 400.0):
        start = np.array([*np.log([0.6, 0.4, knee]), 0.5 * loss, exponent, np.log(0.1)])
        ends.append(
            minimize(value_and_slope, start, jac=True, method="L-BFGS-B", bounds=bounds)
        )
    best = min(ends, key=lambda end: end.fun)
    shared, own, knee = np.exp(best.x[:3])
    return FarFit(
        FarScatter(float(shared), float(own), float(knee)),
        float(best.x[3]),
        float(np.exp(best.x[5])),
        -float(best.fun),
    )


def slopes() -> list[str]:
    """Return the slope of recorded over law, and its medians by Z, on the ground."""
    found = every_record()
    good = (np.abs(found.height) <= SHALLOW) & (found.z >= SPAN[0])
    good &= found.z <= SPAN[1]
    shot, z = found.records.shot[good], found.z[good]
    relative = found.records.ambient_pressure()[good] / STANDARD_PRESSURE
    peak = found.value["peak_overpressure_pa"][good] / relative
    names = np.unique(shot)
    off = {name: np.log(peak / np.asarray(law(z, 1.0))) for name, law in LAWS.items()}
    lines = [
        f"{len(z)} records of {len(names)} shots, Z = {z.min():.0f} to "
        f"{z.max():.0f}; peak = 2 impulse/duration",
        "",
        "slope of ln(recorded/law) in ln Z, a level a shot; 90 % interval; scatter",
    ]
    for words, factor in (("triangle", 1.0), ("bent as Kingery-Bulmash", bend(z))):
        for name, ratio in off.items():
            slope, sd, scatter = slope_of(shot, z, ratio + np.log(factor))
            wide = sd * student.ppf(0.95, len(z) - 1 - len(names))
            lines.append(
                f"  {words:24s} {name:18s}{slope:+6.2f} ({slope - wide:+.2f} to "
                f"{slope + wide:+.2f})   {scatter:.2f}"
            )
    lines += [
        "",
        "recorded/law, the median by Z (a level a shot taken out at 20 to 40)",
        "  Z            records   " + "".join(f"{name:>18s}" for name in LAWS),
    ]
    levels = {
        name: ratio - levels_of(shot, z < 40.0, ratio) for name, ratio in off.items()
    }
    for low, high in ((20, 40), (40, 70), (70, 100), (100, 160), (160, 300)):
        some = (z >= low) & (z < high) & np.isfinite(levels["swisdak"])
        cells = "".join(f"{np.exp(np.median(y[some])):18.2f}" for y in levels.values())
        lines.append(f"  {low:3d} to {high:3d}   {some.sum():6d}    {cells}")
    at = ", ".join(f"{name} {float(law(130.0, 1.0)):.0f}" for name, law in LAWS.items())
    return [*lines, "", f"at Z = 130 [Pa]: {at}"]


def levels_of(shot: np.ndarray, near: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the median of each record's shot near the charge; NaN if it has none."""
    level = np.full(len(y), np.nan)
    for name in np.unique(shot[near]):
        level[shot == name] = np.median(y[near & (shot == name)])
    return level


def bins() -> list[str]:
    """Return recorded over law by Z: all shots, and those that are not deep."""
    found = every_record()
    shot, shallow = found.records.shot, found.height > DEEP
    ratios = {quantity: found.log_ratio(quantity) for quantity in QUANTITIES}
    lines = [
        f"all {len(found.z)} records of {len(set(shot))} shots, Z = "
        f"{found.z.min():.0f} to {found.z.max():.0f}: recorded/shock_kinematics, the "
        "median and the 16 to 84 % range",
        f"  not deep: the {len(set(shot[shallow]))} shots above h/W^(1/3) = "
        f"{DEEP:g}; level out: each of all shots over its own median at Z < 200",
        "  Z              records shots  "
        + "".join(f"{q:>26s}" for q in ("peak", "impulse", "duration")),
    ]
    level = {q: y - levels_of(shot, found.z < 200.0, y) for q, y in ratios.items()}
    leveled = np.isfinite(level[QUANTITIES[0]])
    for words, use, of in (
        ("not deep", shallow, ratios),
        ("level out", leveled, level),
    ):
        lines.append(f"  {words}")
        for low, high in BINS:
            some = (found.z >= low) & (found.z < high) & use
            cells = ""
            for y in of.values():
                at = np.exp(np.quantile(y[some], (0.16, 0.5, 0.84)))
                cells += f"{at[1]:12.2f} ({at[0]:.2f} to {at[2]:.2f})"
            shots = len(set(shot[some]))
            lines.append(
                f"  {low:4d} to {high:4d}   {some.sum():6d} {shots:5d}  {cells}"
            )
    return lines


def fits() -> list[str]:
    """Return the far scatter of each quantity, by form."""
    lines = [
        "far scatter [ln]: F shared by the far records of a shot, R of a record, both "
        "half at Zk; r near; B median loss",
        "  quantity                  n    ln L      F      R     Zk      r      B",
    ]
    for quantity in QUANTITIES:
        for exponent in EXPONENTS:
            for loss in (False, True):
                one = fit(quantity, exponent=exponent, loss=loss)
                kept = exponent == FAR_SCATTER_EXPONENT and not loss
                lines.append(
                    f"  {quantity:24s}{exponent:3.0f} {one.log_likelihood:7.2f} "
                    f"{one.far.shared:6.3f} {one.far.record:6.3f} {one.far.knee:6.1f} "
                    f"{one.record:6.3f} {one.loss:6.2f}{'  packaged' if kept else ''}"
                )
    return lines


def absorbed() -> str:
    """Return what absorption takes from the peaks past `FAR`, by ISO 9613-1."""
    found = every_record()
    far = found.records.where(found.z > FAR)
    place = far.slant_range, far.charge_mass, far.ambient_pressure()
    plain = np.asarray(shock_kinematics_pressure(*place))
    sound = far.sound_speed()
    worst = max(
        np.max(
            1.0 - np.asarray(weak_shock_iso_pressure(*place, sound, 300.0, x)) / plain
        )
        for x in (0.1, 0.3, 0.5)
    )
    return (
        f"ISO 9613-1 takes at most {100 * worst:.1f} % of the peaks past Z = {FAR:g} "
        "(27 C, 10 to 50 % humidity)"
    )


def as_json() -> str:
    """Return the packaged numbers, three significant digits."""
    found = every_record()
    numbers = {
        quantity: {
            name: float(f"{x:.3g}") for name, x in fit(quantity).far._asdict().items()
        }
        for quantity in QUANTITIES
    }
    content = {
        "source": "LLNL recordings of S.R. Ford et al. 2021, from "
        "lanl/MultiPEM_Toolbox (BSD-3-Clause); calibration/data/acoustic_ford2021.csv",
        "script": "calibration/far_pressure.py",
        "n_records": len(found.z),
        "scaled_range": [float(f"{f(found.z):.4g}") for f in (np.min, np.max)],
        "quantities": numbers,
    }
    return json.dumps(content, indent=1) + "\n"


if __name__ == "__main__":
    start_jax()
    print(*slopes(), "", *bins(), "", *fits(), "", absorbed(), sep="\n")
    write_text(OUTPUT, as_json())
