"""The btr executable under test: the variable BTR, an installed one, or the one built here."""

import os
import shutil
from pathlib import Path

BUILT = Path(__file__).parents[2] / "target" / "release" / "btr"
BTR = os.environ.get("BTR") or shutil.which("btr") or (str(BUILT) if BUILT.exists() else None)
