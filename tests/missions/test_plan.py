"""Plans of ground stations: both forms, surveys, and what is refused."""

import json
from dataclasses import replace
from typing import Any

import pytest

from jblast.errors import InputError
from jblast.missions import plan_text, read_plan, write_plan

HOME = [35.3075, -80.7353, 200.0]
"""The thesis' campus, roughly."""


def item(command: int, params: list, frame: int = 3, **keys: Any) -> dict[str, Any]:
    return {
        "AMSLAltAboveTerrain": None,
        "autoContinue": True,
        "command": command,
        "frame": frame,
        "params": params,
        "type": "SimpleItem",
        **keys,
    }


def survey(*items: Any) -> dict[str, Any]:
    return {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "polygon": [[35.3076, -80.7353], [35.3077, -80.7353], [35.3077, -80.7352]],
        "TransectStyleComplexItem": {"CameraCalc": {}, "Items": list(items)},
    }


TAKEOFF = item(22, [15, 0, 0, None, HOME[0], HOME[1], 10], doJumpId=1)
POINT = item(16, [2, 0, 0, None, 35.3077, -80.7353, 10], doJumpId=2)
RETURN = item(20, [0, 0, 0, 0, 0, 0, 0], frame=2, doJumpId=3)


def document(*items: Any, **changes: Any) -> dict[str, Any]:
    """A plan as QGroundControl 4 writes it."""
    return {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": 12,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": list(items or (TAKEOFF, POINT, RETURN)),
            "plannedHomePosition": HOME,
            "vehicleType": 2,
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    } | changes


def text(*items: Any, **changes: Any) -> str:
    return json.dumps(document(*items, **changes), indent=4)


WAYPOINTS = "\n".join(
    [
        "QGC WPL 110",
        "0\t1\t0\t16\t0\t0\t0\t0\t35.3075\t-80.7353\t200\t1",
        "1\t0\t3\t22\t15\t0\t0\tnan\t35.3075\t-80.7353\t10\t1",
        "2\t0\t3\t16\t2\t0\t0\tnan\t35.3077\t-80.7353\t10\t1",
        "3\t0\t2\t20\t0\t0\t0\t0\t0\t0\t0\t1",
        "",
    ]
)


def read(tmp_path, content: str, name: str = "a.plan"):
    file = tmp_path / name
    file.write_text(content)
    return read_plan(file)


def test_both_forms_say_the_same(tmp_path):
    plan, listed = read(tmp_path, text()), read(tmp_path, WAYPOINTS, "b.txt")
    assert plan.items == listed.items
    assert plan.home == listed.home == (35.3075, -80.7353, 200.0)
    assert [one.command for one in plan.items] == [22, 16, 20]
    assert plan.items[1].params == (2, 0, 0, None, 35.3077, -80.7353, 10)
    assert plan.hover_speed_m_s == 5.0


def test_what_is_written_is_read_again_with_parts_that_are_ignored(tmp_path):
    odd = item(16, [0.1, 2.5, 0, -37.25, 35.30771234567, -80.7353, 10.3], doJumpId=7)
    fence = {"circles": [{"circle": {"radius": 80}}], "polygons": [], "version": 2}
    plan = read(tmp_path, text(TAKEOFF, POINT, odd, RETURN, geoFence=fence))
    assert plan.ignored.endswith(": geoFence: a fence")
    write_plan(plan, tmp_path / "again.plan")
    assert read_plan(tmp_path / "again.plan") == replace(
        plan, source=str(tmp_path / "again.plan")
    )
    written = json.loads((tmp_path / "again.plan").read_text())
    assert written["geoFence"] == fence
    assert written["mission"]["globalPlanAltitudeMode"] == 1
    assert written["fileType"] == "Plan"
    with pytest.raises(InputError, match=r"suffix \.plan, got \.waypoints"):
        plan_text(plan, "b.waypoints")


