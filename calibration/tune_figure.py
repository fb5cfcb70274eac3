"""What does a tuning look like? A microphone's record (`tune_round_trip`).

    python -m calibration.tune_figure

writes calibration/results/tune.png.
"""

from pathlib import Path

from calibration.tune_round_trip import CASES
from jblast.report.figure_files import write_figure
from jblast.report.tune_files import tune_figure

FIGURE = Path(__file__).parent / "results" / "tune.png"


def main() -> None:
    """Tune, draw, and keep."""
    case = CASES["air, filter and noise"]
    tuned, _ = case.tuned(case, 0)
    write_figure(tune_figure(tuned), FIGURE)


if __name__ == "__main__":
    main()
