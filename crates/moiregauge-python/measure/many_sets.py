"""How much of the processor a Dask cluster needs to hand out many small sets: many_sets.py [SETS] [quiet]

Ten thousand sets of two frames of 48² (links to the files of one), two workers, settings of Dask as they come or, with
`quiet`, those of `campaign.QUIET`. Says which share of the processor time scheduler, nannies and client take, tables
included; it has to stay below 5 %.

Dask takes a share of the time that passes, whether there is work or not (it looks at its event loops fifty times a second).
Where others use the processors as well, the work takes longer and that share grows with it, so the share counts it for
the time that the work takes on processors of its own: the processor time of the workers, divided by their number, and
that of the client after it. What was seen as it stands is said beside it. Needs the package with `distributed`.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import moiregauge as mg
import psutil

IDLE_S = 10
FAST = {"drift_draws": 0, "strain_draws": 0}


def main(count, settings):
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(settings), tempfile.TemporaryDirectory() as scratch:
        one = mg.simulate(Path(scratch) / "one", name="set", seed=1, raster={"scans": 2, "pixels": [48, 48]})[0]
        root = Path(scratch) / "sets"
        for number in range(count):
            (root / f"s{number:05}").mkdir(parents=True)
            for scan in one.glob("*.spm"):
                os.link(scan, root / f"s{number:05}" / scan.name)
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
            workers = [psutil.Process(pid) for pid in client.run(os.getpid).values()]

            def spent():
                return time.process_time(), sum(sum(worker.cpu_times()[:2]) for worker in workers)

            # Dask looks after its connections whether there is work or not: a share of the time that passes.
            begun, before = time.monotonic(), spent()
            time.sleep(IDLE_S)
            idle = (spent()[0] - before[0]) / (time.monotonic() - begun)
            begun, before = time.monotonic(), spent()
            done = mg.campaign.run(root, Path(scratch) / "out", client=client, **FAST)
            own, others = (now - then for now, then in zip(spent(), before, strict=True))
            wall = time.monotonic() - begun
    assert done.ok + done.doubtful + done.failed == count and done.failed == 0, done
    # What is done for the sets, and what is done anyway.
    for_sets = max(own - idle * wall, 0.0)
    alone = others / len(workers) + for_sets
    share = 100 * (for_sets + idle * alone) / (for_sets + idle * alone + others)
    print(f"{count} sets in {wall:.0f} s; of the processor scheduler and client {own:.1f} s, workers {others:.1f} s")
    print(f"a set costs them {1e3 * for_sets / count:.2f} ms, workers {1e3 * others / count:.1f} ms")
    print(f"without any work they take {100 * idle:.1f} % of one processor")
    print(f"on processors of its own ({alone:.0f} s): {share:.1f} %; as it was seen: {100 * own / (own + others):.1f} %")
    return share < 5


if __name__ == "__main__":
    given = sys.argv[1:]
    numbers = [int(one) for one in given if one != "quiet"]
    sys.exit(not main(numbers[0] if numbers else 10_000, mg.campaign.QUIET if "quiet" in given else {}))
