"""Sessions of the studio with the shipped arm, as fixtures for the files of tests that import them."""

from pathlib import Path

import pytest

from btr._studio.session import Session

ROBOTS = Path(__file__).parents[2] / "robots"
FRICTION = "coulomb_friction@yaw"


def session_of_arm(folder: Path) -> Session:
    session = Session(ROBOTS / "arm.toml", [ROBOTS / "arm/learn_1.csv"], [ROBOTS / "arm/held_out_1.csv"], folder=folder)
    session.compare()
    return session


@pytest.fixture
def arm(tmp_path: Path) -> Session:
    return session_of_arm(tmp_path)


class Diagnosed:
    """A session that was diagnosed, and what it told: lengths of the ladder, and batches so far."""

    def __init__(self, folder: Path) -> None:
        self.session = session_of_arm(folder)
        self.heard: list[tuple[int, int | None]] = []
        self.session.diagnose(lambda: self.heard.append((len(self.session.ladder), self.session.batches)))


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    return Diagnosed(tmp_path_factory.mktemp("diagnosed"))
