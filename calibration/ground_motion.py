"""How much does the ground move, by scaled range and burial?

    python -m calibration.ground_motion > calibration/results/ground_motion.txt

Data: calibration/data/seismic_ford2021.csv (its provenance stands there; that its
values are metres and metres a second is INFERRED, with medium confidence). No random
numbers. Writes jblast/waves/data/ground_motion.json and
calibration/results/ground_motion.png.

A record is the curve of `jblast/waves/laws/ground_motion.py` plus what its site,
its shot and its path add, plus an error of its own, all Gaussian in ln. A path is the
same in all shots of a site. Forms are compared by AIC at the maximum likelihood.
Scatters are then those of the restricted likelihood, times a prior on the site and the
shot scatter (`EXPECTED_SD`): four sites are few. Of these two the law has the root of
the posterior mean of the variance (`predictive`), which is larger than the most
probable scatter: with normal effects, what is uncertain about a scatter has to enter
its size. Coefficients and covariance are those that go with it. How steeply the
coupling changes with burial (b4) the recordings do not say, between 10 and 30 per
m/kg^(1/3); it is held at 15 for both quantities.

Shots. 12 shots were added to the first ten, whose shot scatter was 0.09 in displacement
and 0.07 in velocity. Now it is 0.47 and 0.61: charges of 175 kg in the wet rock of HTP
differ by up to 2.4 in ln, those at the other sites hardly more than before. A scatter
that differs from site to site needs more sites than four; until then all sites have the
mean.

Records of the one shot at FSS lie 3 in ln below the others in displacement, 1.2 in
velocity: the other sites do not predict it. Its displacement over velocity is 0.3 ms in
the middle, against 3 ms elsewhere: either its displacements are in another unit, or a
high-pass took most of them, or the rock is another. They stay in, and make the site
scatter of the displacement what it is.

Left out in turn, shots and sites are predicted by curves that have not seen them, with
the scatter that the law claims for a new site. "mean" is that of what a shot's records
are above the prediction, in ln, "sd" what the law claims for it; "inside" counts
records within their own 90 % interval; ln W is the most probable one of the shot, its
height known, every mass of 1e-3 to 1e9 kg as likely in ln beforehand. Shots of a site
that was seen are predicted better than claimed, for the site is no longer new. Without
the site HR the burial at which coupling changes is not determined, so b5 is held at
-0.2 where sites are left out: that much these rows have seen.
"""

import itertools
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import jblast.waves
from calibration.likelihood import (
    Form,
    Maximum,
    Model,
    Records,
    objective,
    packaged,
    read_records,
    with_mode,
)
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.colours import COLOURS, INK
from jblast.report.figures import MARKERS, new_figure, quiet, titled, write_figure
from jblast.waves.laws.ground_motion import ground_motion_form
from jblast.waves.regression import Regression, log_scaled_place

TABLE = Path(__file__).parent / "data" / "seismic_ford2021.csv"
OUTPUT = Path(jblast.waves.__path__[0]) / "data" / "ground_motion.json"
FIGURE = Path(__file__).parent / "results" / "ground_motion.png"
COLUMNS = {
    "ground_displacement_m": "p_wave_displacement",
    "ground_peak_velocity_m_s": "p_wave_max_velocity",
}
QUANTITIES = tuple(COLUMNS)
COEFFICIENTS = ("b1", "b2", "b3", "b4", "b5")
SCATTERS = ("site", "shot", "path", "record")
EXPECTED_SD = {"site": 1.0, "shot": 1.0}
"""Mode of the prior on two scatters [ln], Gamma of shape 2: wide (90 % from 0.36 to
4.7), it excludes that a few sites have no scatter at all. It lowers the most probable
site scatter by 6 % and raises that of shots by 2 %."""
SD_GRID = np.geomspace(0.05, 12.0, 18)
"""Site and shot scatters that the posterior is summed over [ln]: steps of 38 %, about
one and a half of its standard deviations, enough for sums over an even grid."""

STARTS = {
    "ground_displacement_m": (-11.0, -1.4, 1.2, 15.0, -0.2, 1.4, 0.1, 0.4, 0.26),
    "ground_peak_velocity_m_s": (-0.6, -1.8, 1.2, 15.0, -0.2, 0.5, 0.1, 0.4, 0.39),
}


