"""Many samples: here, and on a Dask cluster whose workers are killed."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

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
    pandas = pytest.importorskip("pandas")
    table = done.to_pandas()
    assert len(table) == 40
    pytest.importorskip("pyarrow")
    # The same table, seen by readers that are not ours.
    parquet = pandas.read_parquet(done.out / "samples.parquet")
    assert parquet["sample"].tolist() == table["sample"].tolist()
    assert parquet["twist_deg"].tolist() == pytest.approx(table["twist_deg"].tolist(), rel=1e-15, nan_ok=True)


@pytest.fixture
def cluster() -> object:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True) as cluster:
        yield cluster


def test_a_quiet_cluster_is_one_of_settings_that_there_are() -> None:
    pytest.importorskip("distributed")
    import dask
    from moiregauge import campaign

    for name, value in campaign.QUIET.items():
        # Dask takes names that it does not know, and does nothing.
        assert dask.config.get(name, None) not in (None, value), name


# What a notebook of the user's does, in a process of its own.
RUN = """
import sys
from distributed import Client
import moiregauge as mg
from moiregauge import campaign

# Many tasks, so that some are under way whenever a worker dies.
campaign.SAMPLES = 4
with Client(sys.argv[1]) as client:
    campaign.run(sys.argv[2], sys.argv[3], client=client, drift_draws=0, strain_draws=0)
"""


class Killer(threading.Thread):
    """Kills a worker now and then, as long as there are workers that have lived for a moment."""

    def __init__(self, cluster: Any, most: int) -> None:
        super().__init__()
        self.cluster, self.most, self.killed, self.stop = cluster, most, [], threading.Event()

    def run(self) -> None:
        born: dict[int, float] = {}
        while not self.stop.wait(0.1) and len(self.killed) < self.most:
            alive = [nanny.process.pid for nanny in self.cluster.workers.values() if nanny.process and nanny.process.pid]
            now = time.monotonic()
            for pid in alive:
                # One that is killed while it starts is not started again.
                if now - born.setdefault(pid, now) > 1.5 and self.cluster.scheduler.workers and pid not in self.killed:
                    os.kill(pid, signal.SIGKILL)
                    self.killed.append(pid)
                    break

    def __exit__(self, *_: object) -> None:
        self.stop.set()
        self.join()

    def __enter__(self) -> Killer:
        self.start()
        return self


def test_killed_workers_and_a_killed_client_lose_nothing(cluster: Any, sets: Path, tmp_path: Path) -> None:
    """Two hundred sets, six workers killed and the client once; what was done before is not done again."""
    program("campaign", sets, "--out", tmp_path / "undisturbed", "--drift-draws", 0, "--strain-draws", 0, ok=False)
    out = tmp_path / "out"
    parts = lambda: {path: path.stat().st_mtime_ns for path in out.glob("parts/*.jsonl")}  # noqa: E731
    arguments = [sys.executable, "-c", RUN, cluster.scheduler_address, str(sets), str(out)]
    with Killer(cluster, 3) as first:
        client = subprocess.Popen(arguments, stderr=subprocess.DEVNULL)
        begun = time.monotonic()
        while (len(parts()) < 60 or len(first.killed) < 3) and len(parts()) < 150 and client.poll() is None:
            assert time.monotonic() - begun < 240, "the cluster does nothing"
            time.sleep(0.02)
        client.kill()
        client.wait()
    left = parts()
    assert client.returncode == -signal.SIGKILL and 0 < len(left) < 200 and not (out / "samples.csv").exists()
    with Killer(cluster, 6 - len(first.killed)) as second:
        done = subprocess.run(arguments, stderr=subprocess.PIPE, timeout=400, check=False)
        assert done.returncode == 0, done.stderr
    killed = first.killed + second.killed
    assert len(killed) == 6, f"{len(killed)} workers were killed: the test tests less than it should"
    now = parts()
    assert len(now) == 200 and all(now[part] == when for part, when in left.items()), "something was done twice"
    assert files(out) == files(tmp_path / "undisturbed")


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


def test_maps_of_samples_are_opened_lazily(cluster: Any, sets: Path, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    from distributed import Client

    few = tmp_path / "few"
    for name in ("s000", "s001", "s002"):
        shutil.copytree(sets / name, few / name)
    (few / "s001" / "scan.000.spm").write_bytes(b"\\*File list\r\n")
    (few / "s001" / "scan.001.spm").write_bytes(b"\\*File list\r\n")
    out = tmp_path / "out"
    here = mg.campaign.maps(few, out, **FAST)
    assert list(here) == ["s000", "s002"] and list(here.failed) == ["s001"]
    stores = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file() and path.suffix != ".json"}
    # Again, on a cluster: what is there stays, and what is missing comes.
    shutil.rmtree(out / "maps" / "s002.zarr")
    with Client(cluster) as client:
        again = mg.campaign.maps(few, out, client=client, **FAST)
    assert list(again) == list(here) and list(again.failed) == ["s001"]
    kept = [path for path in stores if "s000" in str(path)]
    assert kept and all(path.stat().st_mtime_ns == stores[path] for path in kept)
    expected = mg.map(few / "s002", **FAST).to_xarray()
    found = again["s002"]
    assert not found["twist"].variable._in_memory, "it was read at once"
    xarray.testing.assert_identical(found.drop_attrs().load(), expected.drop_attrs())
    assert found["twist"].attrs == expected["twist"].attrs
    # Another question is another map.
    assert mg.campaign.maps(few, out, map_options={"window_nm": 20.0}, **FAST)["s000"].attrs["window_nm"] == 20.0
    assert not list(out.rglob(".part*"))
