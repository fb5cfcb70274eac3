"""What is kept between runs changes no digit of an answer."""

import os
import subprocess

import pytest

from tests.cli.cli_files import JBLAST

LOG = """sensor,quantity,value,sigma,east_m,north_m,up_m
gate,air_arrival_s,0.1203,0.0005,52.0,11.0,1.5
gate,peak_overpressure_pa,9010,450,52.0,11.0,1.5
mast,air_arrival_s,0.2238,0.0005,-31.0,84.0,4.0
mast,peak_overpressure_pa,4860,240,-31.0,84.0,4.0
"""


@pytest.mark.slow
def test_commands_answer_the_same_from_kept_programs(tmp_path):
    log, cache = tmp_path / "log.csv", tmp_path / "cache"
    log.write_text(LOG)
    for command in (
        ["calc", "--mass", "15", "--range", "20", "--json"],
        ["fit", str(log), "--json"],
    ):
        answers = []
        for keep in ("1", "1", "0"):  # made, read back, without
            child = subprocess.run(
                [*JBLAST, *command],
                env={
                    **os.environ,
                    "XDG_CACHE_HOME": str(cache),
                    "JBLAST_KEEP_PROGRAMS": keep,
                },
                capture_output=True,
                text=True,
                check=True,
            )
            answers.append(child.stdout)
        assert answers[0] == answers[1] == answers[2]
        assert list(cache.rglob("traced-*"))
