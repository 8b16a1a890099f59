"""One local web page for a model and its logs: where the model fails, what it lacks, and the model that has it.

    btr.studio("arm.toml", ["monday.csv", "tuesday.csv"], held_out=["friday.csv"])

Needs viser: `pip install 'btr[studio]'`. `btr studio` does the same in a shell.
"""

from __future__ import annotations

import contextlib
import io
import os
import time
import webbrowser
from collections.abc import Iterable
from typing import Union

from btr._optional import needed
from btr._sources import LogLike
from btr.model import Model, loaded

__all__ = ["studio"]


def studio(
    model: Union[Model, str, os.PathLike[str]],
    logs: Union[LogLike, Iterable[LogLike]],
    *,
    held_out: Union[LogLike, Iterable[LogLike], None] = None,
    folder: Union[str, os.PathLike[str]] = ".",
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
) -> None:
    """Opens a page on a model and its logs, and returns when the user presses Ctrl-C.

    The page shows the robot as measured with the model as a ghost, each channel's error beside the noise, and where the
    model fails. It asks `diagnose` what is missing, fits what is added, and saves the model, its report and scripts
    that do the same into `folder`, under new names. It is served at `host` and the first free port from `port` on, and
    only to browsers that open the printed address; with `browser` this is done at once. Raises `BtrError` if the model
    or all of the logs cannot be read, `ImportError` without viser."""
    # What is wrong with the model counts first: a page would not help.
    first = loaded(model)
    needed("viser", "studio")
    # Without viser these cannot be imported.
    from btr._studio.page import Page
    from btr._studio.robot import robot_of
    from btr._studio.server import serve
    from btr._studio.session import Session

    session = Session(first, logs, held_out, folder=folder)
    robot = robot_of(session.model)
    server, address = serve(host, port)
    page = Page(server, session, robot)
    print(f"btr studio: {address}\nCtrl-C ends it", flush=True)
    if browser:
        webbrowser.open(address)
    try:
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        pass
    finally:
        page.end()
        # viser tells that it ends, as if it had told that it began.
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
