"""Where a blast is too near for the laws, and too much for a vehicle that is held."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Each,
    PositionHold,
    blast_load,
    flight_metrics,
    named,
    named_gains,
    simulate,
)
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.flights.hold_limits import (
    HOME,
    NAMES,
    hovering,
    stacked,
)
from jblast.verification.stability.threshold import crossing

NEAR = np.array([0.0, 0.01, 0.1, 0.2, 0.5, 1.0, 2.0])
"""Places so far from a charge of 1 kg [m]."""
CHARGES = np.geomspace(1.0, 1000.0, 31)
"""TNT 5 m away [kg]."""


def near_impulses() -> tuple[Float[np.ndarray, " place"], Bool[np.ndarray, " place"]]:
    """Return the impulses 1 kg gives a Crazyflie at `NEAR` [N s], and the marks."""
    load = blast_load(Scene(charge=Charge(mass_kg=1.0)))
    level = hovering(named("crazyflie"))

    def given(distance):
        place = jnp.array([1.0, 0.0, 0.0]) * distance
        state = dataclasses.replace(level, position_m=place)
        push, _ = load.impulse(jnp.zeros(()), jnp.ones(()), state, named("crazyflie"))
        return jnp.linalg.norm(push), load.in_range(place)[0]

    sizes, held = jax.jit(jax.vmap(given))(jnp.asarray(NEAR))
    return np.asarray(sizes), np.asarray(held)


def near_failure() -> FailureMode:
    """Measure from where on a load is no longer by the laws."""
    sizes, held = near_impulses()
    load = blast_load(Scene(charge=Charge(mass_kg=1.0)))

    def inside(distance: float) -> float:
        place = jnp.array([distance, 0.0, 0.0])
        return float(load.in_range(place)[0]) - 0.5

    begins = crossing(inside, 0.1, 1.0)
    finite = bool(np.isfinite(sizes).all())
    return FailureMode(
        area="flights",
        method="blast load of 1 kg on the ground",
        failure="nearer than the laws' fits reach",
        boundary=begins,
        unit="m from the charge",
        beyond=f"{NEAR[1]:g} m: {sizes[1]:.2g} N s, as if it were at Z = 0.07; "
        f"{sizes[0]:.2g} at the charge, without a direction",
        response=verified(
            "marks", finite and not held[:3].any() and held[4:].all(), "near"
        ),
        message="in_range is false there; the load stays finite",
    )


def fly_on() -> tuple[
    Bool[np.ndarray, "vehicle charge"], Float[np.ndarray, "vehicle charge"]
]:
    """Return after which `CHARGES` each held vehicle flies on, and peak deviations [m].

    They hover 5 m up and 5 m from the charge, in the air; to come down or to turn over
    is a crash.
    """
    vehicles, holds, loads = [], [], []
    for name in NAMES:
        for mass in CHARGES:
            charge = Charge(mass_kg=mass, position_m=(5.0, 0.0, 5.0), burst="free-air")
            vehicles.append(dataclasses.replace(named(name), name=""))
            holds.append(PositionHold(HOME, named_gains(name)))
            loads.append(blast_load(Scene(charge=charge)))
    flown = simulate(
        stacked(vehicles),
        stacked([hovering(vehicle) for vehicle in vehicles]),
        duration_s=2.0,
        step_s=1e-3,
        control=Each(stacked(holds)),
        loads=(Each(stacked(loads)),),
        ground_up_m=0.0,
        store_every=10,
    )
    metrics = flight_metrics(
        flown, jnp.asarray(HOME), blast_time_s=0.0, ground_up_m=0.0
    )
    shape = len(NAMES), CHARGES.size
    alive = ~np.asarray(metrics.crashed).reshape(shape)
    return alive, np.asarray(metrics.peak_deviation_m).reshape(shape)


def charge_failures() -> list[FailureMode]:
    """Measure the least charge after which each held vehicle does not fly on."""
    modes = []
    for name, alive, peak in zip(NAMES, *fly_on(), strict=True):
        first = int(np.argmin(alive))
        modes.append(
            FailureMode(
                area="flights",
                method=f"{name}, position hold, 5 m from a charge",
                failure="it turns over or comes down",
                boundary=float(CHARGES[first]),
                unit="kg of TNT",
                beyond=f"{CHARGES[first - 1]:.2g} kg moves it {peak[first - 1]:.2g} m; "
                f"it flies on after {int(alive[first:].sum())} of "
                f"{CHARGES.size - first - 1} larger charges",
                response=verified("marks", first > 0 and not alive[first], name),
                message="crashed, in the metrics of the flight",
            )
        )
    return modes
