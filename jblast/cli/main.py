"""The command line: picks the verb, turns errors into one message and an exit code.

Exit codes: 0 answered; 1 our own failure; 2 bad input; 4 computed, but not converged,
not identifiable or not good enough.
"""

import argparse
import contextlib
import io
import os
import re
import sys
import traceback
import warnings
from collections.abc import Sequence

from jblast import __version__
from jblast.cli import (
    bound,
    calc,
    chart,
    choose,
    discover,
    events,
    fit,
    fly,
    render,
    scene,
    simulate,
    stability,
)
from jblast.cli.progress_line import progress_told
from jblast.errors import InputError

VERBS = (
    fit,
    calc,
    bound,
    choose,
    scene,
    simulate,
    render,
    events,
    fly,
    chart,
    stability,
    discover,
)
NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?([:,].*)?$", re.IGNORECASE)
CLOSED_PIPE = 128 + 13
INTERRUPTED = 128 + 2
"""What a shell expects of a command that SIGPIPE or SIGINT ended."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all verbs."""
    root = argparse.ArgumentParser(
        prog="jblast",
        description="Differentiable blast physics: fit a blast from sensor recordings.",
        epilog="Start with: jblast fit OBSERVATIONS.csv, or jblast calc --mass 15 "
        "--range 20. Exit codes: 0 answered; 1 our own failure; 2 bad input; "
        "4 computed, but not converged, not identifiable or not good enough. "
        "For safety engineering, forensics and sensing; designs no explosives.",
    )
    root.add_argument("--version", action="version", version=f"jblast {__version__}")
    verbs = root.add_subparsers(dest="verb", required=True, metavar="VERB")
    for module in VERBS:
        name = module.__name__.rsplit(".", 1)[-1]
        verb = verbs.add_parser(name, help=module.HELP, description=module.__doc__)
        # argparse itself takes -1 for a number, but -1e-1 and -1:2 for options
        verb._negative_number_matcher = NEGATIVE
        module.add_arguments(verb)
        verb.add_argument(
            "--debug", action="store_true", help="show the traceback of an error"
        )
        verb.set_defaults(run=module.run)
    return root


def main(arguments: Sequence[str] | None = None, *, progress: bool = True) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: What follows "jblast"; None: those of this process.
        progress: Whether to say on stderr how far it has come.
    """
    if sys.stdout is None:  # closed by the shell: `>&-`
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (stays open to the end)
    if isinstance(sys.stdout, io.TextIOWrapper):  # a terminal may lack a sensor's "é"
        sys.stdout.reconfigure(errors="backslashreplace")
    root = parser()
    if not (sys.argv[1:] if arguments is None else arguments):
        sys.stderr.write(root.format_help())
        return 2
    asked = root.parse_args(arguments)
    try:
        told = progress_told(asked.verb) if progress else contextlib.nullcontext()
        with warnings.catch_warnings(), told:
            warnings.showwarning = _say
            code = asked.run(asked)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # `| head`: who reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED_PIPE
    except InputError as error:
        if asked.debug:
            traceback.print_exc()
        sys.stderr.write(f"jblast: {error}\n")
        return 2
    except OSError as error:
        if asked.debug:
            traceback.print_exc()
        sys.stderr.write(f"jblast: {error.strerror or error}: cannot go on\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write("jblast: interrupted\n")
        return INTERRUPTED
    except Exception as error:
        if asked.debug:
            traceback.print_exc()
        sys.stderr.write(
            f"jblast: internal failure: {type(error).__name__}: {error} "
            "(--debug shows where; please report it)\n"
        )
        return 1


def _say(message, category, filename, lineno, file=None, line=None) -> None:
    """Print a warning as one line."""
    sys.stderr.write(f"jblast: warning: {' '.join(str(message).split())}\n")


if __name__ == "__main__":
    sys.exit(main())
