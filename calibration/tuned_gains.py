"""What gains are worth that were tuned by gradient through blasts, for three vehicles.

python -m calibration.tuned_gains --out FIGURE.png --workers 4

Each vehicle holds its place 5 m up in calm air while 0.2 to 2 kg of TNT go off on the
ground, anywhere within 5 m to the east, west, north and south. Its gains are tuned by
32 such blasts, within margins of 6 dB and 35 degrees, and judged by 200 others. The
Crazyflie's motors lag by 0.072 s; it is tuned as it is, and once more with motors that
may be led, by three at most.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from jblast.cli.jax_start import start_jax
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import new_figure, titled
from jblast.report.gain_files import cut_words, draw_each, draw_middle
from jblast.report.gains import gains_answer, gains_text
from jblast.scene.reader.scene import scene_from_document
from jblast.study.gains import TunedGains, Wish, tune_gains

CASES = (("iris", 1.0), ("hummingbird", 1.0), ("crazyflie", 1.0), ("crazyflie", 3.0))
"""Vehicles, and by how much their motors may be led."""
SIDE = {"uniform": [-5.0, 5.0]}
CHARGE = {
    "mass_kg": {"uniform": [0.2, 2.0]},
    "position_m": [SIDE, SIDE, 0.0],
    "time_s": 0.5,
}


def tuned(model: str, motor_lead: float) -> TunedGains:
    """Tune the gains of a vehicle.

    Args:
        model: Its name.
        motor_lead: Most by which its motors' lag may be shortened.
    """
    start_jax(quick=True)
    vehicle = {
        "model": model,
        "position_m": [0.0, 0.0, 5.0],
        "control": {"integral": True},
    }
    document = {"charge": CHARGE, "vehicle": vehicle}
    wish = Wish(motor_lead=motor_lead)
    return tune_gains(scene_from_document(document, "scene"), wish)


def main() -> None:
    """Tune, print what came of it, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="FIGURE.png")
    parser.add_argument(
        "--only", type=int, metavar="N", help="one of the cases, from 0 (default: all)"
    )
    parser.add_argument("--workers", type=int, default=1, metavar="N")
    asked = parser.parse_args()
    cases = CASES if asked.only is None else CASES[asked.only : asked.only + 1]
    figure = new_figure(4.4 * len(cases), 8.0)
    axes = figure.subplots(2, len(cases), squeeze=False)
    with ProcessPoolExecutor(asked.workers, get_context("spawn")) as workers:
        answers = list(workers.map(tuned, *zip(*cases, strict=True)))
    for (model, lead), found, (each, over_time) in zip(
        cases, answers, axes.T, strict=True
    ):
        name = model if lead == 1 else f"{model}, led"
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
