"""What gains are worth that were tuned by gradient through blasts, for three vehicles.

python -m calibration.tuned_gains --out FIGURE.png

Each vehicle holds its place 5 m up in calm air while 0.2 to 2 kg of TNT go off on the
ground, anywhere within 5 m to the east, west, north and south. Its gains are tuned by
32 such blasts, within margins of 6 dB and 35 degrees, and judged by 200 others.
"""

import argparse

from jblast.cli.jax_start import start_jax
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import new_figure, titled
from jblast.report.gains.answer import gains_answer
from jblast.report.gains.figure import cut_words, draw_each, draw_middle
from jblast.report.gains.text import gains_text
from jblast.scene.reader.scene import scene_from_document
from jblast.study.gains.records import TunedGains
from jblast.study.gains.tune import tune_gains

NAMES = ("iris", "hummingbird", "crazyflie")
SIDE = {"uniform": [-5.0, 5.0]}
CHARGE = {
    "mass_kg": {"uniform": [0.2, 2.0]},
    "position_m": [SIDE, SIDE, 0.0],
    "time_s": 0.5,
}


def tuned(model: str) -> TunedGains:
    """Tune the gains of a vehicle.

    Args:
        model: Its name.
    """
    vehicle = {
        "model": model,
        "position_m": [0.0, 0.0, 5.0],
        "control": {"integral": True},
    }
    document = {"charge": CHARGE, "vehicle": vehicle}
    return tune_gains(scene_from_document(document, "scene"))


def main() -> None:
    """Tune, print what came of it, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="FIGURE.png")
    parser.add_argument("--only", choices=NAMES, help="one vehicle (default: all)")
    asked = parser.parse_args()
    start_jax(quick=True)
    names = (asked.only,) if asked.only else NAMES
    figure = new_figure(4.4 * len(names), 8.0)
    axes = figure.subplots(2, len(names), squeeze=False)
    for name, (each, over_time) in zip(names, axes.T, strict=True):
        found = tuned(name)
        answer = gains_answer(found, "")
        print(f"# {name}: {cut_words(found)}")
        print(gains_text(answer), flush=True)
        draw_each(each, found)
        draw_middle(over_time, found)
        titled(each, name.capitalize(), cut_words(found))
        titled(over_time, "One of them", "of median peak before")
    write_figure(figure, asked.out)


if __name__ == "__main__":
    main()
