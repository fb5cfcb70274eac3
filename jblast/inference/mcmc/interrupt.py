"""Ctrl-C that ends a loop, and is not lost."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts() -> Iterator[list[int]]:
    """End what is inside at Ctrl-C, and note it.

    One that Python raises within a destructor is swallowed there: then the note alone
    is left, for the loop to look at.

    Yields:
        A list that grows by each. Only the main thread receives signals.
    """
    noted: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()

    def note(number, frame):
        noted.append(number)
        raise KeyboardInterrupt

    if main and before is signal.default_int_handler:
        signal.signal(signal.SIGINT, note)
    try:
        yield noted
    except KeyboardInterrupt:
        noted.append(signal.SIGINT)
    finally:
        if signal.getsignal(signal.SIGINT) is note:
            signal.signal(signal.SIGINT, before)
