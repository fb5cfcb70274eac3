"""Live view of a run with Rerun: a scene, pictures and plots on the clock of the run.

`Viewer` is a subscriber of a run. It writes a recording (.rrd), serves it to a browser,
or both. Data are reduced to the resolution of a screen, so that the file of a run of
minutes is small: a plot has the least and the greatest sample of each column, and
pictures are compressed. Each packet adds 1.2 kB of metadata per plot, so that packets
should not be much shorter than 0.2 s. All data depend only on the packets: the
recording has no clock but that of the run.
"""

import io
import os
import socket
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, needed
from jblast.scene import SENSOR_KINDS, Camera, Charge, Scene
from jblast.study.running import CameraEvents, Packet, RunDetection
from jblast.study.thinning import extremes, first_of_each
from jblast.vehicle import Trajectory
from jblast.waves.fireballs import LARGEST_RADIUS

CLOCK = "time"
"""The only timeline: the clock of the run."""
WINDOW_S = 10.0
"""Length of the time axes [s]: a vehicle recovers within it."""
COLUMNS_HZ = 200.0
"""Columns of a plot in a second: 2,000 in a window, about one a pixel."""
SHOWN_HZ, POSES_HZ = 20.0, 50.0
"""Pictures and shock fronts in a second, which appear continuous; poses of the vehicle,
which no viewer interpolates."""
QUALITY = 80
"""Quality of JPEG pictures: about half the size of 90."""
NEAR_M = 50.0
"""Radius to which all shock fronts are drawn [m]; beyond, to the farthest entity."""
BLUE, ORANGE, GREEN = (86, 180, 233), (230, 159, 0), (0, 158, 115)
RED, GREY = (213, 94, 0), (150, 150, 150)
COLOURS = (ORANGE, GREEN, BLUE)
"""Colours of components."""
FLIGHT = {"force [N]": "east north up", "torque [N m]": "x y z", "path_error [m]": ""}
"""Plots of the vehicle with their components."""
EVENT_COLUMNS = 320
"""Largest width of pictures of camera events [px]."""


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
        extent = np.linalg.norm(np.ptp(self._places, axis=0))
        self._size = max(20.0, float(extent))
        self._kinds = {s.name: SENSOR_KINDS[s.kind] for s in scene.sensors if s.kind}
        mounted = scene.camera is not None and scene.camera.mount
        self._camera = "world/vehicle/camera" if mounted else "world/camera"
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
                self._plot(f"{self._plots(name)}/{column}", time, part, columns)
        if (frames := packet.frames) is not None:
            for row in first_of_each(frames.time_s, SHOWN_HZ):
                time, image = float(frames.time_s[row]), frames.images[row]
                shown = self._rr.Image(image).compress(jpeg_quality=QUALITY)
                self._log(f"{self._camera}/image", time, shown)
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

    def _plots(self, sensor: str) -> str:
        return f"waveforms/{self._part(sensor)}"

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

    def _plot(
        self, path: str, time: np.ndarray, values: np.ndarray, columns: int
    ) -> None:
        """Add the least and the greatest value of each column to a plot."""
        rows = extremes(values, columns)
        self._rows(path, time[rows], self._rr.Scalars.columns(scalars=values[rows]))

    def _motion(self, motion: Trajectory, columns: int) -> None:
        """Show rows of the vehicle's motion."""
        rr, whole = self._rr, np.asarray(motion.time_s)
        kept = motion.at(first_of_each(whole, POSES_HZ))
        time, position = np.asarray(kept.time_s), np.asarray(kept.position_m)
        turned = np.asarray(kept.quaternion)
        pose = rr.Transform3D.columns(translation=position, quaternion=turned)
        self._rows("world/vehicle", time, pose)
        points = rr.Points3D.columns(positions=np.asarray(kept.set_point_m))
        self._rows("world/set_point", time, points)
        # each part of the path begins at the end of the one before
        strip = np.concatenate([self._trail, position])
        self._log("world/path", whole[-1], rr.LineStrips3D([strip]))
        self._trail = strip[-1:]
        values = (*motion.force_n.T, *motion.moment_n_m.T, motion.path_error_m)
        for path, part in zip(_flight_paths(), values, strict=True):
            self._plot(path, whole, np.asarray(part), columns)

    def _events(
        self, events: CameraEvents, camera: Camera, ticks: Float[np.ndarray, " tick"]
    ) -> None:
        """Show the events before each tick and after the one before."""
        from PIL import Image  # installed with Matplotlib

        # coarse pixels: single ones would be invisible in a small view
        step = -(-camera.width // EVENT_COLUMNS)
        size = (-(-camera.height // step), -(-camera.width // step))
        tick_of = np.searchsorted(ticks[:-1], events.time_s, side="right")
        for number, tick in enumerate(ticks):
            part = tick_of == number
            changes = np.zeros(size, np.uint8)
            place = events.y[part] // step, events.x[part] // step
            changes[place] = np.where(events.polarity[part] > 0, 2, 1)
            image, file = Image.fromarray(changes), io.BytesIO()
            image.putpalette((*GREY, *BLUE, *RED))  # none, darker, brighter
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
            centres, radii = zip(*drawn, strict=True) if drawn else ([], [])
            spheres = self._rr.Ellipsoids3D(centers=centres, radii=radii, colors=BLUE)
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
            path = f"{self._plots(found.sensor)}/{mark}"
            self._log(path, found.time_s, self._rr.Scalars(0.0))

    def _show_scene(self) -> None:
        """Show all that does not move, and the styles of the rest."""
        rr, scene, points = self._rr, self._scene, self._rr.Radius.ui_points
        self._log("world", None, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for sensor in scene.sensors:
            place = sensor.offset_m if sensor.mount else sensor.position_m
            path = "world/vehicle" if sensor.mount else "world/sensors"
            if np.isfinite(place).all():
                shown = {"labels": sensor.name, "colors": GREEN, "radii": points(4)}
                dot = rr.Points3D([np.asarray(place)], **shown)
                self._log(f"{path}/{self._part(sensor.name)}", None, dot)
        lines = list(zip(_flight_paths()[:-1], COLOURS * 2, strict=True))
        for name, kind in self._kinds.items():
            path = self._plots(name)
            columns = [f"{path}/{column}" for column in kind.columns]
            lines += zip(columns, COLOURS, strict=False)
            for mark, colour in (("detections", GREEN), ("false_alarms", RED)):
                self._log(f"{path}/{mark}", None, rr.SeriesPoints(colors=colour))
        for path, colour in lines:
            self._log(path, None, rr.SeriesLines(colors=colour))
        if scene.vehicle is not None:
            self._log("world/vehicle", None, rr.TransformAxes3D(0.04 * self._size))
            dot = rr.Points3D.from_fields(colors=RED, radii=points(3))
            self._log("world/set_point", None, dot)
        if (camera := scene.camera) is not None:
            place, turned = np.asarray(camera.position), np.asarray(camera.quaternion)
            lens = rr.Pinhole(
                focal_length=np.asarray(camera.focal),
                principal_point=np.asarray(camera.center),
                resolution=(camera.width, camera.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.1 * self._size,
            )
            pose = rr.Transform3D(translation=place, quaternion=turned)
            self._log(self._camera, None, pose, lens)

    def _blueprint(self, live: bool) -> Any:
        """Return the arrangement of the views."""
        rr, b, bound = self._rr, self._rr.blueprint, self._rr.TimeRangeBoundary
        now = bound.cursor_relative(seconds=0.0)
        begin = bound.cursor_relative(seconds=-WINDOW_S)
        past = rr.VisibleTimeRange(CLOCK, start=bound.infinite(), end=now)

        def plot(origin: str, name: str) -> Any:
            last = rr.VisibleTimeRange(CLOCK, start=begin, end=now)
            legend = b.PlotLegend(b.Corner2D.LeftTop)
            options = {"time_ranges": last, "plot_legend": legend}
            return b.TimeSeriesView(origin=origin, name=name, **options)

        centre = 0.5 * (self._places.min(axis=0) + self._places.max(axis=0))
        eye = centre + self._size * np.array([-0.35, -0.7, 0.45])
        space = b.Spatial3DView(
            origin="world",
            name="scene",
            eye_controls=b.EyeControls3D(position=eye, look_target=centre),
            overrides={"world/path": b.VisibleTimeRanges([past])},
        )
        words = b.TextLogColumns(text_log_columns=["LogLevel", "Body"])
        side = [b.TextLogView(origin="log", name="log", columns=words)]
        if self._scene.camera is not None:
            image = f"{self._camera}/image"
            side = [
                b.Spatial2DView(origin=self._camera, contents=image, name="camera"),
                b.Spatial2DView(origin="events", name="events (red: brighter)"),
                *side,
            ]
        sampled = [name for name, kind in self._kinds.items() if kind.columns]
        plots = [plot(self._plots(name), name) for name in sampled]
        flight = []
        if self._scene.vehicle is not None:
            flight = [plot(f"flight/{name.split()[0]}", name) for name in FLIGHT]
        top = b.Horizontal(space, b.Vertical(*side), column_shares=[2, 1])
        rows = [b.Horizontal(*views) for views in (plots, flight) if views]
        play = "following" if live else "playing"
        return b.Blueprint(
            b.Vertical(top, *rows, row_shares=[3, *(1.5 for _ in rows)]),
            b.TimePanel(state="collapsed", timeline=CLOCK, play_state=play),
            collapse_panels=True,
        )


def _flight_paths() -> list[str]:
    """Return the entities of the plots of the vehicle."""
    return [
        f"flight/{name.split()[0]}" + (f"/{axis}" if axis else "")
        for name, axes in FLIGHT.items()
        for axis in axes.split() or [""]
    ]


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
