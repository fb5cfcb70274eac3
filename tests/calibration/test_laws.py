import re
from pathlib import Path

import numpy as np
import pytest

from calibration.laws import (
    BURSTS,
    MASS,
    RESULTS,
    SCALED_DISTANCE,
    SCALED_TIME,
    drawn_laws,
    figure_name,
    law_figure,
    laws_text,
    panels,
    public_name,
)
from jblast.cli.main import main
from jblast.constants import STANDARD_SOUND_SPEED
from jblast.registry import LAWS, Law, declared_scatter
from jblast.report.calculator.terminal import calculation_text
from jblast.scene import Air, Scene
from jblast.sensors.calculator import Question, calculate
from jblast.waves import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_pressure,
    wu_hao_air_arrival_time,
)

ROOT = Path(__file__).parents[2]
LAWS_PAGE = (ROOT / "docs/explanation/laws.md").read_text(encoding="utf-8")
CALCULATOR_PAGE = (ROOT / "docs/howto/calculate.md").read_text(encoding="utf-8")
DRY = Scene(air=Air(relative_humidity=0.0))


@pytest.fixture(scope="module")
def drawn():
    quantities = ("peak_overpressure_pa", "air_arrival_s", "shock_radius_m")
    return {quantity: panels(quantity) for quantity in quantities}


def test_the_kept_page_is_what_the_registry_gives():
    """Write it anew with `python -m calibration.laws`."""
    assert (RESULTS / "laws.md").read_text(encoding="utf-8") == laws_text()


def test_every_law_stands_on_the_page_under_its_quantity():
    sections = {
        match[1]: section
        for section in laws_text().split("\n## ")[1:]
        if (match := re.search(r"^`(\w+)`:", section, re.M))
    }
    assert set(sections) == {quantity for quantity, _ in LAWS}
    for (quantity, name), law in LAWS.items():
        row = f"| `{name}` | `{public_name(law)}` | {law.range} | {law.source} |"
        assert row in sections[quantity]


def test_a_law_that_nobody_can_import_is_refused():
    def hidden(slant_range):
        return slant_range

    law = Law("q", "none", hidden, "", "", hidden, declared_scatter(0.1, 0.1), "")
    with pytest.raises(ValueError, match=r"jblast\.waves has no hidden"):
        public_name(law)


def test_there_is_a_small_figure_for_each_quantity_and_no_other():
    named = {figure_name(law.quantity) for law in drawn_laws()}
    assert named == {file.name for file in RESULTS.glob("laws_*.png")}
    assert named == set(re.findall(r"\((\S+\.png)\)", laws_text()))
    assert max((RESULTS / name).stat().st_size for name in named) < 120_000


# --- what is drawn


@pytest.mark.slow
def test_every_law_is_drawn_and_only_where_it_has_a_set(drawn):
    for quantity, bursts in drawn.items():
        names = {name for curves in bursts.values() for name in curves}
        assert names >= {law.name for law in drawn_laws(quantity)}
    assert "swisdak" not in drawn["peak_overpressure_pa"]["free-air"]
    assert "kinney_graham" not in drawn["peak_overpressure_pa"]["surface"]
    assert "wu_hao" not in drawn["air_arrival_s"]["free-air"]


def test_curves_are_scaled_and_say_where_they_hold(drawn):
    # sound in the dry standard atmosphere is 340.294 m/s, the tables' 340.29
    for burst in BURSTS:
        ours = drawn["air_arrival_s"][burst]["kingery_bulmash"]
        one = np.asarray(
            kingery_bulmash_arrival_time(SCALED_DISTANCE, 1.0, burst=burst)
        )
        sound = SCALED_DISTANCE / STANDARD_SOUND_SPEED
        np.testing.assert_allclose(ours.value, one / sound, rtol=2e-5)
        ours = drawn["peak_overpressure_pa"][burst]["kingery_bulmash"]
        one = kingery_bulmash_pressure(SCALED_DISTANCE, 1.0, burst=burst)
        np.testing.assert_allclose(ours.value, one, rtol=1e-12)
        held = SCALED_DISTANCE[ours.valid]
        assert held.max() == pytest.approx(40.0, rel=0.03)  # a step of the grid
    ours = drawn["air_arrival_s"]["surface"]["wu_hao"].value
    distance = SCALED_DISTANCE * np.cbrt(MASS)
    time = wu_hao_air_arrival_time(distance, MASS, STANDARD_SOUND_SPEED)
    sound = distance / STANDARD_SOUND_SPEED
    np.testing.assert_allclose(ours, np.asarray(time) / sound, rtol=2e-5)


