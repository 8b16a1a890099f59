"""One local web page for a model and its logs: where the model fails, what it lacks, and the model that has it; or for
a run of the Back-to-Reality loop.

    btr.studio("arm.toml", ["monday.csv", "tuesday.csv"], held_out=["friday.csv"])
    btr.studio("runs/nao")

Needs viser: `pip install 'btr[studio]'`. `btr studio` does the same in a shell.
"""

from __future__ import annotations

import contextlib
import io
import os
import time
import webbrowser
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Protocol, Union

from btr._inputs import wrong
from btr._optional import needed
from btr._sources import LogLike
from btr.model import Model, loaded

if TYPE_CHECKING:
    from btr._studio.server import Server

__all__ = ["studio"]


def studio(
    model: Union[Model, str, os.PathLike[str]],
    logs: Union[LogLike, Iterable[LogLike], None] = None,
    *,
    held_out: Union[LogLike, Iterable[LogLike], None] = None,
    experiment: Union[str, os.PathLike[str], None] = None,
    folder: Union[str, os.PathLike[str]] = ".",
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
) -> None:
    """Opens a page on a model and its logs, or on a run of `coevolve`, and returns when the user presses Ctrl-C.

    With logs, the page shows the robot as measured with the model as a ghost, each channel's error beside the noise,
    and where the model fails. It asks `diagnose` what is missing, fits what is added, and saves the model, its report
    and scripts that do the same into `folder`, under new names.

    Without logs, `model` is the folder of a run, which may still grow: `btr.studio("runs/nao")`. The page shows its
    generations, fitness, phi and parameters, all tried controllers side by side, and each real test beside its
    simulations before and after. Nothing is written there. `experiment` is the file that the run began with, if that
    names other files, such as a URDF.

    The page is served at `host` and the first free port from `port` on, and only to browsers that open the printed
    address; with `browser` this is done at once. Raises `BtrError` if the model or all of the logs cannot be read, or
    if the folder holds no run, and `ImportError` without viser."""
    if logs is None:
        if isinstance(model, Model):
            raise wrong("no log is given", "name at least one log, or the folder of a run instead of a model")
        _serve(_of_run(model, experiment), host, port, browser)
    else:
        _serve(_of_logs(model, logs, held_out, folder), host, port, browser)


class _Page(Protocol):
    def end(self) -> None: ...


def _of_run(
    folder: Union[str, os.PathLike[str]], experiment: Union[str, os.PathLike[str], None]
) -> Callable[[Server], _Page]:
    if not os.path.isdir(folder):
        raise wrong(f"{os.fspath(folder)} is no folder of a run", "name one, or a model and at least one log")
    needed("viser", "studio")
    from btr._studio.run.page import RunPage
    from btr._studio.run.session import RunSession

    session = RunSession(folder, experiment)
    return lambda server: RunPage(server, session)


def _of_logs(
    model: Union[Model, str, os.PathLike[str]],
    logs: Union[LogLike, Iterable[LogLike]],
    held_out: Union[LogLike, Iterable[LogLike], None],
    folder: Union[str, os.PathLike[str]],
) -> Callable[[Server], _Page]:
    # What is wrong with the model counts first: a page would not help.
    first = loaded(model)
    needed("viser", "studio")
    # Without viser these cannot be imported.
    from btr._studio.page import Page
    from btr._studio.robot import robot_of
    from btr._studio.session import Session

    session = Session(first, logs, held_out, folder=folder)
    robot = robot_of(session.model)
    return lambda server: Page(server, session, robot)


def _serve(opened: Callable[[Server], _Page], host: str, port: int, browser: bool) -> None:
    """Serves a page until Ctrl-C."""
    from btr._studio.server import serve

    server, address = serve(host, port)
    page = opened(server)
    print(f"btr studio: {address}\nCtrl-C ends it", flush=True)
    if browser:
        webbrowser.open(address)
    try:
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        pass
    finally:
        # A second Ctrl-C does not wait for what runs.
        with contextlib.suppress(KeyboardInterrupt):
            page.end()
        # viser tells that it ends, as if it had told that it began.
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
