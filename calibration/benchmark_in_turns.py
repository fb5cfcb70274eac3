"""A benchmark whose timed stretches run while another process waits, by its processor.

    python calibration/benchmark_in_turns.py NAME TURN DONE

`benchmarks_before` starts one for each of two trees, with the tree on PYTHONPATH. TURN
and DONE are file descriptors: where a benchmark reads its clock for the first time a
byte goes to DONE and one is waited for from TURN; where it reads it again, a byte goes
to DONE. The clock is the processor's, all cores together, so that what else runs on the
machine counts little. Of a tree that has no such benchmark the one beside this file
runs, on the tree's package.
"""

import importlib.util
import os
import runpy
import sys
import time
from collections.abc import Callable
from pathlib import Path


def taking_turns(turn: int, done: int) -> Callable[[], float]:
    """Return a clock [s]; the first, third ... time it is read it waits for its turn.

    Args:
        turn: File descriptor from which a byte says that it is ours.
        done: File descriptor that is told when we wait, and when we have ended.
    """
    is_ours = False

    def now() -> float:
        nonlocal is_ours
        caller = os.path.basename(sys._getframe(1).f_code.co_filename)
        if not (caller.startswith("benchmark_") or caller == "timing.py"):
            return time.process_time()
        is_ours = not is_ours
        if not is_ours:
            end = time.process_time()
            os.write(done, b".")
            return end
        os.write(done, b".")
        os.read(turn, 1)
        return time.process_time()

    return now


def main() -> None:
    """Run a benchmark by such a clock."""
    name, turn, done = sys.argv[1:]
    sys.path.pop(0)
    time.perf_counter = taking_turns(int(turn), int(done))
    sys.argv = ["benchmarks", name]
    if importlib.util.find_spec(f"calibration.benchmark_{name}"):
        runpy.run_module("calibration.benchmarks", run_name="__main__")
    else:
        mine = Path(__file__).with_name(f"benchmark_{name}.py")
        runpy.run_path(str(mine), run_name="__main__")


if __name__ == "__main__":
    main()
