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

Held-out shots. Mass of each shot from its peaks past Z = 300 alone, with a flat prior
in ln W, by quadrature: with the scatter near the charge (10 % a shot, 10 % a record),
with the far scatter estimated without the shot, with a fitted loss B as well, and with
both estimated without the campaign. Burial is no part of these laws, so deep shots
(h/W^(1/3) < -0.2) are marked. No model makes these intervals honest: the loss differs
from campaign to campaign, and a heavier charge would place the same rows where the laws
hold. Therefore the laws end at `FAR_END`, and such an answer is outside them.
"""

import csv
import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp
from scipy.stats import t as student

import jblast.waves
from calibration.likelihood import marginal
from jblast.cli.jax_start import start_jax
from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    STANDARD_TEMPERATURE,
)
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

FILE = Path(__file__).parent / "data" / "acoustic_ford2021.csv"
OUTPUT = Path(jblast.waves.__path__[0]) / "data" / "far_scatter.json"
SPAN = (20.0, 300.0)
SHALLOW = 0.1
"""Scaled height or depth up to which a charge counts as on the ground [m/kg^(1/3)]."""

DEEP = -0.2
"""Scaled height below which a shot is listed apart, as for `ford_2021`."""

FAR = 300.0
"""Scaled distance past which masses are estimated [m/kg^(1/3)]."""

NEAR_SD = 0.10
"""Declared scatter of a shot, and of a record, near the charge [ln]."""

EXPONENTS = (2.0, FAR_SCATTER_EXPONENT, 8.0)
QUANTITIES = ("peak_overpressure_pa", "positive_impulse_pa_s", "positive_duration_s")
BINS = ((20, 40), (40, 100), (100, 200), (200, 300), (300, 450), (450, 1000))


class Records(NamedTuple):
    """One row a record.

    Attributes:
        shot: Its name; the campaign is the part before the hyphen.
        z: Scaled distance [m/kg^(1/3)].
        height: Scaled height of burst [m/kg^(1/3)].
        charge_mass: W [kg].
        slant_range: R [m].
        ambient_pressure: P0 [Pa].
        sound_speed: Of dry air [m/s].
        value: By quantity, in its unit.
    """

    shot: np.ndarray
    z: np.ndarray
    height: np.ndarray
    charge_mass: np.ndarray
    slant_range: np.ndarray
    ambient_pressure: np.ndarray
    sound_speed: np.ndarray
    value: dict[str, np.ndarray]

    def campaign(self) -> np.ndarray:
        """Return the campaign of each record."""
        return np.array([name.split("-")[0] for name in self.shot])

    def log_ratio(self, quantity: str) -> np.ndarray:
        """Return ln of recorded over `shock_kinematics` on the surface."""
        place = self.slant_range, self.charge_mass, self.ambient_pressure
        if quantity == "peak_overpressure_pa":
            law = shock_kinematics_pressure(*place)
        elif quantity == "positive_impulse_pa_s":
            law = shock_kinematics_impulse(*place, self.sound_speed)
        else:
            law = shock_kinematics_duration(*place, self.sound_speed)
        return np.log(self.value[quantity] / np.asarray(law))


@cache
def every_record() -> Records:
    """Return all records of chemical shots that have impulse and duration."""
    lines = [line for line in FILE.read_text().splitlines() if line[:1] != "#"]
    rows = [row for row in csv.DictReader(lines) if row["kind"] == "chemical"]
    rows = [row for row in rows if row["impulse_Pa_s"] and row["duration_s"]]

    def column(name: str) -> np.ndarray:
        return np.array([float(row[name]) for row in rows])

    mass, ambient = column("yield_kg"), 1e3 * column("P_ambient_kPa")
    size = np.cbrt(mass * STANDARD_PRESSURE / ambient)
    impulse, duration = column("impulse_Pa_s"), column("duration_s")
    warmth = column("T_ambient_K") / STANDARD_TEMPERATURE
    return Records(
        shot=np.array([row["source"] for row in rows]),
        z=column("range_m") / size,
        height=column("hob_m") / size,
        charge_mass=mass,
        slant_range=column("range_m"),
        ambient_pressure=ambient,
        sound_speed=STANDARD_SOUND_SPEED * np.sqrt(warmth),
        value=dict(
            zip(QUANTITIES, (2.0 * impulse / duration, impulse, duration), strict=True)
        ),
    )


def records() -> dict[str, np.ndarray]:
    """Return shot, Z, and the peak of a triangle over the ambient pressure [1 atm].

    Of shots on the ground, and records within `SPAN`.
    """
    found = every_record()
    good = np.abs(found.height) <= SHALLOW
    good &= (found.z >= SPAN[0]) & (found.z <= SPAN[1])
    relative = found.ambient_pressure / STANDARD_PRESSURE
    peak = found.value["peak_overpressure_pa"] / relative
    return {"shot": found.shot[good], "z": found.z[good], "peak": peak[good]}


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

    It takes ln F, ln R, ln Z_k, B, n and ln r, then y and the weights of the records.
    """
    found = every_record()
    names, of_shot = np.unique(found.shot, return_inverse=True)
    n_shots, z = len(names), jnp.asarray(found.z)
    # A level with sd 100 is free, and a shot left out needs some precision.
    precision = jnp.concatenate([jnp.full(n_shots, 1e-4), jnp.ones(n_shots)])

    def parts(p: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        shared, own, knee, loss, exponent, near = p
        share = 1.0 / (1.0 + (knee / z) ** exponent)
        wider = jnp.sqrt(1.0 + (own * share / near) ** 2)
        return shared * share, loss * share, wider

    def cost(theta: jax.Array, y: jax.Array, weight: jax.Array) -> jax.Array:
        def scaled(p: jax.Array, x: jax.Array) -> jax.Array:
            # residual over the growth of its scale, so that one scale serves all
            shared, loss, wider = parts(p)
            far = shared * x[n_shots:][of_shot] - loss
            return (x[:n_shots][of_shot] + far - y) / wider

        p = jnp.concatenate([jnp.exp(theta[:3]), theta[3:5], jnp.exp(theta[5:])])
        start = jnp.zeros(2 * n_shots)
        nothing = jnp.zeros(len(found.z))
        found_at = marginal(scaled, p, precision, start, nothing, weight, 4.0)
        return jnp.sum(weight * jnp.log(parts(p)[2])) - found_at.log_likelihood

    return jax.jit(jax.value_and_grad(cost))


def fit(
    quantity: str,
    *,
    exponent: float = FAR_SCATTER_EXPONENT,
    loss: bool = False,
    keep: np.ndarray | None = None,
) -> FarFit:
    """Estimate the far scatter of a quantity.

    Args:
        quantity: One of `QUANTITIES`.
        exponent: $n$.
        loss: Whether $B$ is fitted, or zero.
        keep: Which records are used; None: all.
    """
    found = every_record()
    y = jnp.asarray(found.log_ratio(quantity))
    weight = jnp.asarray(np.ones(len(y)) if keep is None else keep.astype(float))
    bounds = [(-3.0, 1.5), (-4.0, 1.0), (4.0, 7.0), (-2.0, 3.0), (exponent,) * 2]
    bounds += [(-4.0, 0.0)]
    if not loss:
        bounds[3] = (0.0, 0.0)

    def value_and_slope(theta: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = _objective()(jnp.asarray(theta), y, weight)
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


STEP = 0.04
GRID = np.arange(-24.0, 10.0 + STEP / 2, STEP)
"""ln of the mass over the true one."""
NORMAL = np.linspace(-5.0, 5.0, 41)


def mass_interval(shot: str, far: FarFit | None) -> tuple[float, float, float]:
    """Return 5, 50 and 95 % of ln(mass/true mass), from peaks past `FAR` alone.

    Args:
        shot: Its name.
        far: Fitted far away; None: scatter near the charge, everywhere.
    """
    found = every_record()
    rows = (found.shot == shot) & (found.z > FAR)
    mass = found.charge_mass[rows] * np.exp(GRID)[:, None]
    place = found.slant_range[rows] + 0.0 * mass, mass, found.ambient_pressure[rows]
    law = np.asarray(shock_kinematics_pressure(*place))
    left = np.log(found.value["peak_overpressure_pa"][rows] / law)
    z = found.z[rows] * np.exp(-GRID / 3.0)[:, None]
    shared, own = map(np.asarray, far.far.at(z)) if far else (0.0 * z, 0.0 * z)
    if far:
        left = left + far.loss * shared / far.far.shared
    scale = np.hypot(NEAR_SD, own)
    prior = -0.5 * NORMAL**2
    log_density = []
    for level in NEAR_SD * NORMAL:
        each = left[:, None] - level - NORMAL[:, None] * shared[:, None]
        terms = student.logpdf(each / scale[:, None], 4.0) - np.log(scale[:, None])
        log_density.append(logsumexp(terms.sum(axis=-1) + prior, axis=1))
    total = np.asarray(logsumexp(np.array(log_density) + prior[:, None], axis=0))
    density = np.exp(total - total.max())
    if max(density[0], density[-1]) > 1e-3:
        raise ValueError(f"the posterior of the mass of {shot} leaves its grid")
    cumulative = np.cumsum(density) / density.sum()
    q05, q50, q95 = np.interp((0.05, 0.5, 0.95), cumulative, GRID + STEP / 2)
    return float(q05), float(q50), float(q95)


def far_shots() -> list[str]:
    """Return the shots with records past `FAR`."""
    found = every_record()
    return sorted(set(found.shot[found.z > FAR].tolist()))


def text() -> str:
    """Return the tables."""
    lines = [*_slopes(), "", *_bins(), "", *_fits(), "", *_absorbed(), "", *_masses()]
    return "\n".join(lines)


def _slopes() -> list[str]:
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
    return lines


def _bins() -> list[str]:
    """Return recorded over law by Z: all shots, and those that are not deep."""
    found = every_record()
    shallow = found.height > DEEP
    lines = [
        f"all {len(found.z)} records of {len(set(found.shot))} shots, Z = "
        f"{found.z.min():.0f} to {found.z.max():.0f}: recorded/shock_kinematics, the "
        "median and the 16 to 84 % range",
        f"  not deep: the {len(set(found.shot[shallow]))} shots above h/W^(1/3) = "
        f"{DEEP:g}; level out: each of all shots over its own median at Z < 200",
        "  Z              records shots  "
        + "".join(f"{q:>26s}" for q in ("peak", "impulse", "duration")),
    ]
    ratios = {quantity: found.log_ratio(quantity) for quantity in QUANTITIES}
    for words, use, out in (("not deep", shallow, False), ("level out", None, True)):
        lines.append(f"  {words}")
        for low, high in BINS:
            some = (found.z >= low) & (found.z < high)
            some &= use if use is not None else np.isfinite(_levels(ratios)["peak"])
            cells = ""
            for quantity in QUANTITIES:
                y = ratios[quantity] - (_levels(ratios)[quantity] if out else 0.0)
                at = np.exp(np.quantile(y[some], (0.16, 0.5, 0.84)))
                cells += f"{at[1]:12.2f} ({at[0]:.2f} to {at[2]:.2f})"
            shots = len(set(found.shot[some]))
            lines.append(
                f"  {low:4d} to {high:4d}   {some.sum():6d} {shots:5d}  {cells}"
            )
    return lines


def _levels(ratios: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the level of each record's shot near the charge; NaN where it has none."""
    found = every_record()
    levels = {}
    for quantity, y in ratios.items():
        of_shot = np.full(len(y), np.nan)
        for shot in set(found.shot):
            near = (found.shot == shot) & (found.z < 200.0)
            if near.any():
                of_shot[found.shot == shot] = np.median(y[near])
        levels[quantity] = of_shot
    levels["peak"] = levels[QUANTITIES[0]]
    return levels


def _fits() -> list[str]:
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


def _absorbed() -> list[str]:
    """Return what absorption takes from the peaks past `FAR`, by ISO 9613-1."""
    found = every_record()
    far = found.z > FAR
    distance, mass = found.slant_range[far], found.charge_mass[far]
    ambient, sound = found.ambient_pressure[far], found.sound_speed[far]
    plain = np.asarray(shock_kinematics_pressure(distance, mass, ambient))
    worst = 0.0
    for humidity in (0.1, 0.3, 0.5):
        lossy = weak_shock_iso_pressure(distance, mass, ambient, sound, 300.0, humidity)
        worst = max(worst, float(np.max(1.0 - np.asarray(lossy) / plain)))
    return [
        f"ISO 9613-1 takes at most {100 * worst:.1f} % of the peaks past Z = {FAR:g} "
        "(27 C, 10 to 50 % humidity)"
    ]


def _masses() -> list[str]:
    found = every_record()
    lines = [
        f"mass from peaks past Z = {FAR:g} alone: 5, 50 and 95 % of mass/true mass",
        "  shot    records h/W^1/3  median peak/law   near scatter                "
        "shot left out, B = 0        shot left out, B fitted     campaign left out, B",
    ]
    count = np.zeros(4, int)
    shallow = 0
    for shot in far_shots():
        rows = found.shot == shot
        of_campaign = found.campaign() == shot.split("-")[0]
        deep = found.height[rows][0] < DEEP
        far_rows = rows & (found.z > FAR)
        ratio = np.exp(np.median(found.log_ratio(QUANTITIES[0])[far_rows]))
        cells = ""
        models = (
            None,
            fit(QUANTITIES[0], keep=~rows),
            fit(QUANTITIES[0], keep=~rows, loss=True),
            fit(QUANTITIES[0], keep=~of_campaign, loss=True),
        )
        for i, far in enumerate(models):
            low, middle, high = mass_interval(shot, far)
            inside = low <= 0.0 <= high
            count[i] += inside and not deep
            low, middle, high = np.exp([low, middle, high])
            cells += (
                f"{low:8.2g} {middle:7.2g} {high:6.2g} {'in ' if inside else 'OUT'}"
            )
        shallow += not deep
        lines.append(
            f"  {shot:8s}{far_rows.sum():6d} {found.height[rows][0]:8.2f} {ratio:13.2f}"
            f"   {cells}{'  deep' if deep else ''}"
        )
    lines.append(
        f"  contain the true mass, of {shallow} that are not deep: "
        + ", ".join(map(str, count))
    )
    return lines


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
    print(text())
    write_text(OUTPUT, as_json())
