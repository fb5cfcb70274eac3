"""What do real gauges read, what do the laws say, and what explains the rest?

    python -m calibration.gauges > calibration/results/gauges.txt

1. A side-on gauge 2 m from 200 g, against Kingery and Bulmash (`gauge_200g.py`;
   drawn by `python -m calibration.gauge_200g`).
2. Ford's shots inside Z = 40, against Kingery and Bulmash (`gauge_ford.py`).
3. Infrasound of HRR-5 at hundreds of kilometres, against sound and wind
   (`gauge_hrr5.py`).

Each names its data, whose provenance stands at their head. No random numbers. Every
number of the text is computed; which words stand around it was decided on seeing them,
and `tests/calibration/gauges` fails where they no longer go together.
"""

from calibration.gauge_200g import text_200g
from calibration.gauge_ford import ford_text
from calibration.gauge_hrr5 import hrr5_text
from jblast.cli.jax_start import start_jax


def gauges_text() -> str:
    """Return everything that is printed."""
    return "\n\n\n".join((text_200g(), ford_text(), hrr5_text()))


def main() -> None:
    """Print it."""
    start_jax()
    print(gauges_text())


if __name__ == "__main__":
    main()