AXES = {
    "ground_displacement_m": (
        "peak displacement over W$^{1/3}$ [m/kg$^{1/3}$]",
        "displacement",
    ),
    "ground_peak_velocity_m_s": ("peak velocity [m/s]", "velocity"),
}
ABOVE, BURIED = 0.5, -1.0
"""Scaled heights that curves are drawn for [m/kg^(1/3)]."""


STEEP = (("b4", 15.0),)
ADOPTED = Form(STEEP)
WITHOUT = {"shot": ADOPTED, "site": Form((*STEEP, ("b5", -0.2)))}
"""What is fitted when one is left out."""
FORMS = {
    "coupling steps, b4 = 15": ADOPTED,
    "  b4 = 10": Form((("b4", 10.0),)),
    "  b4 = 30": Form((("b4", 30.0),)),
    "  b4 free": Form(),
    "  no site effect": Form((*STEEP, ("site", 0.0))),
    "  no path effect": Form((*STEEP, ("path", 0.0))),
    "  Student-t records": Form(STEEP, 4.0),
    "straight line in h/W^(1/3)": Form((("b4", 0.1), ("b5", 0.0))),
    "no coupling": Form((*STEEP, ("b3", 0.0), ("b5", 0.0))),
}
MASSES = np.geomspace(1e-3, 1e9, 1201)
NINETY = 1.645
"""Standard deviations of a normal to either side that hold 90 %."""


def records() -> Records:
    """Return all 200 records."""
    return read_records(TABLE)


def log_value(quantity: str, some: Records) -> np.ndarray:
    """Return ln y of records, of the displacement over the scaling length."""
    value = some.column(COLUMNS[quantity])
    displacement = quantity == "ground_displacement_m"
    return np.log(value / np.cbrt(some.charge_mass) ** displacement)


@cache
def model(quantity: str) -> Model:
    """Return the records of a quantity about the curve."""
    found = records()
    place = found.place()
    return Model(
        found,
        log_value(quantity, found),
        lambda b: ground_motion_form(b, *place)[0],
        lambda sd: (sd[0], sd[1], sd[2]),
        COEFFICIENTS,
        SCATTERS,
        (STARTS[quantity],),
        EXPECTED_SD,
    )


