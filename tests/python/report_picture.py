"""Takes docs/report.png: the report of a diagnosis of the desk arm, as it opens in headless Chromium.

    cargo build --release && python3 tests/python/report_picture.py
"""

import base64
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from browser import Browser
from program import BTR

ROOT = Path(__file__).parents[2]
SIZE = {"width": 1200, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
# The robot is drawn by then.
DRAWN_S = 2


def report(path: Path) -> None:
    """The report, with paths as a reader has them."""
    logs = {
        name: [str(log.relative_to(ROOT)) for log in sorted(ROOT.glob(f"robots/arm/{name}_*.csv"))]
        for name in ("learn", "held_out")
    }
    command = [BTR, "diagnose", "robots/arm.toml", *logs["learn"], "--held-out", *logs["held_out"]]
    subprocess.run([*command, "--report", str(path), "-q"], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    if BTR is None:
        sys.exit("no btr executable: set BTR, or build it")
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        path = Path(folder) / "why.html"
        report(path)
        page = browser.page(path)
        browser.ask("Emulation.setDeviceMetricsOverride", SIZE, page.session)
        browser.ask("Emulation.setScrollbarsHidden", {"hidden": True}, page.session)
        time.sleep(DRAWN_S)
        taken = browser.ask("Page.captureScreenshot", {"format": "png"}, page.session)
        assert not page.complaints(), page.complaints()
    (ROOT / "docs" / "report.png").write_bytes(base64.b64decode(taken["data"]))


if __name__ == "__main__":
    main()
