"""The command line: picks the verb, turns errors into one message and an exit code.

Exit codes: 0 answered; 1 our own failure; 2 bad input; 3 nothing found; 4 computed, but
not converged, not identifiable or not good enough.
"""

import contextlib
import io
import os
import sys
import traceback
import warnings
from collections.abc import Sequence

from jblast.cli.arguments.options import option_for
from jblast.cli.parsers import parsed, root_parser
from jblast.cli.progress_line import progress_told
from jblast.errors import InputError

CLOSED_PIPE, INTERRUPTED = 128 + 13, 128 + 2
"""What a shell expects of a command that SIGPIPE or SIGINT ended."""


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
    words = sys.argv[1:] if arguments is None else arguments
    if not words:
        sys.stderr.write(root_parser().format_help())
        return 2
    debug = "--debug" in words
    try:
        asked = parsed(words)
        debug = asked.debug
        progress_lines = (
            progress_told(asked.verb)
            if progress and asked.progress
            else contextlib.nullcontext()
        )
        with warnings.catch_warnings(), progress_lines:
            warnings.showwarning = _say
            code = asked.run(asked)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # `| head`: who reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED_PIPE
    except InputError as error:
        if debug:
            traceback.print_exc()
        sys.stderr.write(f"jblast: {error.worded(option_for)}\n")
        return 2
    except OSError as error:
        if debug:
            traceback.print_exc()
        sys.stderr.write(f"jblast: {error.strerror or error}: cannot go on\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write("jblast: interrupted\n")
        return INTERRUPTED
    except Exception as error:
        if debug:
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
