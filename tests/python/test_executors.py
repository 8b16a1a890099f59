"""All executors give the same result, bit by bit; also when a machine is lost."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

import btr
from btr import executors

ROBOTS = Path(__file__).parents[2] / "robots"
LEARN = sorted((ROBOTS / "arm").glob("learn_*.csv"))[:1]


@pytest.fixture(scope="module")
def arm() -> btr.Model:
    return btr.load_model(ROBOTS / "arm.toml")


def answer(arm: btr.Model, executor: object) -> dict:
    found = btr.diagnose(arm, LEARN, max_effects=1, executor=executor)
    return {key: value for key, value in found.document.items() if key != "seconds"}


def fitted(arm: btr.Model, executor: object) -> tuple[dict, str]:
    found = btr.fit(arm, LEARN, add=["coulomb_friction@yaw"], executor=executor)
    return {key: value for key, value in found.document.items() if key != "seconds"}, found.model.text


def history(folder: Path, executor: object) -> str:
    btr.coevolve(ROBOTS / "pendulum.toml", out=folder, executor=executor)
    return (folder / "history.json").read_text()


@pytest.fixture(scope="module")
def alone(arm: btr.Model, tmp_path_factory: pytest.TempPathFactory) -> tuple:
    return answer(arm, 1), fitted(arm, 1), history(tmp_path_factory.mktemp("alone"), 1)


def assert_the_same(arm: btr.Model, executor: object, alone: tuple, folder: Path) -> None:
    assert answer(arm, executor) == alone[0] and alone[0]["effects"]
    assert fitted(arm, executor) == alone[1]
    assert history(folder, executor) == alone[2]


@pytest.mark.parametrize("workers", [0, -1, 2.5, True])
def test_invalid_numbers_of_workers_are_refused(workers: float) -> None:
    with pytest.raises(ValueError, match=f"workers={workers}"):
        executors.Ray(workers)
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match=f"workers={workers}"):
        executors.Futures(pool, workers)
    with pytest.raises(ValueError, match=f"executor={workers}"):
        executors.executor_of(workers)


def test_threads(arm: btr.Model, alone: tuple, tmp_path: Path) -> None:
    assert_the_same(arm, 3, alone, tmp_path)


def test_a_pool_of_threads(arm: btr.Model, alone: tuple, tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as executor:
        assert_the_same(arm, executor, alone, tmp_path)


def test_a_pool_of_processes(arm: btr.Model, alone: tuple, tmp_path: Path) -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        assert_the_same(arm, executor, alone, tmp_path)


class Own:
    """A custom executor; `change` modifies the results."""

    workers = 2

    def __init__(self, change=lambda answer: answer) -> None:
        self.change, self.batches = change, []

    def work(self, payloads: Sequence, batch: bytes) -> bytes:
        self.batches.append(len(batch))
        return self.change(executors.serve([p.key for p in payloads], batch, *[p.content for p in payloads]))


def test_batches_are_few_and_small(arm: btr.Model, alone: tuple) -> None:
    own = Own()
    assert answer(arm, own) == alone[0]
    rollouts = alone[0]["rollouts"]
    assert 2 * len(own.batches) < rollouts and sum(own.batches) < 500 * rollouts, (len(own.batches), sum(own.batches))


def test_a_worker_with_different_results_is_detected(arm: btr.Model) -> None:
    # A result begins with the worker's fingerprint.
    other = Own(lambda answer: bytes([answer[0] ^ 1]) + answer[1:])
    with pytest.raises(btr.BtrError, match="simulates the model differently"):
        answer(arm, other)
    with pytest.raises(btr.BtrError, match="cannot be decoded"):
        answer(arm, Own(lambda answer: b""))


class OtherKind(Own):
    """Workers of another kind: the last number of each answer has another last bit."""

    def __init__(self, check_one_in: int | None) -> None:
        super().__init__(lambda answer: answer[:-8] + bytes([answer[-8] ^ 1]) + answer[-7:])
        self.check_one_in = check_one_in


def test_a_worker_of_another_kind_is_detected(arm: btr.Model, tmp_path: Path) -> None:
    assert answer(arm, OtherKind(None))["verdict"], "the fingerprint does not show it"
    differs = r"a replay of \S*learn_\S* with .* numbers differ; .* use workers of one kind"
    with pytest.raises(btr.BtrError, match=differs):
        answer(arm, OtherKind(1))
    with pytest.raises(btr.BtrError, match=r"controller \[.* numbers differ"):
        history(tmp_path, OtherKind(1))


def test_workers_that_are_all_wrong_are_detected_by_default(arm: btr.Model) -> None:
    # One in 100 is checked; a diagnosis has thousands of results.
    own = Own(lambda answer: answer[:-8] + bytes([answer[-8] ^ 1]) + answer[-7:])
    with pytest.raises(btr.BtrError, match="gave another result than this machine"):
        answer(arm, own)


@pytest.mark.parametrize("check_one_in", [0, -1, 2.5, True, "all"])
def test_invalid_shares_of_checked_results_are_refused(check_one_in: object) -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="check_one_in="):
        executors.Futures(pool, check_one_in=check_one_in)


def test_a_result_of_another_batch_is_detected(arm: btr.Model, tmp_path: Path) -> None:
    class Late(Own):
        """Returns for every batch the result of the previous one."""

        before: bytes | None = None

        def work(self, payloads: Sequence, batch: bytes) -> bytes:
            answer = super().work(payloads, batch)
            answer, self.before = self.before or answer, answer
            return answer

    for ask in (lambda: answer(arm, Late()), lambda: history(tmp_path, Late())):
        with pytest.raises(btr.BtrError, match="belongs to another batch"):
            ask()


def test_workers_receive_the_robots_files(tmp_path: Path) -> None:
    experiment = btr.load_model(ROBOTS / "pendulum.toml")
    text = experiment.text[: experiment.text.index("[reality]")] + '[reality]\nkind = "logs"\nfiles = ["gone.csv"]\n'
    text += experiment.text[experiment.text.index("[coevolve]") :]
    phis = []
    for name, executor in (("alone", 1), ("served", Own())):
        found = btr.coevolve(
            btr.Model(text, experiment.path),
            lambda c: experiment.simulate(seed=1),
            out=tmp_path / name,
            executor=executor,
        )
        phis.append([iteration["phi"] for iteration in found.iterations])
    assert phis[0] == phis[1] and phis[0][0] is not None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
def test_a_fork_works_with_threads_of_its_own(arm: btr.Model) -> None:
    # This process has already used btr; a fork, which lacks its threads, would wait for them forever.
    chi = [channel["chi"] for channel in btr.compare(arm, LEARN).channels]
    with ProcessPoolExecutor(1, mp_context=get_context("fork")) as executor:
        assert executor.submit(compared, arm).result(timeout=120) == chi


FORKS_IN_A_ROW = """
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import btr

