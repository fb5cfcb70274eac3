"""Which tests a change asks for: those of the packages it touched.

    python tests/tools/changed.py [COMMIT]

Prints folders and files of tests for what differs from a commit: the one named, else
main's last tag, else the first. A file that all packages use asks for all tests.
"""

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
TESTS_OF = {
    "notebooks": "tests/test_notebooks.py",
    "calibration": "tests/calibration",
    ".ci": "tests/test_install.py",
    "docs": "tests/test_schemas.py",
}
"""Where the tests are of what stands outside jblast/ and tests/."""
ALWAYS = (
    "tests/test_structure.py",
    "tests/test_install.py",
    "tests/test_pages.py",
)


def asked_for(files: Iterable[str]) -> list[str]:
    """Return the tests that changed files ask for, in order."""
    wanted: set[str] = set(ALWAYS)
    for file in files:
        top, *rest = Path(file).parts
        if top in TESTS_OF:
            wanted.add(TESTS_OF[top])
        elif top == "jblast" and len(rest) > 1:
            wanted.add(_package(*rest))
        elif top == "tests" and len(rest) > 1 and rest[0] != "tools":
            wanted.add(f"tests/{rest[0]}")
        elif top == "tests" and rest[-1].startswith("test_"):
            wanted.add(file)
        elif top in ("jblast", "tests") or file == "pyproject.toml":
            return ["tests"]
    return sorted(test for test in wanted if (ROOT / test).exists())


def _package(*parts: str) -> str:
    """Return the folder of tests of a module; all tests where it has none."""
    folder = f"tests/{parts[0]}"
    return folder if (ROOT / folder).is_dir() else "tests"


def changed_since(commit: str) -> list[str]:
    """Return the files that differ from a commit, new ones included."""
    differ = _git("diff", "--name-only", commit, "--")
    new = _git("ls-files", "--others", "--exclude-standard")
    return sorted({*differ, *new})


def last_tag() -> str:
    """Return main's last tag, or the first commit where there is none."""
    found = _git("tag", "--merged", "HEAD", "--sort=-creatordate")
    return found[0] if found else _git("rev-list", "--max-parents=0", "HEAD")[-1]


def _git(*arguments: str) -> list[str]:
    run = subprocess.run(
        ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if run.returncode:
        sys.exit(f"git {' '.join(arguments)}: {run.stderr.strip()}")
    return run.stdout.split("\n")[:-1]


if __name__ == "__main__":
    since = sys.argv[1] if sys.argv[1:] else last_tag()
    sys.stdout.write(" ".join(asked_for(changed_since(since))) + "\n")
