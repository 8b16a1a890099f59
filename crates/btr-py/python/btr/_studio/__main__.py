"""`python -m btr._studio MODEL LOG...`: the studio, for the command `btr`."""

from __future__ import annotations

import argparse
import sys

from btr._btr import BtrError
from btr._studio import studio


def main(arguments: list[str] | None = None) -> int:
    """Opens the page. Returns the exit code: 2 for input that cannot be used."""
    parser = argparse.ArgumentParser("btr studio", description="Opens a local web page on a model and its logs")
    parser.add_argument("model", help="the model (TOML)")
    parser.add_argument("logs", nargs="+", metavar="log", help="training logs (MCAP or CSV)")
    parser.add_argument("--held-out", nargs="+", default=[], metavar="LOG", help="held-out logs, which are not fitted")
    parser.add_argument("--folder", default=".", help="where the page saves models (default: here)")
    parser.add_argument("--host", default="127.0.0.1", help="where it listens (default: 127.0.0.1, this machine alone)")
    parser.add_argument("--port", type=int, default=8080, help="the first port to try (default: 8080)")
    parser.add_argument("--no-browser", action="store_true", help="do not open the browser")
    given = parser.parse_args(arguments)
    try:
        studio(
            given.model,
            given.logs,
            held_out=given.held_out,
            folder=given.folder,
            host=given.host,
            port=given.port,
            browser=not given.no_browser,
        )
    except (BtrError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
