#!/usr/bin/env python3
"""The slowest tests of the workspace, in processor seconds, one a line.

    python3 docs/slowest.py [-p CRATE --test NAME …]     (what `cargo test` takes; without: the whole workspace)

Each test program runs on one thread; the clock is that of its process, so that a busy machine changes little.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

MOST = 20


def programs(asked):
    """The test programs, and where they run."""
    command = ["cargo", "test", "--release", "--no-run", "--message-format=json", *(asked or ["--workspace"])]
    built = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in built.splitlines() if line.startswith("{")]
    for message in messages:
        if message.get("executable") and message.get("profile", {}).get("test"):
            yield message["executable"], message["target"]["name"], Path(message["manifest_path"]).parent


def processor(pid):
    """Seconds of a process so far, those of its finished children included."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def timed(program, name, folder):
    """Seconds and names of all tests of a program."""
    run = subprocess.Popen([program, "--test-threads=1"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    before, found = 0.0, []
    for line in run.stdout:
        test = re.match(r"test (\S+) .*\.\.\.", line)
        if test:
            now = processor(run.pid)
            found.append((now - before, f"{name}::{test[1]}"))
            before = now
    if run.wait():
        print(f"{name}: some tests failed", file=sys.stderr)
    return found


if __name__ == "__main__":
    all_tests = [one for program in programs(sys.argv[1:]) for one in timed(*program)]
    for seconds, test in sorted(all_tests, reverse=True)[:MOST]:
        print(f"{seconds:8.1f} s  {test}")
    print(f"{sum(seconds for seconds, _ in all_tests):8.1f} s  all {len(all_tests)} tests")
