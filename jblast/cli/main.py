"""Entry point of the command line: it runs a verb and reports errors in one line.

Exit codes: 0 success; 1 internal failure; 2 bad input; 3 nothing found; 4 computed, but
not converged, not identifiable or not accurate enough.
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
from jblast.errors import InputError
from jblast.progress import clear, printed_progress

CLOSED_PIPE, INTERRUPTED = 128 + 13, 128 + 2
"""Exit codes of a command ended by SIGPIPE or SIGINT, by convention of shells."""


def main(arguments: Sequence[str] | None = None, *, progress: bool = True) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: Words after "jblast"; None for those of this process.
        progress: Whether to print progress on stderr.
    """
    if sys.stdout is None:  # closed by the shell: `>&-`
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (stays open to the end)
    if isinstance(sys.stdout, io.TextIOWrapper):  # an ASCII terminal, "é" in a name
        sys.stdout.reconfigure(errors="backslashreplace")
    words = sys.argv[1:] if arguments is None else arguments
    if not words:
        sys.stderr.write(root_parser().format_help())
        return 2
    # also for errors before the options are parsed
    debug = "--debug" in words
    try:
        options = parsed(words)
        debug = options.debug
        progress_lines = (
            printed_progress(options.verb)
            if progress and options.progress
            else contextlib.nullcontext()
        )
        # restored afterwards, as tests and notebooks call `main` in their own process
        with warnings.catch_warnings(), progress_lines:
            warnings.showwarning = _print_warning
            code = options.run(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # as with `| head`
        # Python flushes stdout at exit, which would fail again on the closed pipe
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
        sys.stderr.write(f"jblast: {error.strerror or error}: cannot continue\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write("jblast: interrupted\n")
        return INTERRUPTED
    except Exception as error:
        if debug:
            traceback.print_exc()
        sys.stderr.write(
            f"jblast: internal failure: {type(error).__name__}: {error} "
            "(--debug prints the traceback; please report it)\n"
        )
        return 1


def _print_warning(message, category, filename, lineno, file=None, line=None) -> None:
    """Print a warning as one line."""
    clear()
    sys.stderr.write(f"jblast: warning: {' '.join(str(message).split())}\n")


if __name__ == "__main__":
    sys.exit(main())
