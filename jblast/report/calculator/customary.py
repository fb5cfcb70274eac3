"""What the laws' ranges and notes say in m/kg^(1/3), in ft/lb^(1/3) for who asks so.

The ranges of laws are words, as their sources give them; the numbers before a scaled
distance are converted, to four digits, and nothing else of them is touched.
"""

import re

from jblast.report.numbers import System, significant, unit_for

NUMBER = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"
SCALED = re.compile(rf"((?:{NUMBER}|free-air|to|[() ])+) m/(kg|kt)\^\(1/3\)")
"""Numbers, perhaps of two curve sets, up to their unit: 0.0674 (free-air 0.0531) to 40
m/kg^(1/3)."""
OF_ROOT = re.compile(rf"({NUMBER}) sqrt\(Q\) m\b")
"""Of what grows as the root of the charge's mass Q."""


def scaled_in(text: str, system: System) -> str:
    """Return words about scaled distances in a system of units.

    A kiloton stays one.

    Args:
        text: As the laws have them.
        system: "si" leaves them as they are.
    """
    if system == "si":
        return text
    foot, pound = (unit_for(name, 1.0, system=system).size for name in ("_m", "_kg"))

    def scaled(found: re.Match[str]) -> str:
        of, factor = found[2], 1.0 / foot
        if of == "kg":
            of, factor = "lb", pound ** (1 / 3) / foot
        numbers = re.sub(NUMBER, lambda n: _times(n[0], factor), found[1])
        return f"{numbers} ft/{of}^(1/3)"

    def of_root(found: re.Match[str]) -> str:
        return f"{_times(found[1], pound**0.5 / foot)} sqrt(Q in lb) ft"

    return OF_ROOT.sub(of_root, SCALED.sub(scaled, text))


def _times(number: str, factor: float) -> str:
    """Return a written number times a factor, to four digits."""
    text = significant(float(number) * factor, 4)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text
