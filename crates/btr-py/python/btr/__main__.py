"""The command `btr`."""

import signal
import sys

from btr._btr import command


def main() -> int:
    """Does what the command line says; gives back the exit code."""
    # Python would only make a note of Ctrl-C and heed it when all is done.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return command(["btr", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
