"""How much of the processor a Dask cluster needs to hand out many small sets: many_sets.py [SETS]

Ten thousand sets of two frames of 48² (links to the files of one), two workers. Says which share of the processor time
scheduler and client take, tables included; it has to stay below 5 %. Needs the package with `distributed`.
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


def main(count):
    from distributed import Client, LocalCluster

    with tempfile.TemporaryDirectory() as scratch:
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
    share, without = 100 * own / (own + others), idle * wall
    print(
        f"{count} sets in {wall:.0f} s; of the processor scheduler and client {own:.1f} s, workers {others:.1f} s: {share:.1f} %"
    )
    print(f"without work it would have been {without:.1f} s: a set costs {1e3 * (own - without) / count:.2f} ms")
    return share < 5


if __name__ == "__main__":
    sys.exit(not main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000))
