"""Table of the keys of a scene file, one line each.

The reader, the manual, the JSON Schema, `jblast tune` and the tests read this table.
Numbers that may be uncertain have their bounds and defaults in `parameters.csv`.
"""

from dataclasses import replace

from jblast.parameters import (
    CLOCK,
    NOT_NEGATIVE,
    PARAMETERS,
    PLACE_LIMITS,
    POSITIVE,
    Bounds,
)
from jblast.quantities import ADDITIVE, QUANTITIES
from jblast.scene.camera import MOUNTS
from jblast.scene.charge import BURSTS, EXPLOSIVES, explosive_named
from jblast.scene.random_blasts import ABOUT, Box, ByCount, ByRate, Ring
from jblast.scene.sensor_kinds import SENSOR_KINDS, kind_keys
from jblast.scene.uncertain import Free
from jblast.scene.values import (
    POSITION,
    File,
    Number,
    Numbers,
    SceneKey as Key,
    Share,
    Table,
    Text,
    Truth,
    Whole,
    Word,
)

GROUND_PATHS = ("head", "thesis")
VEHICLE_MODELS = ("crazyflie", "hummingbird", "iris")
MAX_BLASTS = 10_000
"""Maximum number of blasts of a world; declared: more are probably a mistake."""
MAX_IMAGE_PX = 65_535
"""Maximum side of an image in pixels: event files have 16 bits for x and y."""
MAX_SLOPE_DB_OCTAVE = 12.0
"""Maximum slope of ambient noise [dB/octave]: a steeper spectrum is nearly a tone."""
SLOPE = Bounds(at_least=-MAX_SLOPE_DB_OCTAVE, at_most=MAX_SLOPE_DB_OCTAVE)
TIMES = Numbers("a list of times in seconds", rising=True)
TICK = Bounds(at_least=1e-3, at_most=1e6)
LAW = Text("the name of a law in quotes")
BODY = "[forward, left, up]"
CORNERS = Numbers("[low corner, high corner]", Numbers(POSITION))
RING = Numbers("[inner, outer]", Number(NOT_NEGATIVE), rising=True)
XY = Numbers("a number or [x, y]", Number(POSITIVE), repeated=True)
THRESHOLDS = Numbers("a number or [brighter, darker]", Number(POSITIVE), repeated=True)
QUATERNION = Numbers("[x, y, z, w]", not_zero=True)
MOUNTED = ("mount with offset_m",)
BOX_OR_RING = (
    "{ box = [[east, north, up], [east, north, up]] } or { ring = [inner, outer] }"
)


def uncertain(at: str, list_form: str = "", instead: tuple[str, ...] = ()) -> Key:
    """Return a key of the table of numbers, which may be free or have a prior."""
    rows = tuple(
        row
        for row in (*PARAMETERS.values(), CLOCK)
        if f"{row.key.table}.{row.key.name}" == at
    )
    one = Number(rows[0].bounds, free=Free(rows[0].positive))
    kind = Numbers(list_form, one) if list_form else one
    return Key(at.partition(".")[2], kind, instead=instead, rows=rows)


