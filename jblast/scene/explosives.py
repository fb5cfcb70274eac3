"""TNT equivalence: how much TNT would make the same blast as a kilogram of it.

A mass factor holds for one quantity over some range of distances; handbooks print one
for pressure and one for impulse. `Quantity.tnt_factor` says which holds for what.
"""

from dataclasses import dataclass

from jblast.errors import InputError, nearest, shown
from jblast.quantity_table import quantity_named

IATG = "UN IATG 01.80, read in one port of its calculator"
UFC = "UFC 3-340-02, from memory"
HEAT = "ratio of heats of detonation, one port"
C2N = "half of the energy goes into the air blast (MultiPEM: C2N = 2)"


@dataclass(frozen=True)
class Explosive:
    """What a kilogram of an explosive is worth in TNT.

    Attributes:
        pressure: Mass factor for pressures, shock speeds and arrivals [-].
        impulse: Mass factor for impulses and durations [-].
        source: Where the factors come from.
        energy: Mass factor for the energy of a strong shock [-].
    """

    pressure: float
    impulse: float
    source: str
    energy: float


def _by_mass(pressure: float, impulse: float, source: str = IATG) -> Explosive:
    return Explosive(pressure, impulse, source, energy=pressure)


EXPLOSIVES: dict[str, Explosive] = {
    "TNT": _by_mass(1.0, 1.0),
    "Amatol": _by_mass(0.99, 0.98),
    "ANFO": _by_mass(0.82, 0.82, UFC),
    "C3": _by_mass(1.08, 1.01),
    "C4": _by_mass(1.37, 1.19),  # the port misprints the second as 0.19
    "Comp B": _by_mass(1.11, 0.98),
    "Cyclotol 60/40": _by_mass(1.14, 1.09),
    "HMX": _by_mass(1.02, 1.03),
    "Octol 75/25": _by_mass(1.06, 1.06),
    "PETN": _by_mass(1.27, 1.11),
    "RDX": _by_mass(1.14, 1.09),
    "Tetryl": _by_mass(1.07, 1.05),
    "Tritonal": _by_mass(1.07, 0.96),
    "dynamite 60 %": _by_mass(0.6, 0.6, HEAT),
    "nitroglycerin": _by_mass(1.481, 1.481, HEAT),
    "Semtex": _by_mass(1.25, 1.25, HEAT),
    # The mass is the yield: 1 kt is 1e6 kg. The fireball's strong shock has it all.
    "nuclear": Explosive(0.5, 0.5, C2N, energy=1.0),
}
"""By name. "nuclear" takes the yield in kilograms of TNT for its mass."""


def tnt_factor(explosive: str, quantity: str) -> float:
    """Return the mass of TNT that makes the same of a quantity as 1 kg [-].

    Args:
        explosive: A name of `EXPLOSIVES`.
        quantity: As in `QUANTITIES`.
    """
    known = quantity_named(quantity)
    return getattr(EXPLOSIVES[explosive], known.tnt_factor if known else "pressure")


def explosive_named(name: str, where: str) -> str:
    """Return an explosive's name as `EXPLOSIVES` writes it, however it came.

    Raises:
        InputError: It is none of them; the message lists all.
    """

    def plain(text: str) -> str:
        return "".join(c for c in text.lower() if c.isalnum())

    for known in EXPLOSIVES:
        if plain(known) == plain(name):
            return known
    raise InputError(
        f"{where}: unknown explosive {shown(name)}{nearest(name, EXPLOSIVES)}; "
        f"expected one of {', '.join(EXPLOSIVES)}"
    )
