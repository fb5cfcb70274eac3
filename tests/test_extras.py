"""Each extra that is not installed is named in one sentence."""

import sys
import tomllib
from pathlib import Path

import pytest

import jblast.environments
from jblast.errors import InputError

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def log(suffix):
    def use(folder):
        from jblast.observations import read

        (folder / f"x{suffix}").write_bytes(b"PK\x03\x04")
        read(folder / f"x{suffix}")

    return use


def seismic(folder):
    from jblast.observations.records.seismic import open_seismic

    open_seismic(folder / "x.mseed")


def tdms(folder):
    from jblast.observations.records.tdms import open_tdms

    open_tdms(folder / "x.tdms")


def video(folder):
    from jblast.sensors.camera.files.video import opened

    (folder / "x.mp4").touch()
    with opened(folder / "x.mp4"):
        pass


def aedat4(folder):
    from jblast.sensors.camera.files.aedat4 import read_aedat4

    read_aedat4(folder / "x.aedat4")


def scheduler(folder):
    from jblast.study.runs import client_of

    with client_of("tcp://127.0.0.1:1"):
        pass


def environment(folder):
    from jblast import environments

    return environments.QuadrotorEnv


def serve(folder):
    from jblast.world.serve.messages import grpc

    grpc()


def mavlink(folder):
    from jblast.autopilot.mavlink import tools

    tools.__wrapped__()


def ros(folder):
    from jblast.report.exports.ros_bag import RosBag
    from jblast.scene import Scene

    RosBag(path=folder / "x.mcap", scene=Scene(), seconds=1.0)


def viewer(folder):
    from jblast.report.exports.rerun import Viewer
    from jblast.scene import Scene

    file = folder / "x.rrd"
    Viewer(scene=Scene(), sound_speed_m_s=340.0, recording_id="x", save=file)


USES = [
    ("spreadsheet", "openpyxl", log(".xlsx")),
    ("spreadsheet", "odf", log(".ods")),
    ("parquet", "pyarrow", log(".parquet")),
    ("seismic", "obspy", seismic),
    ("tdms", "nptdms", tdms),
    ("video", "av", video),
    ("aedat4", "faery", aedat4),
    ("cluster", "distributed", scheduler),
    ("environments", "gymnasium", environment),
    ("serve", "grpc", serve),
    ("serve", "google.protobuf", serve),
    ("mavlink", "pymavlink", mavlink),
    ("ros", "mcap_ros2", ros),
    ("viewer", "rerun", viewer),
]


@pytest.mark.parametrize(("extra", "module", "use"), USES)
def test_an_extra_that_is_not_installed_is_named(
    tmp_path, monkeypatch, extra, module, use
):
    for name in list(sys.modules):
        if name.startswith(f"{module}."):
            monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, module, None)  # an import raises ImportError
    monkeypatch.delitem(
        sys.modules, "jblast.environments.gymnasium_classes", raising=False
    )
    # a name that an earlier test used is kept in the package
    monkeypatch.delitem(vars(jblast.environments), "QuadrotorEnv", raising=False)
    with pytest.raises(InputError, match=rf"pip install 'jblast\[{extra}\]'"):
        use(tmp_path)


def test_every_extra_is_tried():
    extras = tomllib.loads(PROJECT.read_text())["project"]["optional-dependencies"]
    # without geo there is no KML file, which a caption states
    assert {extra for extra, _, _ in USES} == set(extras) - {"geo"}
