"""A studio's server without a browser, as a fixture for the files of tests that import it."""

from collections.abc import Iterator

import pytest

from btr._studio.server import Server, serve


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[Server, str]]:
    server, address = serve("127.0.0.1", 0)
    yield server, address
    server.stop()