def test_radii_are_arrivals_read_the_other_way_round(drawn):
    radius = drawn["shock_radius_m"]["free-air"]["shock_kinematics"]
    slowness = drawn["air_arrival_s"]["free-air"]["shock_kinematics"].value
    arrival = slowness * SCALED_DISTANCE / STANDARD_SOUND_SPEED
    back = np.exp(
        np.interp(
            np.log(radius.value[radius.valid]),
            np.log(SCALED_DISTANCE),
            np.log(arrival),
        )
    )
    # straight lines in ln between points 2 % apart, there and back
    np.testing.assert_allclose(back, SCALED_TIME[radius.valid], rtol=1e-3)


def test_a_figure_names_each_law_beside_each_panel_it_is_in(drawn):
    bursts = drawn["peak_overpressure_pa"]
    figure = law_figure("peak_overpressure_pa", bursts)
    values, differences = figure.axes[:2], figure.axes[2:]
    for above, below, laws in zip(values, differences, bursts.values(), strict=True):
        assert {text.get_text() for text in above.texts} == set(laws)
        assert {text.get_text() for text in below.texts} == set(laws)
        assert below.get_ylabel() == "% above shock_kinematics"
    lowest = min(
        np.nanmin(np.asarray(line.get_ydata(), float)) for line in differences[1].lines
    )
    assert lowest == pytest.approx(-29.7, abs=0.5)  # Henrych, where its pieces meet


# --- what the manual says of it


def test_the_manual_names_the_page_and_shows_figures_that_exist():
    assert "](../../calibration/results/laws.md)" in LAWS_PAGE
    shown = re.findall(r"!\[[^]]+\]\((\S+)\)", LAWS_PAGE)
    assert len(shown) == 3
    assert all((ROOT / "docs/explanation" / name).is_file() for name in shown)


def test_the_manual_says_how_far_the_laws_lie_apart(drawn):
    found = {}
    between = (SCALED_DISTANCE >= 2.0) & (SCALED_DISTANCE <= 40.0)
    for quantity in ("peak_overpressure_pa", "air_arrival_s"):
        laws = drawn[quantity]["free-air"]
        against = laws["shock_kinematics"].value
        ratio = np.concatenate(
            [(law.value / against)[law.valid & between] for law in laws.values()]
        )
        found[quantity] = [
            abs(round(100 * (r - 1))) for r in (ratio.min(), ratio.max())
        ]
    said = " ".join(LAWS_PAGE.split())
    (said_apart,) = re.findall(
        r"peak pressures lie from (\d+) % below to (\d+) % above those of "
        r"`shock_kinematics`, the arrivals from (\d+) % below to (\d+) % above",
        said,
    )
    assert [int(n) for n in said_apart] == [n for pair in found.values() for n in pair]


def test_what_the_manual_prints_is_what_the_calculator_says(capsys):
    forward = Question(DRY, (20.0,), (15.0,))
    answer = calculate(DRY, *forward.rows())
    commands, *blocks = re.findall(r"^```\n(.*?)^```", CALCULATOR_PAGE, re.M | re.S)
    assert "--mass 15 --range 20" in commands
    assert "--mass 15 --overpressure 5kPa" in commands
    printed = []
    for words in (["--range", "20"], ["--overpressure", "5kPa"]):
        assert main(["calc", "--mass", "15", *words]) == 0
        printed.append(capsys.readouterr().out)
    printed.insert(1, calculation_text(forward, answer, None))
    for block, text in zip(blocks, printed, strict=True):
        for line in filter(lambda line: line.strip() != "...", block.splitlines()):
            start = line.removesuffix("...")
            assert any(said.startswith(start) for said in text.splitlines()), line


def test_the_python_in_the_manual_runs():
    (code,) = re.findall(r"^```python\n(.*?)^```", CALCULATOR_PAGE, re.M | re.S)
    names: dict = {}
    exec(code, names)
    rise = np.gradient(names["pressures"], names["ranges"])
    np.testing.assert_allclose(names["slopes"][1:-1], rise[1:-1], rtol=1e-3)
