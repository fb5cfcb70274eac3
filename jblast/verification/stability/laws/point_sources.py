"""Where laws of a point source break: at weak shocks, and for a charge of TNT."""

import math

import numpy as np

from jblast.constants import STANDARD_PRESSURE, TNT_SPECIFIC_ENERGY
from jblast.inference.fitting.warnings import POINT_SOURCES, charge_is_no_point
from jblast.registry import LAWS
from jblast.scene import Charge
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.threshold import crossing, switching_point
from jblast.waves import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_pressure,
    point_source_arrival_time,
    point_source_pressure,
    sedov_taylor_energy,
    sedov_taylor_shock_pressure,
    sedov_taylor_shock_radius,
)

GAMMA = 1.4
DENSITY = 1.225
"""Of standard air [kg/m3]."""
OFF = 0.1
"""A pressure off by more than this is called wrong [-]."""
MEGAJOULE = 1e6


def point_source_failures() -> list[FailureMode]:
    """Measure them; a mass of 1 kg stands for all, by scaling."""
    return [_weak_shock(), _radius_of_tnt(), _pressure_of_tnt()]


def _weak_shock() -> FailureMode:
    """Find where Sedov's and Taylor's pressure leaves that of the exact solution."""

    def off(z):
        exact = float(point_source_pressure(z, 1.0)) + STANDARD_PRESSURE
        return float(sedov_taylor_shock_pressure(z, 1.0, GAMMA)) / exact - 1.0

    z = crossing(lambda z: off(z) + OFF, 0.4, 1.0)
    strength = float(point_source_pressure(z, 1.0)) / STANDARD_PRESSURE
    marked = switching_point(_sedov_valid, 0.4, 1.0)
    time = float(point_source_arrival_time(marked, 1.0))
    radius = float(sedov_taylor_shock_radius(time, 1.0, DENSITY, GAMMA))
    method = "shock_radius_m by sedov_taylor"
    return FailureMode(
        area="laws",
        method=method,
        failure="the shock is not strong any more",
        boundary=z,
        unit="m/kg^(1/3)",
        beyond=f"pressure {100 * OFF:g} % too low at {strength:.0f} ambient pressures, "
        f"{-100 * off(1.0):.0f} % at Z = 1",
        response=verified("marks", marked < z, method),
        message=f"law_valid false from Z = {marked:.2f} on; there the pressure is "
        f"{100 * off(marked):+.0f} % off, the radius "
        f"{100 * (radius / marked - 1):+.1f} %",
    )


def _sedov_valid(z: float) -> bool:
    """Return whether the law holds when its own shock has come that far."""
    energy_of_one = float(sedov_taylor_energy(z, 1.0, DENSITY, GAMMA))
    time = math.sqrt(energy_of_one / TNT_SPECIFIC_ENERGY)
    law = LAWS["shock_radius_m", "sedov_taylor"]
    return bool(law.valid(time, 1.0, DENSITY, GAMMA, STANDARD_PRESSURE))


def _radius_of_tnt() -> FailureMode:
    """Read the energy of TNT from radius and time, by the law of a point source."""

    def share(z):
        time = kingery_bulmash_arrival_time(z, 1.0, burst="free-air")
        energy = sedov_taylor_energy(z, time, DENSITY, GAMMA)
        return float(energy) / TNT_SPECIFIC_ENERGY

    end = switching_point(_sedov_valid, 0.4, 1.0)
    method = "shock_radius_m by sedov_taylor"
    return FailureMode(
        area="laws",
        method=method,
        failure="a charge of TNT is no point",
        boundary=end,
        unit="m/kg^(1/3)",
        beyond="wherever its shock is strong: of the energy radius and time give "
        f"{100 * share(0.2):.0f} % at Z = 0.2, {100 * share(0.4):.0f} % at 0.4, "
        f"{100 * share(end):.0f} % at {end:.2f}",
        response=verified("marks", _is_told("sedov_taylor"), method),
        message='a warning, unless explosive = "nuclear"',
    )


def energy_error(z: float) -> float:
    """Return by how much 4.184 MJ/kg are off, as a point source that gives TNT's peak.

    Args:
        z: Scaled distance in free air [m/kg^(1/3)].
    """
    peak = float(kingery_bulmash_pressure(z, 1.0, burst="free-air"))
    mass = crossing(lambda m: float(point_source_pressure(z, m)) - peak, 1e-3, 1e3)
    return 1.0 / mass - 1.0


def _pressure_of_tnt() -> FailureMode:
    """Find where a point source of the energy of TNT leaves Kingery and Bulmash."""
    # 4.184 MJ/kg are enough at one place alone; farther out it takes more
    boundary = crossing(lambda z: energy_error(z) + 0.3, 2.5, 5.0)
    inside = np.geomspace(0.3, boundary, 40)
    errors = np.array([energy_error(z) for z in inside])
    method = "peak_overpressure_pa by point_source"
    return FailureMode(
        area="laws",
        method=method,
        failure="a charge of TNT is no point",
        boundary=boundary,
        unit="m/kg^(1/3)",
        beyond=f"inside, {TNT_SPECIFIC_ENERGY / MEGAJOULE:.3f} MJ/kg are "
        f"{100 * errors.min():+.0f} to {100 * errors.max():+.0f} % off the energy that "
        f"makes the peak of kingery_bulmash; {100 * energy_error(10.0):+.0f} % "
        "at Z = 10",
        response=verified("marks", _is_told("point_source"), method),
        message='a warning, unless explosive = "nuclear"',
    )


def _is_told(law: str) -> bool:
    findings = charge_is_no_point([law], Charge(mass_kg=1.0))
    nuclear = charge_is_no_point([law], Charge(mass_kg=1.0, explosive="nuclear"))
    return law in POINT_SOURCES and bool(findings) and not nuclear
