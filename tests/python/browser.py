"""A headless Chromium, controlled through two pipes with its DevTools protocol; needs only the standard library."""

import fcntl
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

# Software draws WebGL, for the player of a report.
SWITCHES = (
    "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic "
    "--no-first-run --disable-background-networking --disable-component-update --disable-sync "
    "--remote-debugging-pipe --window-size=1300,1000"
).split()
PATIENCE_S = 60


def found() -> str | None:
    """Path of Chromium; None if it is not installed."""
    names = [os.environ.get("CHROMIUM"), "chromium", "chromium-browser", "google-chrome"]
    return next((path for name in names if name and (path := shutil.which(name))), None)


class Browser:
    """A context manager with a temporary profile."""

    def __enter__(self) -> "Browser":
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        theirs_in, ours_out = os.pipe()
        ours_in, theirs_out = os.pipe()
        # Chromium reads from 3 and writes to 4, so neither descriptor may be in use.
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (theirs_in, theirs_out)]

        def wire() -> None:
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        self.process = subprocess.Popen(
            [found(), *SWITCHES, f"--user-data-dir={self.profile.name}", "about:blank"],
            preexec_fn=wire,
            pass_fds=(3, 4),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for fd in (theirs_in, theirs_out, *high):
            os.close(fd)
        os.set_blocking(ours_in, False)
        self.ours_in, self.ours_out, self.unread, self.count = ours_in, ours_out, b"", 0
        self.events: list[dict] = []
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait(PATIENCE_S)
        os.close(self.ours_in)
        os.close(self.ours_out)
        self.profile.cleanup()

    def page(self, path: Path) -> "Page":
        """Opens a file in a tab and waits until it is loaded."""
        target = self.ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        session = self.ask("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        return Page(self, session, path)

    def ask(self, method: str, parameters: dict, session: str | None = None) -> dict:
        """The reply to a command; earlier events are kept."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        os.write(self.ours_out, json.dumps(message).encode() + b"\0")
        answer = self.hear(lambda heard: heard.get("id") == self.count)
        assert "error" not in answer, f"{method}: {answer}"
        return answer["result"]

    def hear(self, wanted) -> dict:
        """The next matching message; it and earlier ones are kept as events."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            *messages, self.unread = self.unread.split(b"\0")
            heard = [json.loads(message) for message in messages]
            self.events += [message for message in heard if "method" in message]
            for message in heard:
                if wanted(message):
                    return message
            try:
                self.unread += os.read(self.ours_in, 1 << 16)
            except BlockingIOError:
                assert self.process.poll() is None, "chromium is gone"
                time.sleep(0.01)
        raise TimeoutError("chromium does not answer")


class Page:
    """A loaded file."""

    def __init__(self, browser: Browser, session: str, path: Path) -> None:
        self.browser, self.session, self.url = browser, session, path.resolve().as_uri()
        for domain in ("Page", "Runtime", "Log", "Network"):
            browser.ask(f"{domain}.enable", {}, session)
        browser.ask("Page.navigate", {"url": self.url}, session)
        if not self.events("Page.loadEventFired"):
            browser.hear(lambda heard: heard.get("method") == "Page.loadEventFired")

    def events(self, method: str) -> list[dict]:
        """The events so far."""
        mine = [event for event in self.browser.events if event.get("sessionId") == self.session]
        return [event["params"] for event in mine if event["method"] == method]

    def evaluate(self, script: str):
        """The value of an expression in the page."""
        asked = {"expression": script, "returnByValue": True}
        answer = self.browser.ask("Runtime.evaluate", asked, self.session)
        assert "exceptionDetails" not in answer, answer
        return answer["result"]["value"]

    def complaints(self) -> list[str]:
        """Errors and warnings of the console, and scripts that failed."""
        said = [
            str(e["args"])
            for e in self.events("Runtime.consoleAPICalled")
            if e["type"] in ("error", "warning", "assert")
        ]
        logged = [
            e["entry"]["text"] for e in self.events("Log.entryAdded") if e["entry"]["level"] in ("error", "warning")
        ]
        return said + logged + [str(e) for e in self.events("Runtime.exceptionThrown")]

    def requests(self) -> list[str]:
        """Requests other than the page itself."""
        urls = [event["request"]["url"] for event in self.events("Network.requestWillBeSent")]
        return [url for url in urls if url != self.url]
