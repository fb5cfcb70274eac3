"""Which plane wave of about the speed of sound is nearest to a measured slowness."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

STEPS = 100
"""Steps of the search; near the plane of the microphones it ends slowly."""
SMALL = 1e-13
"""A step that is smaller ends it [rad]."""


class Front(NamedTuple):
    """A plane front.

    Attributes:
        toward: Unit vector to its source: east, north, up.
        log_speed: ln of its speed over that of sound.
    """

    toward: Float[np.ndarray, "3"]
    log_speed: float


class PlaneWave(NamedTuple):
    """What an array measured of a plane wave.

    Attributes:
        information: Of the slowness, in the directions that the microphones span
            [m^2/s^2].
        slowness: Toward the source, in these directions [s/m].
        sound_speed: Expected speed [m/s].
        log_sd: Standard deviation of its ln.
    """

    information: Float[np.ndarray, "3 3"]
    slowness: Float[np.ndarray, "3"]
    sound_speed: float
    log_sd: float

    def axis(self) -> Float[np.ndarray, "3"]:
        """Return the direction in which most is known of the slowness."""
        return np.linalg.eigh(self.information)[1][:, -1]

    def normal(self) -> Float[np.ndarray, "3"]:
        """Return the direction in which least is known of it."""
        return np.linalg.eigh(self.information)[1][:, 0]

    def start(self) -> Front:
        """Return the slowness as measured, and what a speed leaves for the rest."""
        inside = self.slowness * self.sound_speed
        normal = self.normal()
        inside = inside - (inside @ normal) * normal
        rest = 1.0 - inside @ inside
        side = -1.0 if self.slowness @ normal < 0 else 1.0
        toward = inside + side * np.sqrt(max(rest, 1e-4)) * normal
        return Front(toward / np.linalg.norm(toward), 0.0)

    def mirrored(self, front: Front) -> Front:
        """Return a front from the other side of the plane of the microphones."""
        normal = self.normal()
        toward = front.toward - 2 * (front.toward @ normal) * normal
        return Front(toward, front.log_speed)

    def misfit(self, front: Front) -> float:
        """Return chi-squared of a front."""
        left = self._left(front)
        known = (front.log_speed / self.log_sd) ** 2 if self.log_sd else 0.0
        return float(left @ self.information @ left + known)

    def nearest(self, front: Front) -> Front:
        """Return the front of least chi-squared near one, by damped Gauss-Newton."""
        damping, misfit = 1e-3, self.misfit(front)
        for _ in range(STEPS):
            tangent = _tangent(front.toward)
            slope = self._slope(front, tangent)
            hessian = slope.T @ self.information @ slope
            gradient = slope.T @ self.information @ self._left(front)
            if self.log_sd:
                hessian[2, 2] += self.log_sd**-2
                gradient[2] += front.log_speed * self.log_sd**-2
            else:
                hessian[2], hessian[:, 2], gradient[2] = 0.0, 0.0, 0.0
            scale = damping * np.trace(hessian)
            step = -np.linalg.solve(hessian + scale * np.eye(3), gradient)
            turned = front.toward + tangent.T @ step[:2]
            tried = Front(turned / np.linalg.norm(turned), front.log_speed + step[2])
            if (less := self.misfit(tried)) <= misfit:
                front, misfit, damping = tried, less, max(damping / 5, 1e-15)
                if np.abs(step).max() < SMALL:
                    break
            else:
                damping *= 8
                if damping > 1e12:
                    break
        return front

    def covariance(self, front: Front) -> Float[np.ndarray, "2 2"]:
        """Return that of bearing and elevation [rad^2]; huge where nothing is known."""
        bearing, elevation = angles_of(front.toward)
        east, north = np.sin(bearing), np.cos(bearing)
        level, up = np.cos(elevation), np.sin(elevation)
        turn = np.array([[north * level, -east * level, 0.0],
                         [-east * up, -north * up, level]])  # fmt: skip
        slope = self._slope(front, turn)
        hessian = slope.T @ self.information @ slope
        if not self.log_sd:
            hessian = hessian[:2, :2]
        else:
            hessian[2, 2] += self.log_sd**-2
        least = 1e-12 * np.trace(hessian) * np.eye(len(hessian))
        return np.linalg.inv(hessian + least)[:2, :2]

    def _left(self, front: Front) -> np.ndarray:
        """Return by how much a front's slowness is off."""
        speed = self.sound_speed * np.exp(front.log_speed)
        return front.toward / speed - self.slowness

    def _slope(self, front: Front, turn: np.ndarray) -> np.ndarray:
        """Return the derivative of its slowness by two turns and ln speed."""
        speed = self.sound_speed * np.exp(front.log_speed)
        return np.vstack([turn, -front.toward]).T / speed


def angles_of(toward: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2"]:
    """Return bearing, clockwise from north, and elevation of a direction [rad]."""
    level = np.hypot(toward[0], toward[1])
    bearing = np.arctan2(toward[0], toward[1]) % (2 * np.pi)
    return np.array([bearing, np.arctan2(toward[2], level)])


def _tangent(toward: np.ndarray) -> np.ndarray:
    """Return two unit vectors across a direction and across each other."""
    least = np.eye(3)[np.argmin(np.abs(toward))]
    first = np.cross(toward, least)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(toward, first)])
