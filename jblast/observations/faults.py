"""What is wrong with a log: the first fault is raised, or all of them are gathered."""

from jblast.errors import InputError


class Faults:
    """Where a reader takes what it cannot use.

    Args:
        gathered: Faults are appended here, and reading goes on; None: the first is
            raised.
    """

    def __init__(self, gathered: list[InputError] | None = None):
        self.gathered = gathered

    def tell(self, fault: InputError) -> None:
        """Take a fault that the rest of the log can be read without.

        Raises:
            InputError: The fault, where nobody gathers them.
        """
        if self.gathered is None:
            raise fault
        self.gathered.append(fault)
