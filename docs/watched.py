#!/usr/bin/env python3
"""Time and memory of `moiregauge watch` while a folder fills, to see that a long night fits into a computer.

    docs/watched.py PROGRAM [FRAMES]        (500 frames of 128 x 128 pixels, which take a quarter of an hour)

The frames are simulated first and then come one by one: the next one when the line of the one before was read. Said are,
after some of them, the memory that the program has, the time from a frame to its line (the two looks, 50 ms apart, that tell
that it is whole are in it), and the time of the processor that the frame took. Linux only.

Measured on two busy processors: 26 MB after 100 frames and 39 MB after 500, 31 kB a frame. It cannot be constant, since all frames are
fitted together. Of each frame 16 kB stay: lattices, geometry and times of both lines (4.5 kB), samples that tell copies of a file (4 kB), what the
fits leave around the waves (5 kB), harmonics, names and hashes (2 kB). 14 kB more are needed while the frames are fitted: normal equations, their
derivatives, and the numbers of each scan; the rest is what the allocator holds. A frame takes longer the more there are. With a release it took
0.03 s of CPU after 10 frames, 0.09 s after 100, 0.35 s after 300 and 0.61 s after 500.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SHOWN = [10, 50, 100, 200, 300, 400, 500, 1000]
POLL = "50ms"
# From here on the program has what it needs of memory for one frame.
SETTLED = 100


def memory_mb(pid):
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1e3
    raise SystemExit("the program is gone")


def cpu_s(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main(program, frames):
    with tempfile.TemporaryDirectory() as scratch:
        raster = ["--scans", str(frames), "--pixels", "128", "--noise", "0.3"]
        simulate = [program, "simulate", "--out", f"{scratch}/sim", "--name", "set", *raster, "--seed", "1"]
        subprocess.run(simulate, check=True, stdout=subprocess.DEVNULL)
        scans = sorted(Path(f"{scratch}/sim/set").glob("*.spm"))
        folder = Path(scratch) / "watched"
        folder.mkdir()
        watch = [program, "watch", str(folder), "--json", "--poll", POLL, "--quiet"]
        print("frames  memory MB  seconds to the line  seconds of CPU", flush=True)
        memory = {}
        with subprocess.Popen(watch, stdout=subprocess.PIPE, text=True) as process:
            for number, scan in enumerate(scans, 1):
                begun, before = time.monotonic(), cpu_s(process.pid)
                os.link(scan, folder / scan.name)
                line = json.loads(process.stdout.readline())
                assert line["frames"] == number, line
                took, cpu = time.monotonic() - begun, cpu_s(process.pid) - before
                if number in SHOWN or number == frames:
                    memory[number] = memory_mb(process.pid)
                    print(f"{number:6} {memory[number]:10.1f} {took:20.2f} {cpu:15.2f}", flush=True)
            if frames > SETTLED:
                more = 1e3 * (memory[frames] - memory[SETTLED]) / (frames - SETTLED)
                print(f"memory from frame {SETTLED} on: {more:.0f} kB a frame")
            print(f"the line of frame {number}: twist {line['twist_deg']}")
            process.terminate()
            assert process.wait() == 0


if __name__ == "__main__":
    main(os.path.realpath(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 500)
