"""Live view of a run with Rerun: a scene, pictures and plots on the clock of the run.

`Viewer` is a subscriber of a run. It writes a recording (.rrd), serves it to a browser,
or both. Data are reduced to the resolution of a screen, so that the file of a run of
minutes is small: a plot has the least and the greatest sample of each column, and
pictures are compressed. Each packet adds 1.2 kB of metadata per plot, so that packets
should not be much shorter than 0.2 s. All data depend only on the packets: the
recording has no clock but that of the run.
"""

import io
import math
import os
import socket
import sys
import threading
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from jblast.errors import InputError, needed
from jblast.scene import SENSOR_KINDS, Camera, Charge, Scene
from jblast.study.running import CameraEvents, Motion, Packet, RunDetection
from jblast.waves.fireball import LARGEST_RADIUS

CLOCK = "time"
"""The only timeline: the clock of the run."""
WINDOW_S = 10.0
"""Length of the time axes [s]: a vehicle recovers within it."""
COLUMNS_HZ = 200.0
"""Columns of a plot in a second: 2,000 in a window, about one a pixel."""
SHOWN_HZ, POSES_HZ = 20.0, 50.0
"""Pictures and shock fronts in a second, which appear continuous; poses of the vehicle,
which no viewer interpolates."""
SPECTRA_S, WINDOWED_S = 5.0, 0.04
"""Length of a spectrogram, and about that of its windows [s], which resolve 25 Hz."""
BANDS, LOWEST_HZ = 160, 20.0
"""Rows of a spectrogram: equal steps of log frequency up to half the sample rate."""
REFERENCE_PA, LEVELS_DB = 20e-6, (20.0, 120.0)
"""Reference of sound levels [Pa], and those of the darkest and brightest colours: from
quiet air to a blast's shock."""
QUALITY = 80
"""Quality of JPEG pictures: about half the size of 90."""
NEAR_M = 50.0
"""Radius to which all shock fronts are drawn [m]; beyond, to the farthest entity."""
BLUE, ORANGE, GREEN = (86, 180, 233), (230, 159, 0), (0, 158, 115)
RED, GREY = (213, 94, 0), (150, 150, 150)
FLIGHT = ("force/east", "force/north", "force/up", "torque/x", "torque/y", "torque/z")
"""Plots of the vehicle with three components."""
COLOURS = (ORANGE, GREEN, BLUE)
"""Colours of components."""
EVENT_COLUMNS = 320
"""Largest width of pictures of camera events [px]."""
EVENT_COLOURS = (*GREY, *BLUE, *RED)
"""Palette of pictures of camera events: none, darker, brighter."""


