"""The command `btr`."""

import os
import signal
import sys

from btr._btr import command


def main() -> int:
    """Runs the command line and returns the exit code."""
    # By default Python handles Ctrl-C only after the compiled call returns.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # `btr new` reads MuJoCo models and xacro files with this interpreter, `btr studio` serves its page, unless another
    # one was named.
    os.environ.setdefault("BTR_PYTHON", sys.executable)
    return command(["btr", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
