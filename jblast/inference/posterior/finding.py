"""What is to be told beside the numbers, as a value."""

import re
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Finding:
    """Something to be told beside the numbers: what it is, and its own numbers.

    It has no words: `report.fit.findings` has them.
    """

    @property
    def code(self) -> str:
        """Its name for programs: `law_out_of_range`."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", type(self).__name__).lower()

    def to_dict(self) -> dict[str, Any]:
        """Return its name and its numbers."""
        return {"code": self.code} | {
            f.name: getattr(self, f.name) for f in fields(self)
        }
