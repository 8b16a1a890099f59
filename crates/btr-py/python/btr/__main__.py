"""The command `btr`."""

import sys

from btr._btr import command


def main() -> int:
    """Does what the command line says; gives back the exit code."""
    return command(["btr", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
