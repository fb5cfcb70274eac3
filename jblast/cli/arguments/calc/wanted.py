"""Which quantity and which law alone `jblast calc` is asked for."""

import argparse

from jblast.cli.arguments.calc.options import MEASURED
from jblast.errors import InputError, nearest, shown
from jblast.quantity_table import QUANTITIES
from jblast.sensors.calculator.combined import COMBINATIONS
from jblast.sensors.calculator.forward import calculated_laws


def wanted(asked: argparse.Namespace) -> tuple[str, str]:
    """Return the quantity and the law that alone are asked for; "" leaves it open.

    Raises:
        InputError: One is unknown, or they do not go together.
    """
    measured = [
        name for name in MEASURED if getattr(asked, name.replace("-", "_")) is not None
    ]
    quantity, law = asked.quantity or "", asked.law or ""
    if quantity and measured:
        raise InputError(
            f"--quantity: expected it beside --mass and --range; with --{measured[0]} "
            "it is the range or the mass that is asked for"
        )
    laws = calculated_laws()
    known = {one.quantity for one in laws} | set(COMBINATIONS)
    quantity = MEASURED.get(quantity, (quantity, ""))[0]
    if quantity and quantity not in known:
        names = [name for name in QUANTITIES if name in known]
        names += sorted(known - set(names))
        raise InputError(
            f"--quantity: expected one of {', '.join(names)}, or "
            f"{', '.join(MEASURED)}; got {shown(quantity)}{nearest(quantity, known)}"
        )
    of = MEASURED[measured[0]][0] if measured else quantity
    parts = COMBINATIONS[of].parts if of in COMBINATIONS else (of,)
    names = sorted({one.name for one in laws if not of or one.quantity in parts})
    if law and law not in names:
        raise InputError(
            f"--law: expected one of {', '.join(names)}; got {shown(law)}"
            f"{nearest(law, names)}"
        )
    return quantity, law