def test_a_survey_is_read_by_its_items_and_ignored_commands_are_listed(tmp_path):
    triggers = [
        item(206, [25, 0, 1, 0, 0, 0, 0], frame=2, doJumpId=n) for n in range(3, 7)
    ]
    gimbal = item(1000, [-90, None, None, None, 0, 0, 2], frame=2, doJumpId=8)
    other = POINT | {"doJumpId": 7}
    plan = read(
        tmp_path,
        text(
            TAKEOFF, survey(POINT, *triggers, other), gimbal, RETURN | {"doJumpId": 9}
        ),
    )
    assert [one.command for one in plan.items] == [22, 16, *[206] * 4, 16, 1000, 20]
    assert plan.ignored == (
        f"ignored in {plan.source}: command 206 (4 of 9 items); "
        "command 1000 (1 of 9 items)"
    )
    # the copy of a plan keeps the commands, and the waypoints in place of the survey
    write_plan(plan, tmp_path / "again.plan")
    again = read_plan(tmp_path / "again.plan").items
    assert [(one.number, one.command) for one in again] == [
        (one.number, one.command) for one in plan.items
    ]
    assert read(tmp_path, text()).ignored == ""


@pytest.mark.parametrize(("frame", "known"), [(5, 0), (6, 3), (10, 10), (11, 10)])
def test_frames_of_whole_numbers_and_of_the_terrain_are_read(tmp_path, frame, known):
    plan = read(tmp_path, text(TAKEOFF, POINT | {"frame": frame}, RETURN))
    assert plan.items[1].frame == known


def test_blanks_for_tabs_and_ends_of_lines_are_read(tmp_path):
    listed = WAYPOINTS.replace("\t", "  ").replace("\n", "\r\n")
    assert read(tmp_path, listed).items == read(tmp_path, text()).items


def _point(n: int, value) -> str:
    params = list(POINT["params"])
    params[n] = value
    return text(TAKEOFF, POINT | {"params": params}, RETURN)


REFUSED = {
    "other version": (text(version=2), ["version: expected 1, got 2"]),
    "broken": ("{", ["broken JSON"]),
    "another file": ("<kml>", ["QGC WPL 110", "<kml>"]),
    "no height": (_point(6, None), ["item 2, waypoint, height", "got nothing"]),
    "latitude": (_point(4, 91.5), ["item 2, waypoint, latitude", "91.5"]),
    "swapped": (_point(4, -120.0), ["item 2", "latitude", "swapped"]),
    "text": (_point(6, "ten"), ["item 2, waypoint, parameter 7", "'ten'"]),
    "huge": (_point(6, 10**400), ["parameter 7", "finite"]),
    "passing radius": (_point(2, 5), ["item 2, waypoint, parameter 3", "got 5"]),
    "unknown command": (
        text(TAKEOFF, POINT | {"command": 82}),
        ["item 2 command", "22 (take-off)", "178 (change speed), got 82"],
    ),
    "local frame": (
        text(TAKEOFF, POINT | {"frame": 4}),
        ["item 2, waypoint, frame", "got 4"],
    ),
    "survey without waypoints": (
        text(TAKEOFF, survey(), RETURN),
        ["item 2", "with its waypoints in Items", "ComplexItem 'survey'"],
    ),
    "six params": (
        text(POINT | {"params": [0] * 6}),
        ["item 1 params", "list of 7"],
    ),
    "one number twice": (text(POINT, POINT), ["item 2", "another item"]),
    "WPL version": (WAYPOINTS.replace("110", "120"), ["line 1", "'QGC WPL 120'"]),
    "WPL fields": (WAYPOINTS + "4\t0\n", ["line 6", "12 fields", "got 2"]),
    "WPL number": (WAYPOINTS.replace("\t16\t2", "\t16\tx"), ["line 4: p1", "'x'"]),
}


@pytest.mark.parametrize(("content", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_flown_is_refused_by_name(tmp_path, content, said):
    with pytest.raises(InputError) as caught:
        read(tmp_path, content)
    assert "a.plan" in str(caught.value)
    for part in said:
        assert part in str(caught.value)
