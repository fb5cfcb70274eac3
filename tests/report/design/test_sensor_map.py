import dataclasses

import numpy as np
import pytest

from jblast.inference import BoundMap
from jblast.report.design_figure import bound_figure, round_levels

pytestmark = pytest.mark.slow  # each layout compiles its own search

EAST = np.linspace(-100.0, 100.0, 21)
NORTH = np.linspace(-50.0, 150.0, 21)


def made(**changes) -> BoundMap:
    """A map that is darkest at the charge, its upper rows outside a law's range."""
    away = np.hypot(EAST[None, :] - 10.0, NORTH[:, None] - 20.0)
    drawn = BoundMap(
        east=EAST,
        north=NORTH,
        up=1.5,
        log_sd_mass=0.05 + 0.3 * away / 100.0,
        place_sd=0.2 + away / 20.0,
        mass="charge_mass_kg",
        place=("charge_east_m", "charge_north_m"),
        now={"mass": 0.4, "place": 8.0},
        valid=np.broadcast_to(NORTH[:, None] < 120.0, (21, 21)),
        like="a",
        records=("air_arrival_s", "peak_overpressure_pa"),
        sensors={"a": (60.0, 0.0), "b <x>": (-70.0, 30.0)},
        charges=np.array([[10.0, 20.0]]),
    )
    return dataclasses.replace(drawn, **changes)


def words(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_mass_and_place_have_a_panel_each_with_contours_in_their_units():
    figure = bound_figure(made())
    mass, place = figure.axes
    assert mass.get_title("left") == "Sd of charge mass"
    assert mass.get_title("right") == "now 40 %"
    assert place.get_title("left") == "Sd of position"
    assert place.get_title("right") == "now 8 m"
    figure.draw_without_rendering()
    labels = words(figure)
    assert any(label.endswith(" %") for label in labels)
    assert any(label.endswith(" m") for label in labels)
    assert {"a", "b <x>"} <= set(labels)
    assert mass.get_xlim() == (-100.0, 100.0)
    assert mass.get_ylim() == (-50.0, 150.0)


def test_the_caption_says_what_the_next_sensor_records_and_what_is_hatched():
    def caption(drawn):
        return " ".join(bound_figure(drawn).get_supxlabel().split())

    text = caption(made())
    assert "records air arrival and peak overpressure like a" in text
    assert "1.5 m up" in text
    assert "Hatched: outside the range of a law." in text
    everywhere = np.ones((21, 21), bool)
    assert "Hatched" not in caption(made(valid=everywhere))


def test_what_stays_unidentified_everywhere_is_said_and_not_drawn():
    never = np.full((21, 21), np.inf)
    figure = bound_figure(made(log_sd_mass=None, place_sd=never, now={"place": np.inf}))
    (axes,) = figure.axes
    assert axes.get_title("right") == "now not identified"
    assert "not identified at any position" in words(figure)
    assert not axes.images


def test_a_map_with_holes_and_one_of_a_single_coordinate_are_drawn(tmp_path):
    holes = np.array(made().log_sd_mass)
    holes[:5] = np.inf
    drawn = made(log_sd_mass=holes, place=("charge_north_m",))
    figure = bound_figure(drawn)
    assert figure.axes[1].get_title("left") == "Sd of charge north"
    assert np.ma.count_masked(figure.axes[0].images[0].get_array()) == 5 * 21
    for kind in ("png", "svg", "pdf"):
        figure.savefig(tmp_path / f"map.{kind}")
        assert (tmp_path / f"map.{kind}").stat().st_size > 5000


@pytest.mark.parametrize(
    ("low", "high", "few"),
    [(21.0, 27.5, 3), (0.4, 80.0, 3), (1.0, 1e6, 3), (99.0, 101.5, 2)],
)
def test_contours_are_a_few_round_numbers_inside(low, high, few):
    levels = round_levels(low, high)
    assert few <= len(levels) <= 7
    assert (levels > low).all()
    assert (levels < high).all()
    assert all(float(f"{level:.4g}") == pytest.approx(level) for level in levels)


def test_a_flat_map_has_no_contours():
    assert len(round_levels(10.0, 10.05)) == 0
    flat = np.full((21, 21), 0.1)
    assert bound_figure(made(log_sd_mass=flat, place_sd=None)).axes
