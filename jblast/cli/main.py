"""Entry point of the command line: it runs a verb and reports errors in one line."""

import argparse
import contextlib
import io
import os
import sys
import textwrap
import traceback
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from jblast import __version__
from jblast.cli.options import option_for
from jblast.cli.spec import WIDTH, VerbParser
from jblast.cli.verbs import LIST, VERBS
from jblast.errors import InputError, closest, nearest
from jblast.progress import clear, printed_progress

CLOSED_PIPE, INTERRUPTED = 128 + 13, 128 + 2
"""Exit codes of a command ended by SIGPIPE or SIGINT, by convention of shells."""
PROLOGUE = "Differentiable blast physics: fit a blast from sensor recordings."
EPILOGUE = (
    "Start with: jblast fit OBSERVATIONS.csv, or jblast calc --mass 15 --range 20. "
    "Options and an example of a verb: jblast VERB --help. Exit codes: 0 success; "
    "1 internal failure; 2 bad input; 3 nothing found; 4 computed, but not converged, "
    "not identifiable or not accurate enough. "
    "For safety engineering, forensics and sensing; designs no explosives."
)


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
    # Before NumPy is imported. Matrices have some ten columns: more threads wait for
    # each other, and picks take 2 to 4 times as long on two cores.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
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


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line.

    Raises:
        InputError: An option has a value that cannot be used.
        SystemExit: Help is requested (0); a verb or an option is unknown, or a required
            argument is missing (2).
    """
    root = root_parser()
    # Only the first word: subparsers of argparse would need the options of all verbs,
    # and would import every module.
    name = root.parse_args(words[:1]).verb
    if name not in VERBS:
        _refuse_verb(root, name)
    # `parse_args` would end with a message that names no similar option.
    parser = verb_parser(name)
    options, unknown = parser.parse_known_args(words[1:])
    if unknown:
        parser.refuse(unknown)
    # Reports and runs store the command line that made them.
    options.words = ("jblast", *words)
    return options


def verb_parser(name: str) -> VerbParser:
    """Return the parser of one verb; no other verb is imported."""
    module = import_module(f"jblast.cli.verbs.{name}")
    parser = VerbParser(f"jblast {name}", module.__doc__ or "")
    shown = getattr(module, "PROGRESS", True)
    parser.set_defaults(progress=shown, verb=name, run=module.run)
    return parser


def root_parser() -> argparse.ArgumentParser:
    """Return the parser of the first word, whose help lists the verbs."""
    root = argparse.ArgumentParser(
        prog="jblast",
        usage="%(prog)s [-h] [--version] VERB ...",
        description=f"{PROLOGUE}\n\n{LIST.rstrip()}",
        epilog=textwrap.fill(EPILOGUE, WIDTH),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    root.add_argument("--version", action="version", version=f"jblast {__version__}")
    # The description lists the verbs by group; argparse would list them once more.
    root.add_argument("verb", metavar="VERB", help=argparse.SUPPRESS)
    return root


def _refuse_verb(root: argparse.ArgumentParser, name: str) -> NoReturn:
    """Print the known verbs, with the usage of the nearest; exit 2."""
    close = closest(name, VERBS)
    # Usage of the verb that was probably meant; without one, of the root.
    parser = root if close is None else verb_parser(close)
    parser.print_usage(sys.stderr)
    known = ", ".join(map(repr, VERBS))
    root.exit(
        2,
        f"jblast: error: argument VERB: invalid choice: {name!r} "
        f"(choose from {known}){nearest(name, VERBS)}\n",
    )


if __name__ == "__main__":
    sys.exit(main())
