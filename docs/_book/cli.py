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
    listed = re.search(r"^Commands:\n(.*?)\n\n", whole, re.M | re.S)
    assert listed is not None, "btr --help lists its commands"
    verbs = [verb for verb in re.findall(r"^  (\w+)", listed[1], re.M) if verb != "help"]
    sections = [("btr", whole), *((f"btr {verb}", _help(verb)) for verb in verbs)]
    return BEGIN + "".join(f"\n## {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in sections)


def _help(*verb: str) -> str:
    run = subprocess.run([sys.executable, "-m", "btr", *verb, "--help"], capture_output=True, text=True, check=True)
    return run.stdout
