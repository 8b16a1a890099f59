"""`python -m btr._mujoco FILE [ROOT]`: the robot of a MuJoCo model as JSON, for the command `btr`."""

import json
import sys

from btr._btr import BtrError
from btr._mujoco import described


def main() -> int:
    """Prints the description, or the error, as one JSON document. Returns the exit code."""
    path, *root = sys.argv[1:]
    try:
        print(json.dumps({"robot": described(path, *root)}))
    except (BtrError, ImportError) as error:
        message, _, help_ = str(error).partition("\nhelp: ")
        return _refused(message, help_)
    # The user gets a sentence instead of a traceback, also where MuJoCo's Python fails in another way.
    except Exception as error:
        what = " ".join(str(error).split())
        return _refused(f"{path}: it cannot be read as a MuJoCo model: {type(error).__name__}: {what}", "")
    return 0


def _refused(message: str, help_: str) -> int:
    print(json.dumps({"error": {"message": message, "help": help_ or None}}))
    return 2


if __name__ == "__main__":
    sys.exit(main())
