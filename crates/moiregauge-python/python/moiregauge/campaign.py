"""Many samples, one table: here, or on a Dask cluster.

    from dask.distributed import Client
    import moiregauge as mg

    if __name__ == "__main__":
        done = mg.campaign.run("samples/", "out/", client=Client("scheduler:8786"))
        table = done.to_pandas()

Every sample (a folder with scans) leaves a part in `out/parts`, named by a hash of all that it depends on: the files of
`moiregauge campaign --shard`. Nothing else is remembered. A run that is killed, here or on the cluster, goes on when it is
started again. Paths have to mean the same folders on all workers.

A cluster that is made for campaigns need not look at itself as often as Dask does by default:

    with dask.config.set(mg.campaign.QUIET), LocalCluster() as cluster, Client(cluster) as client:
        mg.campaign.run("samples/", "out/", client=client)
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, Unpack, cast

from moiregauge import _core
from moiregauge._arguments import PathLike, words
from moiregauge._maps import MapOptions, Maps, failures, made
from moiregauge._options import TOLD
from moiregauge._progress import Progress, Tell, teller

if TYPE_CHECKING:
    import pandas
    from dask.distributed import Client, Future

    from moiregauge._options import Options

__all__ = ["QUIET", "Done", "Maps", "maps", "run"]

Task: TypeAlias = Callable[[list[int]], int]

QUIET: Mapping[str, object] = {
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.profile.enabled": False,
}
"""Settings of Dask for a cluster that is made for campaigns: it looks at its loops once a second, where it does so fifty
times, and does not note every 10 ms what its workers do. Scheduler and client take half as much of a processor then, and
workers a twentieth less.
"""
# So many samples are one task at most: a scheduler needs some milliseconds for each task. Parts on the disk are of single
# samples whatever a task has, so that a task that is killed costs one sample.
SAMPLES = 64
# So many tasks for each worker, where there are samples enough, lest the last ones wait for each other.
TASKS = 16
# Tasks that wait at a worker die with it, and count as its victims: so many at each.
WINDOW = 2
# A sample that has ended its worker so often while it was alone on the cluster is to blame.
ALONE = 2


@dataclass(frozen=True)
class Done:
    """How the samples of a campaign ended; `out` has `samples.csv`, `samples.parquet`, `failed.csv`, `campaign.html`."""

    out: Path
    ok: int
    doubtful: int
    failed: int

    def to_pandas(self) -> pandas.DataFrame:
        """The table of all samples, one row for each moiré of a sample."""
        import pandas

        return pandas.read_csv(self.out / "samples.csv")


def run(
    root: PathLike,
    out: PathLike,
    *,
    client: Client | None = None,
    samples: PathLike | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> Done:
    """Analyses every folder below `root` that holds scans, as `moiregauge campaign` does: the same files, byte for byte.

    client: of a Dask cluster, whose workers analyse on one thread each; without one it runs here on `threads`. A cluster
        made under `dask.config.set(campaign.QUIET)` spends less on looking after itself.
    samples: a table (CSV, columns `sample` and `path`) that says which files are which sample.
    progress: `True`, or a function of what is being done, how much is done, and how much there is.

    A sample that fails does not stop the others; one that ends every worker that looks at it is recorded as failed.
    """
    asked = _asked(root, out, samples, options)
    many = _core.ManySamples(*asked)
    tell = teller(progress)
    if client is not None:
        _on_cluster(client, functools.partial(_task, asked), len(many), tell, many.give_up)
    # What the workers have done is found by its hash: this makes the tables.
    return Done(Path(out), *many.all(threads, None if client is not None else tell)[:3])


def maps(
    root: PathLike,
    out: PathLike,
    *,
    client: Client | None = None,
    samples: PathLike | None = None,
    map_options: MapOptions | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> Maps:
    """Maps every sample below `root` as `moiregauge.map` does, each into a Zarr store of its own, `out/maps/SAMPLE.zarr`.

    map_options: keywords of `map`, such as `{"window_nm": 8}`.
    root, out, client, samples, threads, progress, options: as in `run`.

    Stores that are there and were made of the same files with the same options are left as they are, so that a run that
    was killed goes on. Returns a mapping from samples to datasets that are opened lazily; `failed` says which samples
    have no map, and why. Needs xarray and zarr.
    """
    asked = _asked(root, out, samples, options)
    wanted = (dict(map_options or {}), {name: value for name, value in options.items() if value is not None})
    many, tell = _many(asked), teller(progress)
    if client is not None:
        do = functools.partial(_map_task, asked, wanted)
        _on_cluster(client, do, len(many), tell, lambda place, why: failures(many, asked[4], wanted, place, why))
    else:
        for place in range(len(many)):
            made(many, asked[4], wanted, place, threads)
            if tell is not None:
                tell("mapping", place + 1, len(many))
    return Maps(Path(out), [many.sample(place)[0] for place in range(len(many))])


def _map_task(asked: tuple[Any, ...], wanted: tuple[Any, ...], places: list[int]) -> int:
    for place in places:
        made(_many(asked), asked[4], wanted, place, 1)
    return len(places)


def _asked(root: PathLike, out: PathLike, samples: PathLike | None, options: Mapping[str, Any]) -> tuple[Any, ...]:
    """What a worker has to know to find the same samples."""
    told = {name: value for name, value in options.items() if name in TOLD and value is not None}
    settings = {name: value for name, value in options.items() if name not in TOLD and value is not None}
    table = None if samples is None else os.path.abspath(samples)
    return (os.path.abspath(root), table, words(settings), words(told), os.path.abspath(out))


@functools.lru_cache(maxsize=1)
def _many(asked: tuple[Any, ...]) -> _core.ManySamples:
    return _core.ManySamples(*asked)


def _task(asked: tuple[Any, ...], places: list[int]) -> int:
    """What a worker does: parts are whole on the disk before it returns."""
    _many(asked).some(places, 1)
    return len(places)


def _on_cluster(client: Client, task: Task, count: int, tell: Tell | None, give_up: Callable[[int, str], None]) -> None:
    """Does a task for all samples, many at a time; those that end every worker are given up."""
    # Neighbours are often alike: every n-th sample is in one task.
    workers = len(cast(Any, client).nthreads())
    done, tasks = 0, max(-(-count // SAMPLES), min(count, TASKS * workers))

    def told(places: list[int]) -> None:
        nonlocal done
        done += len(places)
        if tell is not None:
            tell("analysing", done, count)

    suspects = _all(client, task, [list(range(n, count, tasks)) for n in range(tasks)], WINDOW, told)
    suspects = _all(client, task, [[place] for places in suspects for place in places], WINDOW, told)
    # Others may have ended the workers of these.
    for _ in range(ALONE):
        suspects = _all(client, task, suspects, 0, told)
    for (place,) in suspects:
        give_up(place, "every process that looked at these files was ended by the system")
        told([place])


def _all(client: Client, do: Task, tasks: list[list[int]], window: int, told: Callable[[list[int]], None]) -> list[list[int]]:
    """Does the tasks, so many at a time for each worker (0: one in all); returns those that ended their workers."""
    from dask.distributed import KilledWorker, as_completed

    waiting, killed = list(reversed(tasks)), []
    places: dict[Any, list[int]] = {}

    def start() -> Future[int]:
        task = waiting.pop()
        future = client.submit(do, task, pure=False, retries=1)
        places[future.key] = task
        return future

    at_once = min(len(waiting), max(1, window * len(cast(Any, client).nthreads())))
    running = as_completed([start() for _ in range(at_once)])
    for future in running:
        task = places.pop(future.key)
        error = future.exception()
        if error is None:
            told(task)
        elif isinstance(error, KilledWorker):
            killed.append(task)
        else:
            raise error
        # Nobody needs the answer: it is not worked out again when its worker dies.
        future.release()
        if waiting:
            running.add(start())
    return killed
