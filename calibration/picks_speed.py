"""How many records are picked a second, and how many were by an earlier commit?

    nice python -m calibration.picks_speed [TREE] > calibration/results/picks_speed.txt

Records of 4,096 samples as `picks_records.py` makes them (drift, coloured noise,
rings), picked on one core. What counts is the time of the processor, which other work
on the machine lengthens less than that of the wall, and still does: caches and
memory are shared. So TREE, a checkout of an earlier commit (`git worktree add TREE
COMMIT`), is run beside it: two processes pick the same records in turn, and the ratio
is of their sums. Compiling is the processor's time up to the first picks, nothing kept.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MADE, SEED, ROUNDS, CORES = 320, 21, 3, 2
ROOT = Path(__file__).parents[1]
TURN = "--turn"


def main(*trees: str) -> None:
    """Print the table."""
    from jblast.report.tables import aligned

    named = {"now": str(ROOT)} | ({"before": trees[0]} if trees else {})
    with tempfile.TemporaryDirectory() as empty:
        children = {name: _started(tree, empty) for name, tree in named.items()}
        ready = {name: _answer(child) for name, child in children.items()}
        load = os.getloadavg()[0]
        found = {name: [0.0, 0.0] for name in named}
        for _ in range(ROUNDS):
            for name, child in children.items():
                print(file=child.stdin, flush=True)
                for kind, spent in enumerate(_answer(child)["spent"]):
                    found[name][kind] += spent
        for child in children.values():
            child.communicate()
    counts = ready["now"]["counts"]
    rows = [["records", "", *(f"{name}, ms" for name in named), "a second"]]
    if trees:
        rows[0].append("times as many")
    for kind, words in enumerate(("as they come", "no sensor rings")):
        each = {n: 1e3 * found[n][kind] / (ROUNDS * counts[kind]) for n in named}
        rows.append([f"{ROUNDS} x {counts[kind]}", words])
        rows[-1] += [f"{ms:.2f}" for ms in each.values()]
        rows[-1].append(f"{CORES * 1e3 / each['now']:.0f}")
        if trees:
            rows[-1].append(f"{each['before'] / each['now']:.2f}")
    compiling = ", ".join(f"{n} {ready[n]['compiling']:.0f} s" for n in named)
    print(f"4096 samples, time of the processor a record; load {load:.0f}")
    print(f"a second: by {CORES} cores, if both were as fast as one is here")
    print(f"compiling and tracing: {compiling}\n")
    print("\n".join(aligned(rows)))


def _started(tree: str, cache: str) -> subprocess.Popen:
    """Start a process that picks by the code of a tree, when it is told to."""
    environment = os.environ | {"PYTHONPATH": tree, "XDG_CACHE_HOME": cache}
    return subprocess.Popen(
        [sys.executable, __file__, TURN],
        env=environment | {"JBLAST_KEEP_PROGRAMS": "0"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _answer(child: subprocess.Popen) -> dict:
    """Return what a process says next."""
    assert child.stdout is not None
    return json.loads(child.stdout.readline())


def turns() -> None:
    """Pick once for each line that comes in, and say how long that took."""
    sys.path.pop(0)  # the folder of this file: the tree is on PYTHONPATH
    import jax
    import numpy as np

    from calibration.picks_records import SAMPLES, drawn, noise_of, signal_of
    from jblast.cli.jax_start import start_jax
    from jblast.inference.picks import pick

    start_jax()
    rng = np.random.default_rng(SEED)
    made = drawn(MADE, rng)
    clock = np.arange(SAMPLES, dtype=float)
    kinds = [
        np.array([signal_of(one) + noise_of(one, rng) for one in some])
        for some in (made, [one for one in made if not one.resonance])
    ]

    def spent(samples) -> float:
        begun = time.process_time()
        jax.block_until_ready(pick(clock, samples))
        return time.process_time() - begun

    first = spent(kinds[0][:1])
    for samples in kinds:
        spent(samples)
    counts = [len(samples) for samples in kinds]
    print(json.dumps({"compiling": first, "counts": counts}), flush=True)
    for _ in sys.stdin:
        print(json.dumps({"spent": [spent(x) for x in kinds]}), flush=True)


if __name__ == "__main__":
    if sys.argv[1:] == [TURN]:
        turns()
    else:
        main(*sys.argv[1:2])
