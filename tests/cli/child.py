"""What commands say and load in a process of their own; one child answers for all."""

import functools
import json
import subprocess
import sys
from typing import NamedTuple

QUESTIONS = (
    ("--help",),
    ("calc", "--help"),
    ("bound", "--help"),
    ("choose", "--help"),
    ("clac",),
)

CHILD = """
import contextlib, io, json, os, sys
for words in json.loads(sys.argv[1]):
    if not os.fork():  # each command has modules of its own
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
            from jblast.cli.main import main
            main(words)
        print(json.dumps([said.getvalue(), sorted(sys.modules)]), flush=True)
        os._exit(0)
    if os.wait()[1]:
        sys.exit(f"{words} did not end")
"""


class Told(NamedTuple):
    """What a command wrote to stdout, and the modules that were loaded by then."""

    out: str
    modules: frozenset[str]


@functools.cache
def told() -> dict[tuple[str, ...], Told]:
    """Ask all questions."""
    run = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(QUESTIONS)],
        check=True,
        capture_output=True,
        text=True,
    )
    lines = map(json.loads, run.stdout.splitlines())
    return {
        words: Told(out, frozenset(modules))
        for words, (out, modules) in zip(QUESTIONS, lines, strict=True)
    }
