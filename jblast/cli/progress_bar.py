"""How far a command has come, on a terminal alone."""

import sys

LENGTH = 20


def show_progress(done: int, total: int, what: str = "frame") -> None:
    """Write the bar over the last one; clear it at the end."""
    if not sys.stderr.isatty():
        return
    bar = "#" * (LENGTH * done // total)
    end = "\r" + " " * 50 + "\r" if done == total else ""
    sys.stderr.write(f"\r[{bar:{LENGTH}}] {what} {done:,} of {total:,}{end}")
    sys.stderr.flush()
