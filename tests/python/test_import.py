"""The Python package can be installed and imported."""

import btr


def test_the_package_has_a_version() -> None:
    assert btr.__version__.count(".") == 2
