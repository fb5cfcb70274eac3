"""The kernel of Warp flies what JAX flies, on the CPU; what it cannot fly, it says."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Each,
    FriedlanderGust,
    PositionHold,
    State,
    StepGust,
    blast_load,
    named,
    named_gains,
    simulate,
)
from tests.vehicle.flights import at_hover

CRAFT = named("hummingbird")
BATCH = 5
PLACES = np.array([5.0, 0.0, 4.0]) + np.linspace(-1, 1, BATCH)[:, None] * [1, 2, 0.5]
FIELDS = (
    *("position_m", "velocity_m_s", "quaternion", "body_rate_rad_s"),
    *("rotor_speed_rad_s", "force_n", "moment_n_m"),
)
ROUNDING = {"float64": 1e-10, "float32": 1e-4}
"""Of the largest number of a field: a load is the difference of impulses over a step,
which loses some digits, and the hold multiplies what is lost."""


def start(dtype="float64") -> State:
    """Return a batch that flies and turns."""
    ones = np.ones((BATCH, 1))
    rest = at_hover(CRAFT)
    state = State(
        PLACES,
        ones * [1.0, -2.0, 0.5],
        ones * [0.1, -0.2, 0.1, 0.9],
        ones * [0.5, -0.3, 0.8],
        ones * np.asarray(rest.rotor_speed_rad_s),
    )
    return jax.tree.map(lambda x: x.astype(dtype), state)


def everything(*others: Charge) -> dict:
    """Return a flight of which each vehicle has its own hold, gust and blasts."""
    gains = named_gains("hummingbird", integral=True)
    many = jax.tree.map(
        lambda x: jnp.stack([x * (1 + n / 50) for n in range(BATCH)]), gains
    )
    push = jnp.tile(jnp.array([8.0, 3.0, -2.0]), (BATCH, 1))
    when = jnp.linspace(0.01, 0.02, BATCH)

    def loads(mass):
        return blast_load(Scene(charges=(Charge(mass_kg=mass, name="a"), *others)))

    return {
        "control": Each(
            PositionHold(jnp.asarray(PLACES), many, jnp.zeros(BATCH) + 0.3)
        ),
        "wind": Each(FriedlanderGust(push, when, 0.02 + 0 * when, 1 + when)),
        "loads": (Each(jax.vmap(loads)(jnp.linspace(0.5, 2.0, BATCH))),),
        "command_step_s": 2e-3,
        "ground_up_m": 0.0,
        "store_every": 7,
    }


def agree(vehicle, state, *, duration_s=0.05, **options) -> None:
    """Hold both to the same flight, and a flight it must be."""
    ours = simulate(
        vehicle, state, duration_s=duration_s, backend="warp:cpu", **options
    )
    jaxs = simulate(vehicle, state, duration_s=duration_s, backend="jax", **options)
    assert float(jnp.abs(jaxs.position_m[..., -1, :] - state.position_m).max()) > 0.01
    np.testing.assert_array_equal(ours.time_s, jaxs.time_s)
    assert ours.position_m.dtype == jaxs.position_m.dtype
    for name in FIELDS:
        there, here = np.asarray(getattr(jaxs, name)), np.asarray(getattr(ours, name))
        assert here.shape == there.shape
        scale = np.abs(there).max()
        rounding = ROUNDING[there.dtype.name] * scale
        np.testing.assert_allclose(here, there, atol=rounding, rtol=0, err_msg=name)
    assert not ours.lost.any()


@pytest.mark.slow
def test_same_flights_with_everything_at_once():
    agree(CRAFT, start(), **everything())


@pytest.mark.slow
def test_same_flights_through_a_blast_and_its_wave_from_the_ground():
    """The image is 10 m off, the charge itself behind a front that has gone by."""
    above = Charge(mass_kg=2.0, position_m=(9.0, 0.0, 6.0), burst="free-air")
    loads = [
        blast_load(Scene(above), reflection=reflected) for reflected in (True, False)
    ]
    agree(CRAFT, start(), loads=(loads[0],))
    ends = [
        simulate(
            CRAFT, start(), duration_s=0.05, loads=(load,), backend="warp:cpu"
        ).velocity_m_s[:, -1]
        for load in loads
    ]
    assert float(jnp.abs(ends[0] - ends[1]).max()) > 0.05


@pytest.mark.slow
def test_same_flights_of_two_axes_with_parts_of_loads_that_all_share():
    """One blast at once, one before the flight; the last step is a shorter one."""
    state = jax.tree.map(lambda x: jnp.stack([x, x * 1.01]), start())
    second = Charge(
        mass_kg=2.0,
        position_m=(9.0, 0.0, 0.0),
        time_s=-0.012,
        burst="free-air",
        name="b",
    )
    made = Scene(charges=(Charge(mass_kg=1.0, name="a"), second))
    agree(
        CRAFT,
        state,
        duration_s=0.0503,
        control=PositionHold([6.0, 1.0, 4.5], named_gains("hummingbird"), 2.0),
        command_step_s=1e-3,
        wind=Each(StepGust(2 * state.velocity_m_s, jnp.full((2, BATCH), 0.01))),
        loads=(
            blast_load(made, drag=False),
            blast_load(made, front=False, rotors=False),
            blast_load(made, drag=False, rotors=False),
        ),
        store_every=7,
    )


def test_more_blasts_than_an_integer_has_bits():
    """A blast pushes as much at the end of a long list as at its beginning."""
    strong = Charge(mass_kg=1.0, name="strong")
    weak = tuple(Charge(mass_kg=1e-3, time_s=n / 1000, name=f"{n}") for n in range(35))
    alone = at_hover(CRAFT, position=(5.0, 0.0, 4.0))
    ends = []
    for charge, *others in ((strong, *weak), (*weak, strong)):
        load = blast_load(Scene(charges=(charge, *others)))
        flown = simulate(
            CRAFT, alone, duration_s=0.06, loads=(load,), backend="warp:cpu"
        )
        ends.append(flown.velocity_m_s[-1])
    assert float(jnp.abs(ends[0]).max()) > 0.1
    np.testing.assert_allclose(*ends, atol=1e-11, rtol=0)


@pytest.mark.slow
def test_one_vehicle_alone_and_one_that_falls_to_the_ground():
    alone = at_hover(CRAFT, position=(0.0, 0.0, 0.4), rotor_speed_rad_s=np.zeros(4))
    agree(CRAFT, alone, duration_s=0.5, ground_up_m=0.0, store_every=50)


@pytest.mark.slow
def test_one_that_diverges_ends_its_own_flight():
    state = start()
    spun = state.body_rate_rad_s.at[2].set(1e5)
    state = State(
        *(spun if n == 3 else x for n, x in enumerate(jax.tree.leaves(state)))
    )
    flown = simulate(CRAFT, state, duration_s=0.5, store_every=10, backend="warp:cpu")
    assert flown.lost_places() == [(2,)]
    kept = jnp.array([0, 1, 3, 4])
    assert bool(jnp.isfinite(flown.position_m[kept]).all())
    assert bool(jnp.isnan(flown.position_m[2, -1]).all())


def test_rows_begin_with_the_state_that_was_given():
    state = start()
    flown = simulate(CRAFT, state, duration_s=0.01, store_every=10, backend="warp:cpu")
    for name, given in vars(state).items():
        if name == "quaternion":
            given = given / jnp.linalg.norm(given, axis=-1, keepdims=True)
        begun = getattr(flown, name)[:, 0]
        np.testing.assert_allclose(begun, given, rtol=1e-15, atol=0, err_msg=name)


def test_a_device_that_is_not_there():
    with pytest.raises(InputError, match="of warp:DEVICE among cpu"):
        simulate(CRAFT, start(), duration_s=0.01, backend="warp:cuda:9")


def test_rows_that_do_not_fit_are_counted_in_gigabytes(monkeypatch):
    from jblast.vehicle.warp import flight

    def none_left(shape, **_):
        raise RuntimeError("out of memory")

    monkeypatch.setattr(flight.wp, "empty", none_left)
    # 10 steps and the start, 23 numbers of 8 bytes each, of 5 vehicles
    with pytest.raises(InputError, match="11 rows of 5 vehicles take 1\\.01e-05 GB"):
        simulate(CRAFT, start(), duration_s=5e-3, backend="warp:cpu")


LED = dataclasses.replace(named_gains("hummingbird"), motor_lead=2.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"wind": lambda time_s, place: jnp.zeros(3)}, "wind of the type function"),
        ({"control": PositionHold(jnp.zeros(3), LED)}, "control with a motor_lead"),
    ],
)
def test_what_the_kernel_cannot_fly_flies_on_jax_and_says_so(options, said):
    with pytest.warns(UserWarning, match=f"{said}: JAX is used"):
        flown = simulate(CRAFT, start(), duration_s=0.001, backend="warp", **options)
    assert flown.position_m.shape == (BATCH, 3, 3)


@pytest.mark.slow
def test_auto_takes_the_kernel_on_a_gpu_but_for_double_precision(monkeypatch):
    from jblast.vehicle.warp import flight

    asked, device_named = [], flight.device_named

    def noted(name):
        asked.append(name)
        return device_named("cpu")

    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    monkeypatch.setattr(flight, "device_named", noted)
    simulate(CRAFT, start("float32"), duration_s=0.001)
    assert asked == [None]
    with pytest.warns(UserWarning, match="precision float64: JAX is used"):
        simulate(CRAFT, start(), duration_s=0.001)
    assert len(asked) == 1


def squared_deviation(mass, backend):
    """Return how far a held vehicle is from its place after a blast."""
    state = at_hover(CRAFT, position=(5.0, 0.0, 4.0))
    load = blast_load(Scene(Charge(mass_kg=mass)), rotors=False)
    flown = simulate(
        CRAFT,
        state,
        duration_s=0.02,
        loads=(load,),
        control=PositionHold(state.position_m, named_gains("hummingbird")),
        backend=backend,
    )
    return jnp.sum(jnp.square(flown.position_m[-1] - state.position_m))


@pytest.mark.slow
def test_derivatives_by_jax_are_right_and_warp_has_none():
    slope = float(jax.grad(squared_deviation)(1.0, "auto"))
    high, low = (float(squared_deviation(1.0 + h, "auto")) for h in (1e-4, -1e-4))
    assert slope > 0
    assert slope == pytest.approx((high - low) / 2e-4, rel=1e-5)
    with pytest.raises(InputError, match="Warp flights have no derivatives"):
        jax.grad(squared_deviation)(1.0, "warp:cpu")