model = btr.load_model(sys.argv[1])
for _ in range(4):
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as pool:
        print(btr.fit(model, [sys.argv[2]], executor=pool).rollouts)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
def test_pools_of_forks_one_after_the_other() -> None:
    # The first thread that submits to a pool forks; its fork must not continue the work of that thread.
    command = [sys.executable, "-W", "ignore", "-c", FORKS_IN_A_ROW, ROBOTS / "arm.toml", LEARN[0]]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode == 0, ended.stderr
    assert len(ended.stdout.split()) == 4 and len(set(ended.stdout.split())) == 1, ended.stdout


def compared(arm: btr.Model) -> list[float]:
    return [channel["chi"] for channel in btr.compare(arm, LEARN).channels]


def test_what_an_executor_raises_ends_the_work(arm: btr.Model, tmp_path: Path) -> None:
    def lost(answer: bytes) -> bytes:
        raise ConnectionError("the cluster is gone")

    with pytest.raises(ConnectionError, match="the cluster is gone"):
        answer(arm, Own(lost))
    with pytest.raises(ConnectionError, match="the cluster is gone"):
        history(tmp_path / "run", Own(lost))
    again = btr.coevolve(ROBOTS / "pendulum.toml", out=tmp_path / "run", resume=True)
    assert again.stop_reason and again.iterations


@pytest.mark.parametrize("wrong", [0, -1, True, "rays", 1.5, object()])
def test_an_invalid_executor_is_reported(arm: btr.Model, wrong: object) -> None:
    with pytest.raises((TypeError, ValueError), match="executor|submit"):
        btr.diagnose(arm, LEARN, executor=wrong)


@pytest.fixture(scope="module")
def cluster() -> Iterator:
    ray = pytest.importorskip("ray", reason="Ray is not installed")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "object_store_memory": 10**8})
    second = cluster.add_node(num_cpus=1, object_store_memory=10**8)
    ray.init(address=cluster.address, log_to_driver=False)
    cluster.wait_for_nodes()
    yield cluster, second
    ray.shutdown()
    cluster.shutdown()


@pytest.mark.skipif(sys.platform != "linux", reason="clusters on one machine are for Linux")
def test_ray_also_when_a_machine_is_lost(arm: btr.Model, alone: tuple, tmp_path: Path, cluster: tuple) -> None:
    machines, second = cluster
    cluster = executors.Ray()
    assert cluster.workers == 2
    # A diagnosis follows, with a loss: each batch takes Ray much longer than the simulations in it.
    assert fitted(arm, cluster) == alone[1]
    assert history(tmp_path, cluster) == alone[2]

    class Losing(executors.Ray):
        """Loses the second machine while batches are running."""

        handed_out, lost_after = 0, 0

        def lose(self) -> None:
            machines.remove_node(second, allow_graceful=False)
            self.lost_after = self.handed_out

        def work(self, payloads: Sequence, batch: bytes) -> bytes:
            self.handed_out += 1
            if self.handed_out == 20:
                self.loser = threading.Thread(target=self.lose)
                self.loser.start()
            return super().work(payloads, batch)

    losing = Losing()
    assert answer(arm, losing) == alone[0]
    losing.loser.join()
    assert 20 <= losing.lost_after < losing.handed_out
