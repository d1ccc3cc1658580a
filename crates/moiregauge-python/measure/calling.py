"""What calling from Python costs beside the program, and what arrays cost: calling.py [ROUNDS]

The same analysis in turn by the program of the wheel (`results.json` alone) and by `analyze` with `to_dict`, each in a
process of its own whose start is not counted; processor time, the median of the ratios of neighbours. It has to stay
below 5 %. Then how often an array is copied: the peak of the memory over its size while it is handed over. Needs Linux
and the package.
"""

import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import moiregauge as mg

HEAD = (
    "import json, sys, time, warnings\nwarnings.simplefilter('ignore')\nimport moiregauge as mg\nfrom moiregauge import _core\n"
)
PROGRAM = (
    "folder, out = sys.argv[1:]\nbegun = time.process_time()\n"
    "options = ['--force', '--quiet', '--no-report', '--threads', '2']\n"
    "code = _core.program(['moiregauge', 'analyze', folder, '--out', out, *options])\n"
    "assert code == 0, code\nprint(time.process_time() - begun, file=sys.stderr)\n"
)
CALLED = (
    "folder, out = sys.argv[1:]\nbegun = time.process_time()\n"
    "text = json.dumps(mg.analyze(folder, threads=2).to_dict())\n"
    "open(out, 'w').write(text)\nprint(time.process_time() - begun, file=sys.stderr)\n"
)
COPIES = r"""
import re, sys
from pathlib import Path
import numpy as np
from moiregauge._analyze import run_of
from moiregauge._arguments import asked
array = np.ones((4096, 4096))
peak = lambda: 1024 * int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1])
before = peak()
run = run_of(asked(array, None, 0.1, None, {}), {})
print((peak() - before) / array.nbytes, file=sys.stderr)
"""


def told(code, *arguments):
    """The last number that a process says."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return float(re.findall(r"^[\d.e-]+$", done.stderr, flags=re.MULTILINE)[-1])


def main(rounds):
    good = True
    with tempfile.TemporaryDirectory() as scratch:
        for scans, pixels in [(4, 128), (8, 256), (4, 512)]:
            folder = mg.simulate(scratch, name=f"{scans}-{pixels}", seed=3, raster={"scans": scans, "pixels": [pixels] * 2})[0]
            of_program, of_call = [], []
            for _ in range(rounds):
                of_program.append(told(HEAD + PROGRAM, folder, Path(scratch) / "out"))
                of_call.append(told(HEAD + CALLED, folder, Path(scratch) / "results.json"))
            ratios = [called / program for called, program in zip(of_call, of_program, strict=True)]
            ratio, program = statistics.median(ratios), statistics.median(of_program)
            print(f"{scans} scans of {pixels}²: program {program:.3f} s, called {100 * (ratio - 1):+.1f} %", flush=True)
            good &= ratio < 1.05
    copies = told(COPIES)
    print(f"an array is copied {copies:.2f} times")
    return good and copies < 1.1


if __name__ == "__main__":
    sys.exit(not main(int(sys.argv[1]) if len(sys.argv) > 1 else 15))
