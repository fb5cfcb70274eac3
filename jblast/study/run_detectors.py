"""Detectors of a run: each microphone and the camera searched as packets come.

A microphone is searched with the bank of pulses and the test of form
(`signals.SoundWatch`). The saturated pixels of the camera are searched for flashes
(`signals.flash.FlashWatch`): a fireball is far brighter than anything in daylight for
which a camera is exposed, and the edges of ground, sky and smoke, which move as a
vehicle turns, are not. A detection is attributed to the blast whose true arrival at the
sensor is nearest, by air or through the ground, within a tolerance. Otherwise it is a
false alarm.
"""

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np

from jblast.scene import Camera, Instrument, Scene
from jblast.sensors.camera.geometry import (
    CameraPath,
    carried_camera,
    project,
    unproject,
)
from jblast.signals.detection import Detection
from jblast.signals.flash import Flash, FlashWatch
from jblast.signals.flash.fireball import Direction, direction_of, growth
from jblast.signals.flash.watch import DRIFT, MIN_PIXELS
from jblast.signals.matched_filter import FALSE_ALARMS_PER_HOUR
from jblast.signals.sound_watch import LEAST_NOISE, SoundWatch
from jblast.signals.templates import bank_of_pulses
from jblast.study.running import Frames, Packet, RunDetection, Samples
from jblast.world import Arrivals
from jblast.world.drawn import CAMERA

SOUND_TOLERANCE_S = 0.02
"""Largest difference from the true arrival of sound [s], declared: fronts are detected
to a millisecond; a gentle front or a reflection from the ground may be louder."""
FLASH_TOLERANCE_S = 0.05
"""The same for first light [s], declared: the fireball may be hidden or too small for a
few frames at 100 frames a second."""
LEAST_RATE_HZ = 100.0
"""Smallest sampling rate of a searched microphone [Hz]: the longest pulses have nine
samples within their positive phase."""
LEAST_RADIUS_PX = 2.0
"""Radius of the smallest fireball that is detected in slow frames [px]: below it single
pixels, as of glints, would be reported. At 1,000 frames a second it is 5 px."""
SMALLEST = math.log1p(math.pi * LEAST_RADIUS_PX**2 / MIN_PIXELS) - 2 * DRIFT
"""Threshold of flashes: the statistic of such a fireball, if its first frame shows it
grown and it stays for another."""


