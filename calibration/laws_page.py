"""Which laws there are, where they hold, and how far they lie apart.

    python -m calibration.laws_page

Writes calibration/results/laws.md and a figure for each quantity beside it. Every word
of the tables comes from the registry.
"""

import io
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

import jblast.sensors
import jblast.waves
from calibration.laws_curves import drawn_laws, panels
from calibration.laws_figure import law_figure
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES
from jblast.registry import LAWS, Law
from jblast.report.calculator.figures import NOT_DRAWN
from jblast.report.words import capitalised, quantity_words

RESULTS = Path(__file__).parent / "results"
DPI = 120
HEAD = """# The laws

Written by `python -m calibration.laws_page` from the registry, `jblast/registry.py`.

Z is the scaled distance R/W^(1/3) for W kilograms of TNT at sea level. The figures are
for dry air at 15 °C and 101325 Pa; times and impulses are divided by W^(1/3), arrivals
by the time that sound, or a P wave in granite, takes. Only Wu and Hao's laws and what
the air absorbs in `weak_shock_iso` are no functions of Z: they are drawn for 15 kg, the
absorption for 50 % relative humidity. Ford's are drawn for a charge on the ground,
Sedov's for a ratio of specific heats of 1.4. A law without a set for the other burst is
missing there. The lower panels compare laws where both hold, and are cut off at 45 %,
at 15 % for arrivals and shock speeds: near the charge the laws of nuclear shots and of
point sources, whose own mass is nothing, are far from those of TNT.

A law is `jblast.waves.FUNCTION`, of a jolt `jblast.sensors.FUNCTION`; its scatter is
one standard deviation of what a whole shot shares, and of each record.
"""


def laws_text() -> str:
    """Return the page."""
    order = (*QUANTITIES, *DERIVED_QUANTITIES)
    parts = [HEAD]
    for quantity, one in (QUANTITIES | DERIVED_QUANTITIES).items():
        laws = sorted(
            (law for law in LAWS.values() if law.quantity == quantity),
            key=lambda law: law.name,
        )
        if laws:
            parts.append(_section(quantity, one.meaning, laws))
    unknown = {quantity for quantity, _ in LAWS} - set(order)
    assert not unknown, f"quantities.py has no {unknown}"
    return "\n".join(parts)


def figure_name(quantity: str) -> str:
    """Return the file of a quantity's figure."""
    return f"laws_{quantity}.png"


def public_name(law: Law) -> str:
    """Return what a law is called in `jblast.waves`, of a vehicle in `jblast.sensors`.

    Raises:
        ValueError: It is not re-exported there.
    """
    name = law.function.__name__
    for each in (name, f"{law.name}_{name}"):  # laws with a calibration are closures
        if hasattr(jblast.waves, each) or hasattr(jblast.sensors, each):
            return each
    raise ValueError(f"{law.name}, {law.quantity}: jblast.waves has no {name}")


def _section(quantity: str, meaning: str, laws: list[Law]) -> str:
    title = capitalised(quantity_words(quantity))
    lines = [f"## {title}", "", f"`{quantity}`: {meaning}.", ""]
    if quantity not in NOT_DRAWN:
        lines += [f"![{title} by every law]({figure_name(quantity)})", ""]
    lines += ["| law | function | range | source | scatter |", "|---|---|---|---|---|"]
    lines += [
        f"| `{law.name}` | `{public_name(law)}` | {law.range} | {law.source} | "
        f"{law.scatter_words().removeprefix('scatter ')} |"
        for law in laws
    ]
    return "\n".join(lines) + "\n"


def _save(figure: Figure, file: Path) -> None:
    """Write a figure in few colours: a third of the bytes."""
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=DPI)
    image = Image.open(drawn).convert("RGB")
    image.quantize(256, dither=Image.Dither.NONE).save(file, optimize=True)


def main() -> None:
    """Write it."""
    start_jax()
    for quantity in dict.fromkeys(law.quantity for law in drawn_laws()):
        file = RESULTS / figure_name(quantity)
        _save(law_figure(quantity, panels(quantity)), file)
        print(f"wrote {file.name}, {file.stat().st_size / 1e3:.0f} kB")
    write_text(RESULTS / "laws.md", laws_text())
    print("wrote laws.md")


if __name__ == "__main__":
    main()
