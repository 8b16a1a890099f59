"""`python -m btr._studio MODEL LOG...` or `RUN`: the studio, for the command `btr`."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import warnings

from btr._btr import BtrError
from btr._studio import studio


def main(arguments: list[str] | None = None) -> int:
    """Opens the page. Returns the exit code: 2 for input that cannot be used."""
    what = "Opens a local web page on a model and its logs, or on a run"
    parser = argparse.ArgumentParser("btr studio", description=what)
    parser.add_argument("model", help="the model (TOML), or the folder of a run")
    parser.add_argument("logs", nargs="*", metavar="log", help="training logs (MCAP or CSV); none for a run")
    parser.add_argument("--held-out", nargs="+", default=[], metavar="LOG", help="held-out logs, which are not fitted")
    parser.add_argument("--experiment", help="the file that a run began with, beside the files that it names")
    parser.add_argument("--folder", default=".", help="where the page saves models (default: here)")
    parser.add_argument("--host", default="127.0.0.1", help="where it listens (default: 127.0.0.1, this machine alone)")
    parser.add_argument("--port", type=int, default=8080, help="the first port to try (default: 8080)")
    parser.add_argument("--no-browser", action="store_true", help="do not open the browser")
    parser.add_argument("--with-stdin", action="store_true", help="end with the standard input")
    given = parser.parse_args(arguments)
    if given.with_stdin:
        threading.Thread(target=_end_with_stdin, daemon=True).start()
    # Where in this program a warning was raised is nothing to a user.
    warnings.showwarning = lambda text, *_, **__: print(f"warning: {text}", file=sys.stderr)
    try:
        studio(
            given.model,
            given.logs or None,
            held_out=given.held_out,
            experiment=given.experiment,
            folder=given.folder,
            host=given.host,
            port=given.port,
            browser=not given.no_browser,
        )
    except (BtrError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _end_with_stdin() -> None:
    """Ends this process with the standard input, which another one holds open while it runs."""
    while os.read(0, 1024):
        pass
    # Jobs in the background ignore Ctrl-C, and nothing is left to be written.
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main())
