"""Whether figures that README and the manual quote are those of kept files.

    python -m calibration.figures

`figures.csv` has a row for each: the page, its words with the number in braces, and
where the number is kept: the file, words of a line above (`under`, or nothing), the
words that the line has, and which of the numbers after these words. That number, or e
to its power where `form` is exp, times `times`, has to be the one printed, rounded as
the page rounds it. A sentence that has changed has to be changed here, too.
"""

import csv
import math
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIST = Path(__file__).with_suffix(".csv")
NUMBER = re.compile(r"[-+]?(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[-+]?\d+)?")
FORMS = {"": lambda x: x, "exp": math.exp}


def faults() -> list[str]:
    """Return a line for each figure that is not what is kept."""
    with LIST.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [
        f"{LIST.name}: line {line}: {fault}"
        for line, row in enumerate(rows, start=2)
        for fault in [fault_of(row)]
        if fault
    ]


def fault_of(row: dict[str, str]) -> str:
    """Say what is wrong with one figure; nothing if it is right."""
    page = " ".join((ROOT / row["page"]).read_text("utf-8").split())
    found = re.fullmatch(r"(.*)\{(.+)\}(.*)", row["words"])
    if not found:
        return f"expected words with one number in braces, got {row['words']!r}"
    if "".join(found.groups()) not in page:
        return f"{row['page']} does not say {''.join(found.groups())!r}"
    kept = kept_number(row)
    if isinstance(kept, str):
        return kept
    number, half = printed(found[2])
    value = float(row["times"] or 1) * FORMS[row["form"]](kept)
    if abs(value - number) <= half:
        return ""
    return (
        f"{row['page']} has {found[2]} in {''.join(found.groups())!r}, but "
        f"{row['file']} has {value:.6g} in {row['row']!r}"
    )


def kept_number(row: dict[str, str]) -> float | str:
    """Return the number a file keeps, or what is missing there."""
    lines = iter((ROOT / row["file"]).read_text("utf-8").splitlines())
    if row["under"] and not any(row["under"] in line for line in lines):
        return f"{row['file']} has no line with {row['under']!r}"
    line = next((line for line in lines if row["row"] in line), None)
    if line is None:
        return f"{row['file']} has no line with {row['row']!r}"
    numbers = NUMBER.findall(line.partition(row["row"])[2])
    column = int(row["column"])
    if not 1 <= column <= len(numbers):
        return f"{row['file']}: {row['row']!r} has {len(numbers)} numbers, not {column}"
    return float(numbers[column - 1].replace(",", ""))


def printed(text: str) -> tuple[float, float]:
    """Return a printed number, and half a unit of its last digit."""
    mantissa, _, power = text.replace(",", "").partition("e")
    whole, _, after = mantissa.partition(".")
    # zeros at the end of a whole number may be rounding's, past its second digit
    kept = max(len(whole.rstrip("0")), min(2, len(whole)))
    digits = len(after) or kept - len(whole)
    unit = 10.0 ** (int(power or 0) - digits)
    return float(mantissa) * 10.0 ** int(power or 0), 0.5 * unit * (1 + 1e-6)


if __name__ == "__main__":
    wrong = faults()
    print(*wrong, sep="\n", end="\n" * bool(wrong))
    sys.exit(bool(wrong))
