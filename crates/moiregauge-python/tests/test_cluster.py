"""Many samples: here, and on a Dask cluster whose workers are killed."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import moiregauge as mg
import pytest
from conftest import program

FAST = {"drift_draws": 0, "strain_draws": 0}


@pytest.fixture(scope="module")
def expected(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an undisturbed run of the program writes."""
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    program("campaign", samples, "--out", out, "--drift-draws", 0, "--strain-draws", 0, ok=False)
    return files(out)


def files(out: Path) -> dict[str, bytes]:
    found = {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}
    # The list of files has their hashes; locks are empty.
    return {name: content for name, content in found.items() if content and "lock" not in name}


def test_without_a_cluster_it_runs_here(samples: Path, expected: dict[str, bytes], tmp_path: Path) -> None:
    told: list[int] = []
    done = mg.campaign.run(samples, tmp_path / "out", progress=lambda _, n, __: told.append(n), **FAST)
    assert (done.ok + done.doubtful, done.failed) == (40, 0) or done.failed == 0
    assert files(tmp_path / "out") == expected and told[-1] == 40
    if pytest.importorskip("pandas"):
        assert len(done.to_pandas()) == 40


@pytest.fixture
def cluster() -> object:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True) as cluster:
        yield cluster


def test_killed_workers_lose_nothing(
    cluster: object, samples: Path, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import Client
    from moiregauge import campaign

    # Many tasks, so that some are under way whenever a worker dies.
    monkeypatch.setattr(campaign, "SAMPLES", 2)
    with Client(cluster) as client:
        stop, killed = threading.Event(), []
        born: dict[int, float] = {}

        def kill() -> None:
            while not stop.wait(0.1) and len(killed) < 6:
                alive = [nanny.process.pid for nanny in cluster.workers.values() if nanny.process and nanny.process.pid]
                now = time.monotonic()
                for pid in alive:
                    # One that is killed while it starts is not started again.
                    if now - born.setdefault(pid, now) > 1.5 and client.nthreads() and pid not in killed:
                        os.kill(pid, signal.SIGKILL)
                        killed.append(pid)
                        break

        thread = threading.Thread(target=kill)
        thread.start()
        try:
            mg.campaign.run(samples, tmp_path / "out", client=client, **FAST)
        finally:
            stop.set()
            thread.join()
    assert killed, "nothing was killed: the test tests nothing"
    assert files(tmp_path / "out") == expected


def test_a_sample_that_ends_its_workers_is_recorded(
    cluster: object, samples: Path, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import Client
    from moiregauge import campaign

    monkeypatch.setattr(campaign, "_task", deadly)
    # Fewer workers have to die for it.
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 1)
    with Client(cluster) as client:
        done = campaign.run(samples, tmp_path / "out", client=client, **FAST)
    assert done.failed == 1 and done.ok + done.doubtful == 39
    assert "ended by the system" in (tmp_path / "out" / "failed.csv").read_text()


def deadly(asked: tuple, places: list[int]) -> int:
    """A task that dies of the fifth sample."""
    if 5 in places:
        # A worker that dies while it starts is not started again.
        time.sleep(2)
        os.kill(os.getpid(), signal.SIGKILL)
    mg.campaign._many(asked).some(places, 1)
    return len(places)