# Times may be zero or negative, so that they have no relative error.
RECORDS = tuple(
    Key(
        name,
        Number(POSITIVE) if name in ADDITIVE else Share(quantity.unit),
        f"records.{name}",
    )
    for name, quantity in QUANTITIES.items()
)
# fmt: off
CONTROL = (
    Key("integral", Truth()),
    Key("target_m", Numbers(POSITION), "target"),
    Key("yaw_rad", Number(), "yaw"),
    Key("kp_pos", Numbers(POSITION, Number(NOT_NEGATIVE)), "gains.kp_pos"),
    Key("kd_pos", Numbers(POSITION, Number(NOT_NEGATIVE)), "gains.kd_pos"),
    Key("ki_pos", Numbers(POSITION, Number(NOT_NEGATIVE), not_zero=True),
        "gains.ki_pos"),
    Key("kp_att", Number(NOT_NEGATIVE), "gains.kp_att"),
    Key("kd_att", Number(NOT_NEGATIVE), "gains.kd_att"),
    Key("integral_limit", Number(NOT_NEGATIVE), "gains.integral_limit"),
    # Below 1 the lead would be a second lag.
    Key("motor_lead", Number(Bounds(at_least=1.0)), "gains.motor_lead"),
)
REGION = (
    Key("box", CORNERS, "region", make=lambda ends: Box(*ends)),
    Key("ring", RING, "region", instead=("box",), make=lambda ends: Ring(*ends)),
    Key("about", Word(ABOUT)),
)
KEYS: dict[str, tuple[Key, ...]] = {
    "charge": (
        Key("name", Text()),
        uncertain("charge.mass_kg"),
        Key("explosive", Word(EXPLOSIVES, explosive_named)),
        uncertain("charge.tnt_factor"),
        uncertain("charge.position_m", POSITION),
        uncertain("charge.range_m", instead=("position_m",)),
        uncertain("charge.time_s"),
        Key("burst", Word(BURSTS)),
    ),
    "air": (
        uncertain("air.temperature_k"),
        uncertain("air.pressure_pa"),
        uncertain("air.relative_humidity"),
        uncertain("air.altitude_m",
            instead=("temperature_k", "pressure_pa")),
        uncertain("air.sound_speed_m_s"),
        uncertain("air.wind_m_s", "[east, north]"),
        Key("absorption", Truth()),
        Key("absorption_scale", Number(NOT_NEGATIVE)),
    ),
    "ground": (
        uncertain("ground.p_speed_m_s"),
        Key("path", Word(GROUND_PATHS)),
    ),
    "sensor": (
        Key("name", Text(), needed=True),
        Key("kind", Word(SENSOR_KINDS)),
        Key("position_m", Numbers(POSITION), instead=MOUNTED),
        uncertain("sensor.clock_offset_s"),
        Key("records", Table("{ QUANTITY = sigma }", RECORDS)),
        Key("times_s", TIMES, make=tuple),
        Key("mount", Word(MOUNTS), needs=("[vehicle]",)),
        Key("offset_m", Numbers(BODY), needs=('mount = "vehicle"',)),
        Key("quaternion_xyzw", QUATERNION, "quaternion", needs=('mount = "vehicle"',)),
    ),
    "clock": (
        Key("name", Text(), needed=True),
        replace(uncertain("sensor.clock_offset_s"), name="offset_s"),
    ),
    "place": (
        Key("lat_deg", Number(PLACE_LIMITS["lat_deg"]), needed=True),
        Key("lon_deg", Number(PLACE_LIMITS["lon_deg"]), needed=True),
        Key("alt_m", Number(PLACE_LIMITS["alt_m"])),
    ),
    "ambient": (
        Key("file", File()),
        Key("full_scale_pa", Number(POSITIVE), "full_scale", needs=("file",)),
        Key("level_pa", Number(NOT_NEGATIVE), "level", needed=True, instead=("file",)),
        Key("slope_db_octave", Number(SLOPE), "slope", instead=("file",)),
        Key("height_m", Number(POSITIVE), "height"),
    ),
    "camera": (
        Key("position_m", Numbers(POSITION), "position", needed=True, instead=MOUNTED),
        Key("look_at_m", Numbers(POSITION), "look_at", needed=True,
            instead=("quaternion_xyzw", "mount to look forward")),
        Key("quaternion_xyzw", QUATERNION, "quaternion"),
        Key("mount", Word(MOUNTS), needs=("[vehicle]",)),
        Key("offset_m", Numbers(BODY), "position", needs=('mount = "vehicle"',)),
        Key("width", Whole(1, MAX_IMAGE_PX), needed=True),
        Key("height", Whole(1, MAX_IMAGE_PX), needed=True),
        Key("focal_px", XY, "focal", needed=True),
        Key("center_px", Numbers("[x, y]"), "center"),
        Key("distortion", Numbers("[k1, k2, p1, p2, k3]")),
        Key("frames_hz", Number(POSITIVE)),
        Key("exposure_s", Number(NOT_NEGATIVE)),
        Key("threshold", THRESHOLDS),
        Key("daylight_lux", Number(POSITIVE), "daylight"),
    ),
    "vehicle": (
        Key("model", Word(VEHICLE_MODELS), needed=True),
        Key("position_m", Numbers(POSITION), "position"),
        Key("velocity_m_s", Numbers(POSITION), "velocity", instead=("mission",)),
        Key("control", Table("a table such as { integral = true }", CONTROL)),
        Key("mission", File()),
    ),
    "control": CONTROL,
    "world": (
        Key("count", Whole(1, MAX_BLASTS), "occurrence", make=ByCount),
        Key("rate_hz", Number(POSITIVE, sampled=True), "occurrence",
            instead=("count",), make=ByRate),
        Key("probability", Number(Bounds(above=0.0, at_most=1.0)), "occurrence",
            instead=("count", "rate_hz"), needs=("tick_s",)),
        Key("tick_s", Number(TICK), "tick", needs=("probability",)),
        Key("region_m", Table(BOX_OR_RING, REGION)),
        Key("about", Word(ABOUT)),
        Key("mass_kg", Number(POSITIVE, sampled=True), "mass"),
        Key("time_s", Number(NOT_NEGATIVE, sampled=True), "time"),
        Key("gap_s", Number(NOT_NEGATIVE, sampled=True), "gap"),
    ),
    "region": REGION,
    "law": (
        *(Key(quantity, LAW, f"law.{quantity}") for quantity in QUANTITIES),
        Key("scatter", Truth()),
        uncertain("law.sedov_gamma"),
        uncertain("law.fireball_growth_s"),
    ),
}
# fmt: on
"""Keys by table."""
WITHIN = {"control": "[vehicle] control", "region": "[world] region_m"}
"""Tables within others, and their keys."""
SEVERAL = ("charge", "sensor", "clock")
"""Tables of which a file may have several."""


def keys_of(table: str, kind: str | None = None) -> dict[str, Key]:
    """Return the keys of a table by name; for sensors those of a kind, or of all."""
    keys = {key.name: key for key in KEYS[table]}
    kinds = ("", *SENSOR_KINDS) if kind is None else (kind,)
    for kind in kinds if table == "sensor" else ():
        keys = {key.name: key for key in kind_keys(kind)} | keys
    return keys