class Viewer:
    """Subscriber of a run that shows it in a browser, in a file, or in both.

    Attributes:
        address: Address for browsers on this computer; "" if the run is not served.
    """

    def __init__(
        self,
        *,
        scene: Scene,
        sound_speed_m_s: float,
        recording_id: str,
        save: Path | None = None,
        live: bool = False,
    ):
        """Open the file and the server, and show all that does not move.

        Args:
            scene: The scene, with all charges.
            sound_speed_m_s: Speed of the shock fronts in the scene.
            recording_id: Name of the run in viewers; equal for equal runs.
            save: File to write (.rrd).
            live: Serve the run to browsers on this computer, and open one if there is
                a display.

        Raises:
            InputError: Rerun is not installed, or the file cannot be created.
        """
        self._rr = needed("rerun", "viewer", "viewer", "a run is shown")
        self._scene, self._sound_speed = scene, sound_speed_m_s
        self._places = _places(scene)
        low, high = self._places.min(axis=0), self._places.max(axis=0)
        self._centre = 0.5 * (low + high)
        self._size = max(20.0, float(np.linalg.norm(high - low)))
        self._kinds = {s.name: SENSOR_KINDS[s.kind] for s in scene.sensors if s.kind}
        mounted = scene.camera is not None and scene.camera.mount
        self._camera = "world/vehicle/camera" if mounted else "world/camera"
        # the last seconds of the first two microphones
        sounds = [name for name, kind in self._kinds.items() if kind.file == ".wav"]
        self._sounds = {name: np.zeros(0) for name in sounds[:2]}
        self._fronts: list[tuple[float, np.ndarray, float]] = []
        self._trail, self.address = np.zeros((0, 3)), ""
        self._stream = self._rr.RecordingStream(
            "jblast",
            recording_id=recording_id,
            send_properties=False,
            # by default rows are divided by the time of the computer
            batcher_config=self._rr.ChunkBatcherConfig.NEVER(),
        )
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._open(save, live)
        self._show_scene()

    def take(self, packet: Packet) -> None:
        """Show the next packet."""
        duration = packet.end_s - packet.start_s
        columns = max(1, round(duration * COLUMNS_HZ))
        count = max(1, round(duration * SHOWN_HZ))
        ticks = np.linspace(packet.start_s, packet.end_s, count + 1)[1:]
        for charge in packet.blasts:
            self._blast(charge)
        self._shocks(ticks)
        for one in packet.perceived:
            text = f"blast {one.shot} at {one.entity}: {one.sense}"
            self._text("perceptions", one.time_s, text, "DEBUG")
        if packet.motion is not None and packet.motion.time_s.size:
            self._motion(packet.motion, columns)
        for name, (start, rate, values) in packet.samples.items():
            time = start + np.arange(len(values)) / rate
            # an IMU has no columns: its motion is that of the vehicle
            for column, part in zip(self._kinds[name].columns, values.T, strict=False):
                path = f"waveforms/{self._part(name)}/{column}"
                self._plot(path, time, part, columns)
            if name in self._sounds:
                sound = np.append(self._sounds[name], values[:, 0])
                self._sounds[name] = sound = sound[-round(SPECTRA_S * rate) :]
                picture = self._jpeg(spectrogram(sound, rate))
                self._log(f"spectrograms/{self._part(name)}", packet.end_s, picture)
        if (frames := packet.frames) is not None:
            for row in thinned(frames.time_s, SHOWN_HZ):
                picture = self._jpeg(frames.images[row])
                self._log(f"{self._camera}/image", float(frames.time_s[row]), picture)
        if packet.events is not None and self._scene.camera is not None:
            self._events(packet.events, self._scene.camera, ticks)
        for detection in packet.detections:
            self._detection(detection)
        self._stream.flush()

    def finish(self) -> None:
        """Complete and close the file. A server continues."""
        with self._stream:  # its exit closes files, but not servers
            pass

    def wait(self) -> None:
        """Serve the run until an interrupt (Ctrl-C); return if it is not served."""
        if self.address:
            with suppress(KeyboardInterrupt):
                threading.Event().wait()
        self._stream.disconnect()

    def _open(self, save: Path | None, live: bool) -> None:
        """Connect the stream to the file and to the server."""
        rr, sinks, uri = self._rr, [], ""
        try:
            if save is not None:
                sinks.append(rr.FileSink(save))
            if live:
                # for this computer only; a free port, as several runs may be shown
                server = rr.GrpcServerSink(bind_ip="127.0.0.1", port=_free_port())
                sinks.append(server)
                uri = server.uri
            self._stream.set_sinks(*sinks, default_blueprint=self._blueprint(live))
        except RuntimeError as error:
            raise InputError(f"{save}: expected a file to write: {error}") from None
        if live:
            port = _free_port()
            display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
            browser = bool(display) or sys.platform in ("darwin", "win32")
            rr.serve_web_viewer(web_port=port, open_browser=browser, connect_to=uri)
            self.address = f"http://127.0.0.1:{port}?url={uri.replace('+', '%2B')}"
            sys.stderr.write(f"live view: {self.address}\n")

    def _part(self, name: str) -> str:
        return self._rr.escape_entity_path_part(name)

    def _log(self, path: str, time: float | None, *values: Any) -> None:
        """Add one row, or without a time a value for all times."""
        if time is not None:
            self._stream.set_time(CLOCK, duration=float(time))
        self._stream.log(path, *values, static=time is None)

    def _text(self, path: str, time: float, text: str, level: str) -> None:
        self._log(f"log/{path}", time, self._rr.TextLog(text, level=level))

    def _rows(self, path: str, time: np.ndarray, columns: Any) -> None:
        """Add rows of an entity."""
        if time.size:
            index = self._rr.TimeColumn(CLOCK, duration=time)
            self._stream.send_columns(path, [index], columns)

    def _plot(self, path: str, time: np.ndarray, values: np.ndarray, columns: int):
        """Add the least and the greatest value of each column to a plot."""
        rows = extremes(values, columns)
        self._rows(path, time[rows], self._rr.Scalars.columns(scalars=values[rows]))

    def _jpeg(self, image: UInt8[np.ndarray, "height width 3"]) -> Any:
        return self._rr.Image(image).compress(jpeg_quality=QUALITY)

    def _motion(self, motion: Motion, columns: int) -> None:
        """Show rows of the vehicle's motion."""
        rr, kept = self._rr, thinned(motion.time_s, POSES_HZ)
        time, position = motion.time_s[kept], motion.position_m[kept]
        pose = rr.Transform3D.columns(
            translation=position, quaternion=motion.quaternion[kept]
        )
        self._rows("world/vehicle", time, pose)
        points = rr.Points3D.columns(positions=motion.set_point_m[kept])
        self._rows("world/set_point", time, points)
        # each part of the path begins at the end of the one before
        strip = np.concatenate([self._trail, position])
        self._log("world/path", motion.time_s[-1], rr.LineStrips3D([strip]))
        self._trail = strip[-1:]
        values = (*motion.force_n.T, *motion.moment_n_m.T, motion.path_error_m)
        for path, part in zip((*FLIGHT, "path_error"), values, strict=True):
            self._plot(f"flight/{path}", motion.time_s, part, columns)

    def _events(
        self, events: CameraEvents, camera: Camera, ticks: Float[np.ndarray, " tick"]
    ) -> None:
        """Show the events before each tick and after the one before."""
        from PIL import Image  # installed with Matplotlib

        # coarse pixels: single ones would be invisible in a small view
        step = -(-camera.width // EVENT_COLUMNS)
        size = (-(-camera.height // step), -(-camera.width // step))
        codes = np.where(events.polarity > 0, 2, 1)
        cuts = np.searchsorted(events.time_s, ticks[:-1])
        for part, tick in zip(
            np.split(np.arange(codes.size), cuts), ticks, strict=True
        ):
            changes = np.zeros(size, np.uint8)
            changes[events.y[part] // step, events.x[part] // step] = codes[part]
            image, file = Image.fromarray(changes), io.BytesIO()
            image.putpalette(EVENT_COLOURS)
            image.save(file, format="PNG")  # JPEG would blur single pixels
            data = {"contents": file.getvalue(), "media_type": "image/png"}
            self._log("events", tick, self._rr.EncodedImage(**data))

    def _blast(self, charge: Charge) -> None:
        """Show a charge by the largest extent of its fireball, and begin its front."""
        name, time = charge.name or "charge", float(charge.time_s)
        centre = np.array([float(number) for number in charge.position_m])
        radius = LARGEST_RADIUS * np.cbrt(charge.mass_kg)
        ball = self._rr.Points3D([centre], radii=radius, colors=ORANGE, labels=name)
        self._log(f"world/charges/{self._part(name)}", time, ball)
        self._text("blasts", time, f"blast {name}: {charge.mass_kg:.3g} kg", "INFO")
        # the trail is the present position of the vehicle
        places = np.concatenate([self._places, self._trail])
        farthest = np.linalg.norm(places - centre, axis=1).max()
        self._fronts.append((time, centre, max(NEAR_M, farthest)))

    def _shocks(self, ticks: Float[np.ndarray, " tick"]) -> None:
        """Show the shock fronts until they have passed all entities."""
        for tick in ticks:
            grown = [(self._sound_speed * (tick - t), c, m) for t, c, m in self._fronts]
            drawn = [(centre, r) for r, centre, most in grown if 0.0 < r < most]
            spheres = self._rr.Ellipsoids3D(
                centers=[centre for centre, _ in drawn],
                radii=[radius for _, radius in drawn],
                colors=BLUE,
            )
            self._log("world/shocks", tick, spheres)

    def _detection(self, found: RunDetection) -> None:
        """Report a detection, and mark it in the plot of its sensor."""
        mark, level, what = "false_alarms", "WARN", "false alarm"
        if found.shot:
            what = f"blast {found.shot}, {found.latency_s:.2f} s after its wave"
            mark, level = "detections", "INFO"
        text = f"{found.sensor}: {found.kind} at {found.time_s:.4f} s, {what}"
        self._text("detections", found.reported_s, text, level)
        if found.sensor in self._kinds:
            path = f"waveforms/{self._part(found.sensor)}/{mark}"
            self._log(path, found.time_s, self._rr.Scalars(0.0))

    def _show_scene(self) -> None:
        """Show all that does not move, and the styles of the rest."""
        rr, scene, points = self._rr, self._scene, self._rr.Radius.ui_points
        styles: dict[str, Any] = {"world": rr.ViewCoordinates.RIGHT_HAND_Z_UP}
        for sensor in scene.sensors:
            place = sensor.offset_m if sensor.mount else sensor.position_m
            path = "world/vehicle" if sensor.mount else "world/sensors"
            if np.isfinite(place).all():
                shown = {"labels": sensor.name, "colors": GREEN, "radii": points(4)}
                dot = rr.Points3D([np.asarray(place)], **shown)
                styles[f"{path}/{self._part(sensor.name)}"] = dot
        for name, kind in self._kinds.items():
            path = f"waveforms/{self._part(name)}"
            for column, colour in zip(kind.columns, COLOURS, strict=False):
                styles[f"{path}/{column}"] = rr.SeriesLines(colors=colour)
            for mark, colour in (("detections", GREEN), ("false_alarms", RED)):
                styles[f"{path}/{mark}"] = rr.SeriesPoints(colors=colour)
        if scene.vehicle is not None:
            styles["world/vehicle"] = rr.TransformAxes3D(0.04 * self._size)
            for path, colour in zip(FLIGHT, COLOURS * 2, strict=True):
                styles[f"flight/{path}"] = rr.SeriesLines(colors=colour)
            dot = rr.Points3D.from_fields(colors=RED, radii=points(3))
            styles["world/set_point"] = dot
        if (camera := scene.camera) is not None:
            place, turned = np.asarray(camera.position), np.asarray(camera.quaternion)
            pose = rr.Transform3D(translation=place, quaternion=turned)
            lens = rr.Pinhole(
                focal_length=np.asarray(camera.focal),
                principal_point=np.asarray(camera.center),
                resolution=(camera.width, camera.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.1 * self._size,
            )
            styles[self._camera] = (pose, lens)
        for path, style in styles.items():
            self._log(path, None, *(style if isinstance(style, tuple) else (style,)))

    def _blueprint(self, live: bool) -> Any:
        """Return the arrangement of the views."""
        rr, b, bound = self._rr, self._rr.blueprint, self._rr.TimeRangeBoundary
        now = bound.cursor_relative(seconds=0.0)
        begin = bound.cursor_relative(seconds=-WINDOW_S)
        last = rr.VisibleTimeRange(CLOCK, start=begin, end=now)
        past = rr.VisibleTimeRange(CLOCK, start=bound.infinite(), end=now)

        legend = b.PlotLegend(b.Corner2D.LeftTop)
        plot = partial(b.TimeSeriesView, time_ranges=last, plot_legend=legend)
        eye = self._centre + self._size * np.array([-0.35, -0.7, 0.45])
        space = b.Spatial3DView(
            origin="world",
            name="scene",
            eye_controls=b.EyeControls3D(position=eye, look_target=self._centre),
            overrides={"world/path": b.VisibleTimeRanges([past])},
        )
        words = b.TextLogColumns(text_log_columns=["LogLevel", "Body"])
        log = b.TextLogView(origin="log", name="log", columns=words)
        pictures, plots, flight = [], [], []
        if self._scene.camera is not None:
            image = f"{self._camera}/image"
            pictures = [
                b.Spatial2DView(origin=self._camera, contents=image, name="camera"),
                b.Spatial2DView(origin="events", name="events (red: brighter)"),
            ]
        for name, kind in self._kinds.items():
            if kind.columns:
                plots.append(plot(origin=f"waveforms/{self._part(name)}", name=name))
        for name in self._sounds:
            path = f"spectrograms/{self._part(name)}"
            plots.append(b.Spatial2DView(origin=path, name=f"{name}, spectrogram"))
        if self._scene.vehicle is not None:
            flight = [
                plot(origin="flight/force", name="force [N]"),
                plot(origin="flight/torque", name="torque [N m]"),
                plot(origin="flight/path_error", name="path error [m]"),
            ]
        top = b.Horizontal(space, b.Vertical(*pictures, log), column_shares=[2, 1])
        rows = [b.Horizontal(*views) for views in (plots, flight) if views]
        play = "following" if live else "playing"
        return b.Blueprint(
            b.Vertical(top, *rows, row_shares=[3, *(1.5 for _ in rows)]),
            b.TimePanel(state="collapsed", timeline=CLOCK, play_state=play),
            collapse_panels=True,
        )


def spectrogram(
    samples: Float[np.ndarray, " sample"], rate_hz: float
) -> UInt8[np.ndarray, "band window 3"]:
    """Return the sound levels of bands of frequency over time, as a picture.

    Args:
        samples: The last samples [Pa]; silence before them, up to `SPECTRA_S`.
        rate_hz: Samples per second.

    Returns:
        Colours; low frequencies at the bottom, the latest window at the right.
    """
    from matplotlib import colormaps

    samples = np.pad(samples, (round(SPECTRA_S * rate_hz) - samples.size, 0))
    size = 2 ** max(4, round(math.log2(WINDOWED_S * rate_hz)))
    window = np.hanning(size + 1)[:-1]
    bands = np.geomspace(min(LOWEST_HZ, 0.1 * rate_hz), 0.5 * rate_hz, BANDS)[::-1]
    parts = np.lib.stride_tricks.sliding_window_view(samples, size)[:: size // 2]
    spectra = np.fft.rfft(parts * window)[
        :, np.rint(bands * size / rate_hz).astype(int)
    ]
    rms = math.sqrt(2.0) * np.abs(spectra).T / window.sum()  # exact for a sine
    levels = 20.0 * np.log10(np.maximum(rms / REFERENCE_PA, 1e-9))
    shares = (levels - LEVELS_DB[0]) / (LEVELS_DB[1] - LEVELS_DB[0])
    return colormaps["magma"](shares, bytes=True)[..., :3]


def thinned(
    time: Float[np.ndarray, " row"], rate_hz: float
) -> Int[np.ndarray, " kept"]:
    """Return the first row of each interval of a rate."""
    # 1 us, so that a time is in the interval that it begins
    slots = np.floor((time + 1e-6) * rate_hz)
    return np.flatnonzero(np.diff(slots, prepend=-np.inf) > 0)


def extremes(
    values: Float[np.ndarray, " row"], columns: int
) -> Int[np.ndarray, " kept"]:
    """Return the rows of the least and the greatest value of each column, in order.

    Args:
        values: Values in order of time.
        columns: Number of columns; at most twice as many rows are returned.
    """
    if not values.size:
        return np.zeros(0, int)
    size = -(-values.size // columns)
    # padding repeats the last value, which therefore comes first
    table = np.pad(values, (0, -values.size % size), mode="edge").reshape(-1, size)
    first = size * np.arange(len(table))
    return np.unique([first + table.argmin(axis=1), first + table.argmax(axis=1)])


def _places(scene: Scene) -> Float[np.ndarray, "place 3"]:
    """Return the known positions of sensors, camera, vehicle and charges [m]."""
    found: list[Any] = [sensor.position_m for sensor in scene.sensors]
    if scene.camera is not None and not scene.camera.mount:
        found.append(scene.camera.position)
    if scene.vehicle is not None:
        found += [scene.vehicle.position, scene.vehicle.held]
    found += [charge.position_m for charge in scene.charges]
    places = np.array([[float(number) for number in place] for place in found])
    return places[np.isfinite(places).all(axis=1)]


def _free_port() -> int:
    """Return a port that no program of this computer uses."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]
