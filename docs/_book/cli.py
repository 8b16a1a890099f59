"""The reference of the command line, from its help."""

from __future__ import annotations

import re
import subprocess
import sys

BEGIN = """# Command line

What `btr --help` and `btr VERB --help` print. Exit codes are [on a page of their own](exit-codes.md).
"""


def page() -> str:
    """One section per verb."""
    whole = _help()
    # In groups, before the options.
    verbs = re.findall(r"^  (\w+) ", whole.partition("\nOptions:\n")[0], re.M)
    assert verbs, "btr --help lists its verbs before its options"
    sections = [("btr", whole), *((f"btr {verb}", _help(verb)) for verb in verbs)]
    return BEGIN + "".join(f"\n## {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in sections)


def _help(*verb: str) -> str:
    run = subprocess.run([sys.executable, "-m", "btr", *verb, "--help"], capture_output=True, text=True, check=True)
    return run.stdout
