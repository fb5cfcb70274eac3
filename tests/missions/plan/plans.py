"""Plans as ground stations write them."""

import json
from typing import Any

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