class RunDetectors:
    """All detectors of a run.

    The vehicle's path decides the arrivals at mounted sensors: `arrivals` may be
    replaced as the run advances.

    Attributes:
        arrivals: True arrivals.
    """

    def __init__(
        self,
        scene: Scene,
        arrivals: Arrivals,
        shots: Sequence[str],
        *,
        path: CameraPath | None = None,
        false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    ):
        """Create the detectors.

        Args:
            scene: Sensors and camera.
            arrivals: True arrivals.
            shots: Names of the blasts, in order of the arrivals.
            path: Path of the vehicle that carries the camera; None: flashes of a
                carried camera have no direction.
            false_alarms_per_hour: Mean rate of false alarms of each microphone [1/h].
        """
        self.arrivals, self._shots, self._rate = arrivals, shots, false_alarms_per_hour
        self._instruments = {
            one.name: one.instrument
            for one in scene.sensors
            if one.kind == "microphone"
        }
        self._camera, self._path = scene.camera, path
        self._bank = cache(bank_of_pulses)
        # searches with the middles of their first samples
        self._ears: dict[str, tuple[SoundWatch, float]] = {}
        # a broken microphone has no more samples
        self._ended: set[str] = set()
        self._eye: FlashWatch | None = None
        self._early: list[Frames] = []
        self._now_s = 0.0
        # microphones are searched beside the camera, on other cores
        self._pool = ThreadPoolExecutor(max(1, len(self._instruments)))

    def take(self, packet: Packet) -> tuple[RunDetection, ...]:
        """Process the next packet; return the detections that it completes."""
        self._now_s = packet.end_s
        heard = [
            (name, samples)
            for name, samples in packet.samples.items()
            if name in self._instruments and samples.rate_hz >= LEAST_RATE_HZ
        ]
        for name, samples in heard:
            if name not in self._ears:
                watch = SoundWatch(
                    self._bank(samples.rate_hz),
                    samples.rate_hz,
                    false_alarms_per_hour=self._rate,
                    least_noise=_least_noise(self._instruments[name]),
                )
                # a sample is the mean over its interval
                self._ears[name] = watch, samples.start_s + 0.5 / samples.rate_hz
        searches = [self._pool.submit(self._heard, *one) for one in heard]
        found = [] if packet.frames is None else self._looked(packet.frames)
        for search in searches:
            found += search.result()
        return tuple(sorted(found, key=lambda one: one.time_s))

    def finish(self) -> tuple[RunDetection, ...]:
        """Return the remaining detections at the end of the run."""
        self._pool.shutdown()
        found: list[RunDetection] = []
        for name, (watch, _) in self._ears.items():
            if name not in self._ended:
                found += self._sounds(name, watch.finish())
        if self._eye is not None:
            found += self._seen(self._eye.finish())
        return tuple(sorted(found, key=lambda one: one.time_s))

    def _heard(self, name: str, samples: Samples) -> list[RunDetection]:
        if name in self._ended:
            return []
        watch, _ = self._ears[name]
        values = np.asarray(samples.values[:, 0], float)
        broken = np.flatnonzero(~np.isfinite(values))
        whole = values[: broken[0]] if broken.size else values
        found = self._sounds(name, watch.push(whole))
        if broken.size:
            self._ended.add(name)
            found += self._sounds(name, watch.finish())
        return found

    def _sounds(self, name: str, found: Iterable[Detection]) -> list[RunDetection]:
        """Return the detections of the last push to a microphone's search."""
        _, start_s = self._ears[name]
        return [
            self._detection(
                name, "sound", start_s + one.time_s, one.sigma_s, one.statistic
            )
            for one in found
            if one.is_blast
        ]

    def _looked(self, frames: Frames) -> list[RunDetection]:
        """Search frames, as soon as two give their rate."""
        self._early.append(frames)
        times = np.concatenate([part.time_s for part in self._early])
        if self._camera is None or (self._eye is None and times.size < 2):
            return []
        # red is the brightest colour of a fire
        images = [
            (image[..., 0] == 255).astype(np.float32)
            for part in self._early
            for image in part.images
        ]
        exposure_s = float(self._camera.exposure_s)
        if self._eye is None:
            hz = (times.size - 1) / float(times[-1] - times[0])
            self._eye = FlashWatch(hz, SMALLEST, exposure_s=exposure_s)
        self._early = []
        return self._seen(self._eye.push(times + 0.5 * exposure_s, images))

    def _seen(self, flashes: Iterable[Flash]) -> list[RunDetection]:
        return [
            replace(
                self._detection(
                    CAMERA,
                    "flash",
                    one.growth.time_s,
                    one.growth.sigma_s,
                    one.statistic,
                ),
                direction=self.direction(one),
            )
            for one in flashes
        ]

    def direction(self, flash: Flash) -> Direction | None:
        """Return the direction of a burst from the camera at first light.

        It is unknown if an edge of the image may cut the first silhouette, so that its
        middle is not that of the fireball.
        """
        camera, path, one = self._camera, self._path, flash.silhouettes[0]
        if camera is None:
            return None
        size = np.array([camera.width, camera.height])
        middle = np.array([one.x_px, one.y_px])
        if np.minimum(middle, size - 1 - middle).min() < one.radius_px:
            return None
        if not camera.mount:
            return direction_of(camera, flash.growth)
        if path is None:
            return None

        def at(time_s: float) -> Camera:
            return carried_camera(camera, path, jnp.asarray(time_s))

        # all silhouettes as seen by the camera at first light, though it turns
        first, turned = at(flash.growth.time_s), []
        for one in flash.silhouettes:
            ray = unproject(at(one.time_s), np.array([one.x_px, one.y_px]))
            place = np.asarray(first.position) + np.asarray(ray)
            x_px, y_px = np.asarray(project(first, place).pixel).tolist()
            turned.append(one._replace(x_px=x_px, y_px=y_px))
        return direction_of(first, growth(turned, flash.growth.time_s))

    def _detection(
        self, sensor: str, kind: str, time_s: float, sigma_s: float, statistic: float
    ) -> RunDetection:
        """Return a detection with the blast of the nearest true arrival."""
        waves, tolerance_s = ("air_arrival_s", "ground_arrival_s"), SOUND_TOLERANCE_S
        if kind == "flash":
            waves, tolerance_s = ("flash_time_s",), FLASH_TOLERANCE_S
        row = self.arrivals.entities.index(sensor)
        times = np.stack([self.arrivals.times_s[wave][row] for wave in waves])
        away = np.nan_to_num(np.abs(times - time_s), nan=math.inf)
        shot, true_s = "", math.nan
        if away.size and away.min() <= tolerance_s:
            wave, nth = divmod(int(np.argmin(away)), away.shape[1])
            shot, true_s = self._shots[nth], float(times[wave, nth])
        return RunDetection(
            sensor, kind, time_s, sigma_s, self._now_s, statistic, shot, true_s
        )


def _least_noise(instrument: Instrument | None) -> float:
    """Return the smallest noise of a microphone: of rounding, or of hearing [Pa]."""
    if instrument is None or instrument.bits is None or instrument.full_scale is None:
        return LEAST_NOISE
    step = 2 * float(instrument.full_scale) / 2**instrument.bits
    return max(LEAST_NOISE, step / math.sqrt(12))
