"""Blocks: what hand-written pages take from parsers and tables, by a marker.

A line `<!-- jblast: NAME -->` of a page is replaced by what the function of that name
writes, so that no page tells by hand what a table says.
"""

import re
from collections.abc import Callable

from docs.generate import answer_tables, command_line, scene_tables

MARKER = re.compile(r"^<!-- jblast: (\w+) -->$", re.MULTILINE)
BLOCKS: dict[str, Callable[[], str]] = {
    "command_line": command_line.verbs,
    "answer_of_fit": answer_tables.fit,
    "answer_of_pick": answer_tables.pick,
    "answer_of_one_pick": answer_tables.one_pick,
    "answer_of_bound": answer_tables.bound,
    "answer_of_calc": answer_tables.calc,
    "inputs_of_calc": answer_tables.calc_inputs,
    "answer_of_detect_film": answer_tables.detect_film,
    "answer_of_one_flash": answer_tables.one_flash,
    "answer_of_render": answer_tables.render,
    "answer_of_events": answer_tables.events,
    "answer_of_study": answer_tables.study,
    "answer_of_one_outcome": answer_tables.one_outcome,
    "answer_of_choose": answer_tables.choose,
    "answer_of_fly": answer_tables.fly,
    "answer_of_fly_mission": answer_tables.fly_mission,
    "answer_of_discover": answer_tables.discover,
    "answer_of_tune": answer_tables.tune,
    "answer_of_one_tuned": answer_tables.one_tuned,
    "answer_of_tune_gains": answer_tables.tune_gains,
    "answer_of_tried_gains": answer_tables.tried_gains,
    "answer_of_world": answer_tables.world,
    "answer_of_study_report": answer_tables.study_report,
    "answer_of_study_report_outcome": answer_tables.study_report_outcome,
    "answer_of_study_report_shares": answer_tables.study_report_shares,
    "answer_of_study_report_input": answer_tables.study_report_input,
    "answer_of_serve": answer_tables.serve,
    "answer_of_serve_mavlink": answer_tables.serve_mavlink,
    "answer_of_serve_ground_station": answer_tables.serve_ground_station,
    "answer_of_check": answer_tables.check,
    "answer_of_stability": answer_tables.stability,
    "quantities": scene_tables.quantities,
    "units": scene_tables.units,
    "columns": scene_tables.columns,
    "scene_numbers": scene_tables.numbers,
    "scene_world_numbers": scene_tables.world_numbers,
    "scene_keys": scene_tables.keys_of_tables,
    "scene_lists": scene_tables.lists,
    "scene_words": scene_tables.words,
    "sensor_kinds": scene_tables.sensor_kinds,
    "explosives": scene_tables.explosives,
}


def filled(markdown: str) -> str:
    """Return a page with each marker replaced by its block."""
    return MARKER.sub(lambda match: BLOCKS[match[1]]().strip(), markdown)
