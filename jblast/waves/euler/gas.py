r"""Equations of state: what the solver asks of a gas, and the ideal gas.

The solver knows a gas by four answers alone, so another equation of state (JWL for the
products of TNT) is another class like `IdealGas` in a file of its own.
"""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.types import as_float_array


class Gas(eqx.Module):
    """What the solver asks of a gas; densities in kg/m3, pressures in Pa."""

    def of_cells(self, cells: slice | tuple[int, ...]) -> "Gas":
        """Return the gas of some of the cells: itself, if it is the same in all."""
        del cells
        return self

    @abstractmethod
    def pressure(
        self, density: Float[Array, "..."], energy: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the pressure of an internal energy a volume [J/m3]."""

    @abstractmethod
    def energy(
        self, density: Float[Array, "..."], pressure: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the internal energy a volume [J/m3] of a pressure."""

    @abstractmethod
    def stiffness(
        self, density: Float[Array, "..."], pressure: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        r"""Return the isentropic bulk modulus $\rho c^2$ [Pa]."""

    @abstractmethod
    def shock_slope(self) -> Float[Array, "..."]:
        r"""Return $s$ of a shock: $D \approx c + 2s\,\Delta u$ if it is strong [-]."""


class IdealGas(Gas):
    r"""An ideal gas: $p = (\gamma-1)\,\rho e$, $\rho c^2 = \gamma p$.

    Attributes:
        gamma: Ratio of specific heats $\gamma$ [-].
    """

    gamma: Float[Array, "..."] = eqx.field(
        converter=as_float_array, default=AIR_HEAT_CAPACITY_RATIO
    )

    def pressure(self, density, energy):
        """Return the pressure [Pa]."""
        del density
        return (self.gamma - 1.0) * energy

    def energy(self, density, pressure):
        """Return the internal energy a volume [J/m3]."""
        del density
        return pressure / (self.gamma - 1.0)

    def stiffness(self, density, pressure):
        r"""Return $\rho c^2$ [Pa]."""
        del density
        return self.gamma * pressure

    def shock_slope(self):
        r"""Return $(\gamma+1)/4$.

        A shock that changes the velocity by $\Delta u$ runs into gas at rest with
        $D = s\Delta u + \sqrt{c^2 + (s\Delta u)^2}$ exactly.
        """
        return (self.gamma + 1.0) / 4.0
