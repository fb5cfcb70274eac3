"""The figure of many flights: what it says stands beside its curves, not over them."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.report.flight_figures import distribution_figure
from jblast.scene import VehicleSpec
from jblast.study.flight_results import Encounter, Exposure, Flights, Flown, Options
from jblast.vehicle import FlightMetrics

COUNT = 40


def flown(deviation: np.ndarray) -> Flown:
    """Return flights of some peak deviations."""
    zero, no = jnp.zeros(COUNT), jnp.zeros(COUNT, bool)
    metrics = FlightMetrics(zero, zero, jnp.asarray(deviation), zero, zero, ~no, no)
    each = jnp.linspace(2.0, 8.0, COUNT)[:, None]
    encounter = Encounter(each, each, each, each, ~no[:, None])
    return Flown(metrics, encounter, Exposure(zero, zero, zero), zero, no, None)


@pytest.mark.parametrize("bend", [0.2, 1.0, 5.0])
def test_the_legend_lies_over_no_curve(bend):
    deviation = 10 ** (2 * np.linspace(0.0, 1.0, COUNT) ** bend - 2)
    holds = {name: flown(deviation) for name in ("with_integral", "without_integral")}
    flights = Flights(
        vehicle=VehicleSpec("iris", jnp.array([5.0, 0.0, 2.0])),
        options=Options(),
        seconds=1.0,
        count=COUNT,
        drawn={},
        blasts=("",),
        places_m=np.zeros((COUNT, 1, 3)),
        wind_m_s=np.zeros((COUNT, 2)),
        holds=holds,
        own=None,
    )
    figure = distribution_figure(flights)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    legend = axes.get_legend()
    assert legend is not None
    place = legend.get_window_extent()
    assert not place.overlaps(axes.get_window_extent())
    assert figure.bbox.contains(place.x0, place.y0)
    assert not place.overlaps(axes.xaxis.label.get_window_extent())
