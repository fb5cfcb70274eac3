"""Scenes: charges, air, ground, sensors, camera and vehicle, and priors of numbers."""

from jblast.parameters import PARAMETERS as PARAMETERS
from jblast.scene.camera import (
    Camera as Camera,
    look_at as look_at,
    matrix_quaternion as matrix_quaternion,
    quaternion_matrix as quaternion_matrix,
)
from jblast.scene.charge import EXPLOSIVES as EXPLOSIVES, Charge as Charge
from jblast.scene.random_blasts import (
    Box as Box,
    ByCount as ByCount,
    ByRate as ByRate,
    ByTick as ByTick,
    Ring as Ring,
    WorldSpec as WorldSpec,
)
from jblast.scene.reader import (
    read_scene as read_scene,
    read_scene_or_world as read_scene_or_world,
    read_world as read_world,
    scene_of as scene_of,
)
from jblast.scene.scene import (
    Air as Air,
    Ambient as Ambient,
    Ground as Ground,
    Scene as Scene,
    VehicleSpec as VehicleSpec,
)
from jblast.scene.sensor import (
    Clock as Clock,
    Imu as Imu,
    Instrument as Instrument,
    Sensor as Sensor,
)
from jblast.scene.sensor_kinds import (
    SENSOR_KINDS as SENSOR_KINDS,
    SensorKind as SensorKind,
)
from jblast.scene.uncertain import (
    Free as Free,
    LogNormal as LogNormal,
    LogUniform as LogUniform,
    Normal as Normal,
    Place as Place,
    UncertainScene as UncertainScene,
    Uniform as Uniform,
    default_scene as default_scene,
    draw_scene as draw_scene,
    freed as freed,
    parameter_named as parameter_named,
    value_of as value_of,
    with_laws as with_laws,
    with_values as with_values,
)
from jblast.scene.values import Number as Number, SceneKey as SceneKey
