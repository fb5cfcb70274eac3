"""Write a mission plan: take-off, lanes over a field or a circle, return, landing.

QGroundControl opens the plan, and a scene's vehicle flies it with [vehicle] mission =
"FILE.plan".

example:
  jblast plan field.plan --grid 40,20,10 --home 35.3075,-80.7353,200 --up 15

input:
  --grid WIDTH,DEPTH,SPACING  numbers; lanes over a field: width from east to west,
      depth from north to south, and spacing [m]
  --orbit RADIUS[,TURNS]  numbers; circle: radius [m], clockwise, or counter-clockwise
      if negative, and number of turns (default: 1)
  --home LAT,LON[,ALT]!  numbers; take-off position: latitude and longitude [degree],
      and height above the sea [m] (default: 0)
  --up M               positive = 30; height above home [m]
  --at EAST,NORTH      numbers; centre of the pattern, relative to home [m]
      (default: 0,0)
  --speed M/S          positive; speed of the flight [m/s] (default: none in the plan)
output:
  OUT.plan             path; plan of QGroundControl
  --force              permission to overwrite an existing file
"""

import argparse
import sys

from jblast.errors import InputError
from jblast.files import refuse_existing, save


def run(options: argparse.Namespace) -> int:
    """Write the plan and return the exit code."""
    from jblast.missions.plan import plan_text
    from jblast.missions.route import grid_plan, orbit_plan
    from jblast.scene import Place

    if (options.grid is None) == (options.orbit is None):
        raise InputError("expected either --grid or --orbit")
    refuse_existing(options.out, force=options.force)
    home, centre = Place(*options.home), options.at or (0.0, 0.0)
    common = {"up_m": options.up, "centre_m": centre, "speed_m_s": options.speed}
    if options.grid:
        width, depth, spacing = options.grid
        plan = grid_plan(
            home, width_m=width, depth_m=depth, spacing_m=spacing, **common
        )
    else:
        radius, turns = (*options.orbit, 1.0)[:2]
        plan = orbit_plan(home, radius_m=radius, turns=turns, **common)
    save(options.out, plan_text(plan, options.out))
    sys.stdout.write(f"wrote {options.out}: {len(plan.items)} items\n")
    return 0
