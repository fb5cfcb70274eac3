"""`python -m jblast` runs the command `jblast`."""

import sys

from jblast.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