def predictive(
    quantity: str, form: Form, weight: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Return values with the scatter of a new shot, and the covariance with it.

    The variance of a new site's effect is the posterior mean of $\sigma^2$, not the
    square of the most probable $\sigma$: of three or four sites the scatter is known
    to a factor of two, and the mode is too small. The curve is linear about its most
    probable coefficients for the sum over both scatters; path and record scatter, which
    many records determine, stay. Coefficients are then those of generalised least
    squares with these scatters.

    Args:
        quantity: Of `QUANTITIES`.
        form: What is fitted.
        weight: 1 for a record that is used, 0 for one left out.
        values: The most probable coefficients and scatters.
    """
    found, used, n = model(quantity), weight > 0, len(COEFFICIENTS)
    held, inner, records = dict(form.held), found.inner(form), found.records
    curve, gradient = ground_motion_form(jnp.asarray(values[:n]), *records.place())
    left = np.asarray(found.value - curve)[used]
    slopes = np.stack(gradient, axis=-1)[used][:, inner]
    alike = [
        np.equal.outer(names[used], names[used])
        for names in (records.site, records.shot, records.path)
    ]
    path_sd, record_sd = values[n + 2 :]
    known = path_sd**2 * alike[2] + record_sd**2 * np.eye(used.sum())
    grids = [
        np.array([held[name]]) if name in held else SD_GRID for name in SCATTERS[:2]
    ]
    density = np.zeros([grid.size for grid in grids])
    for (i, site), (j, shot) in itertools.product(*map(enumerate, grids)):
        covariance = known + site**2 * alike[0] + shot**2 * alike[1]
        solved = np.linalg.solve(covariance, np.column_stack([slopes, left]))
        information = slopes.T @ solved[:, :-1]
        pull = slopes.T @ solved[:, -1]
        density[i, j] = -0.5 * (
            np.linalg.slogdet(covariance)[1]
            + np.linalg.slogdet(information)[1]
            + left @ solved[:, -1]
            - pull @ np.linalg.solve(information, pull)
        )
        for name, sd in (("site", site), ("shot", shot)):
            if name not in held:  # prior, and the step of a geometric grid
                density[i, j] += np.log(sd) - sd / EXPECTED_SD[name] + np.log(sd)
    share = np.exp(density - density.max())
    share /= share.sum()
    values = values.copy()
    for place_of, axis, grid in zip((n, n + 1), (1, 0), grids, strict=True):
        values[place_of] = np.sqrt(share.sum(axis=axis) @ grid**2)
    (_, end), _ = objective(found, form, True)(values, jnp.asarray(weight))
    return with_mode(values, end, inner, n)


def fit(
    quantity: str, form: Form = ADOPTED, weight: np.ndarray | None = None
) -> Maximum:
    """Fit a quantity, with the scatter of a new site; weight 0 leaves a record out."""
    weight = np.ones(len(records().shot)) if weight is None else weight
    found = model(quantity).fit(form, weight=weight)
    values, covariance = predictive(quantity, form, weight, found.values)
    return found._replace(values=values, covariance=covariance)


def curve_of(found: Maximum) -> Regression:
    """Return the curve of a fit."""
    values, n = found.values, len(COEFFICIENTS)
    return Regression(ground_motion_form, values[:n], found.covariance, *values[n:])


def covariance_of(
    curve: Regression, records: Records, charge_mass: np.ndarray
) -> np.ndarray:
    """Return what the law claims for the records of one shot at a new site.

    Args:
        curve: The law.
        records: Of one shot, n of them.
        charge_mass: Masses that broadcast against the records [kg].

    Returns:
        Of shape [..., n, n].
    """
    place = records.slant_range, charge_mass, records.height_of_burst
    shot, path, own = curve.scatter(*map(np.asarray, log_scaled_place(*place)))
    same_path = records.path[:, None] == records.path[None, :]
    return (
        shot[..., :, None] * shot[..., None, :]
        + float(path) ** 2 * same_path
        + float(own) ** 2 * np.eye(len(records.path))
    )


def log_density(
    quantity: str, curve: Regression, shot: Records, mass: np.ndarray
) -> np.ndarray:
    """Return ln of the density of a shot's records at each mass.

    Args:
        quantity: Of `QUANTITIES`.
        curve: The law.
        shot: Records of one shot; their mass only undoes the scaling of the values.
        mass: Charge masses [kg].
    """
    mass = mass[:, None]
    # measured values, scaled by each mass instead
    scale = np.log(mass / shot.charge_mass) / 3.0
    value = log_value(quantity, shot) - scale * (quantity == "ground_displacement_m")
    place = log_scaled_place(shot.slant_range, mass, shot.height_of_burst)
    residual = value - np.asarray(curve.at(*place)[0])
    claimed = covariance_of(curve, shot, mass)
    solved = np.linalg.solve(claimed, residual[..., None])[..., 0]
    density = -0.5 * np.sum(residual * solved, axis=-1)
    return density - 0.5 * np.linalg.slogdet(claimed)[1]


def log_mass(quantity: str, curve: Regression, shot: Records) -> tuple[float, float]:
    """Return the most probable ln W of a shot, and the sd of its posterior."""
    density = log_density(quantity, curve, shot, MASSES)
    weights = np.exp(density - density.max())
    weights /= weights.sum()
    masses = np.log(MASSES)
    sd = np.sqrt(weights @ masses**2 - (weights @ masses) ** 2)
    return float(masses[np.argmax(weights)]), float(sd)


def show_left_out(quantity: str, by: str) -> None:
    """Print how shots come out by curves that have not seen them, or their site."""
    found = records()
    groups = found.shot if by == "shot" else found.site
    print(f"  each {by} left out in turn")
    print("    shot     records  h/W^(1/3)   mean     sd  inside   ln W   true     sd")
    scores, inside, total = [], 0, 0
    for name in dict.fromkeys(groups.tolist()):
        learned = curve_of(fit(quantity, WITHOUT[by], (groups != name) * 1.0))
        for shot in dict.fromkeys(found.shot[groups == name].tolist()):
            mine = found.where(found.shot == shot)
            residual = log_value(quantity, mine)
            residual = residual - np.asarray(learned.at(*mine.place())[0])
            claimed = covariance_of(learned, mine, mine.charge_mass)
            n = len(residual)
            hits = int(np.sum(np.abs(residual) < NINETY * np.sqrt(np.diag(claimed))))
            sd = np.sqrt(claimed.sum()) / n
            mass, mass_sd = log_mass(quantity, learned, mine)
            true = np.log(mine.charge_mass[0])
            print(
                f"    {shot:8s} {n:7d} {float(mine.place()[1][0]):10.2f} "
                f"{residual.mean():6.2f} {sd:6.2f} {hits:3d}/{n:<3d}"
                f"{mass:6.2f} {true:6.2f} {mass_sd:6.2f}"
            )
            scores.append(residual.mean() / sd)
            inside, total = inside + hits, total + n
    rms = np.sqrt(np.mean(np.square(scores)))
    print(f"    mean over sd, rms {rms:.2f}; {inside} of {total} records inside")


def main() -> None:
    """Print the tables, write the data file and the picture."""
    start_jax()
    curves: dict[str, Regression] = {}
    for quantity in QUANTITIES:
        found = fit(quantity)
        model(quantity).show(quantity, FORMS, found)
        curves[quantity] = curve_of(found)
        for by in WITHOUT:
            show_left_out(quantity, by)
    write_text(
        OUTPUT,
        packaged("ground_motion", f"{TABLE.name}; units inferred", records(), curves),
    )
    draw(curves)
    print(f"wrote {OUTPUT.name} and {FIGURE.name}")


def draw(curves: Mapping[str, Regression]) -> None:
    """Write the figure: each quantity by range, and its coupling by burial."""
    found = records()
    log_range, height = map(np.asarray, found.place())
    figure = new_figure(10.0, 7.6)
    panels = figure.subplots(2, 2)
    z = np.geomspace(20.0, 1000.0, 50)
    x = np.linspace(-1.6, 1.0, 400)
    for (by_range, by_burial), (quantity, curve) in zip(
        panels, curves.items(), strict=True
    ):
        label, word = AXES[quantity]
        value, b = log_value(quantity, found), np.asarray(curve.coefficients)
        for site, colour, marker in zip(
            np.unique(found.site), COLOURS, MARKERS, strict=False
        ):
            mine = found.site == site
            buried = height < float(b[4])
            look = {"marker": marker, "color": colour, "markersize": 5, "ls": ""}
            for rows, face in ((mine & ~buried, "none"), (mine & buried, colour)):
                at = np.exp(log_range[rows]), np.exp(value[rows])
                by_range.plot(*at, markerfacecolor=face, **look)
            at_100 = np.exp(value - float(b[1]) * (log_range - np.log(100.0)))
            look |= {"markerfacecolor": "none", "label": site}
            by_burial.plot(height[mine], at_100[mine], **look)
        for level, style in ((BURIED, "-"), (ABOVE, "--")):
            line, _ = curve.at(jnp.log(z), jnp.full(z.shape, level))
            by_range.plot(z, np.exp(line), style, color=INK)
        at_100 = jnp.full(x.shape, jnp.log(100.0))
        line, _ = curve.at(at_100, jnp.asarray(x))
        by_burial.plot(x, np.exp(line), color=INK)
        by_range.set(xscale="log", yscale="log", ylabel=label)
        by_range.set_xlabel("R/W$^{1/3}$ [m/kg$^{1/3}$]")
        by_burial.set(yscale="log", xlabel="h/W$^{1/3}$ [m/kg$^{1/3}$]")
        titled(by_range, word, "filled: buried; line: buried, dashed: above")
        titled(by_burial, f"{word}, taken to 100 m/kg$^{{1/3}}$")
        by_burial.legend(frameon=False, fontsize=9)
        for axes in (by_range, by_burial):
            quiet(axes)
    write_figure(figure, FIGURE)


if __name__ == "__main__":
    main()
