"""Which worker runs which files: they begin at the two ends of one list.

A plugin of pytest-xdist. With `--dist loadfile` whoever is free takes the next file, so
that neighbours run at once: both workers compile, and trace, what the files of one room
share. Here every other worker takes files from the end, and a room is one worker's but
for the one in which they meet. Where `--first` tells what comes first, that holds.
"""

import pytest
from xdist.scheduler.loadfile import LoadFileScheduling
from xdist.workermanage import WorkerController


class TwoEnds(LoadFileScheduling):
    """Hands out files from the front, and to every other worker from the end."""

    def _assign_work_unit(self, node: WorkerController) -> None:
        if self.nodes.index(node) % 2:
            last = next(reversed(self.workqueue))
            self.workqueue.move_to_end(last, last=False)
        super()._assign_work_unit(node)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log) -> TwoEnds | None:
    whole_files = config.getoption("dist") == "loadfile"
    return (
        TwoEnds(config, log) if whole_files and not config.getoption("first") else None
    )
