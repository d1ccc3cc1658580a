"""Fork, spawn, forkserver, threads, Ctrl-C: nothing may hang."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import moiregauge as mg
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning", "ignore:.*multi-threaded.*:DeprecationWarning")

# A child that is not done by then hangs.
WATCHDOG_S = 120


def twist(path: str) -> float:
    import warnings

    warnings.simplefilter("ignore")
    found = mg.analyze(path, drift_draws=100, strain_draws=100).sets[0].scans[0].twist_strain.sensor
    return found.twist_deg.value


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_children_work_after_their_parent_has(method: str, scans: Path) -> None:
    files = [str(file) for file in sorted(scans.glob("*.spm"))]
    expected = [twist(file) for file in files]
    context = multiprocessing.get_context(method)
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as pool:
        futures = [pool.submit(twist, file) for file in files]
        done, late = concurrent.futures.wait(futures, timeout=WATCHDOG_S)
        if late:
            for child in pool._processes.values():
                child.kill()
        assert not late, "a child hangs"
        assert [future.result() for future in futures] == expected


def test_threads_work_beside_each_other(scans: Path) -> None:
    files = [str(file) for file in sorted(scans.glob("*.spm"))]
    expected = [twist(file) for file in files]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        assert list(pool.map(twist, files, timeout=WATCHDOG_S)) == expected


def test_the_interpreter_is_free_meanwhile(scans: Path) -> None:
    """Measured in processor time of the process: the clock on the wall counts what other programs do."""
    ticks, stop = [], threading.Event()

    def tick() -> None:
        while not stop.wait(0.005):
            ticks.append(time.process_time())

    thread = threading.Thread(target=tick)
    thread.start()
    mg.analyze([scans], threads=1)
    stop.set()
    thread.join()
    pauses = [b - a for a, b in zip(ticks, ticks[1:], strict=False)]
    assert max(pauses) < 0.5, max(pauses)


def test_threads_change_nothing(scans: Path) -> None:
    assert mg.analyze([scans], threads=1).sets == mg.analyze([scans], threads=3).sets


def test_progress_is_told_and_may_stop(scans: Path) -> None:
    told: list[tuple[str, int, int]] = []
    mg.analyze([scans], progress=lambda *now: told.append(now))
    assert any(now[0] == "measuring" and now[2] == 4 for now in told)

    class Enough(Exception):
        pass

    def stop(*_: object) -> None:
        raise Enough

    with pytest.raises(Enough):
        mg.analyze([scans], progress=stop)


def test_ctrl_c_stops_within_a_moment(scans: Path) -> None:
    """In a process of its own, at a dozen moments from beginning to end; the session goes on after each."""
    code = f"""
        import os, signal, sys, threading, time, warnings
        warnings.simplefilter("ignore")
        import moiregauge as mg

        worked = []
        for n in range(12):
            # A campaign of its own measures again: moments are in the search, the fit, and the draws.
            sent = []

            def send(after):
                time.sleep(after)
                sent.append(time.process_time())
                os.kill(os.getpid(), signal.SIGINT)

            thread = threading.Thread(target=send, args=(0.03 + 0.06 * n,))
            try:
                thread.start()
                mg.analyze({str(scans)!r}, strain_draws=1000000, drift_draws=100000, threads=1)
                thread.join()
                time.sleep(0.2)
            except KeyboardInterrupt:
                worked.append(time.process_time() - sent[0])
            thread.join()
        mg.analyze({str(scans / "scan.000.spm")!r})
        print(*worked)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=WATCHDOG_S)
    assert done.returncode == 0, done.stderr
    worked = sorted(float(word) for word in done.stdout.split())
    # Work is processor time of the one thread: the clock on the wall counts what other programs do. A stage takes seconds here.
    assert len(worked) >= 8 and worked[-1] < 0.3, worked


def test_the_program_is_stopped_by_ctrl_c(scans: Path, tmp_path: Path) -> None:
    from conftest import PROGRAM

    arguments = [str(PROGRAM), "analyze", str(scans), "--out", str(tmp_path / "out"), "--strain-draws", "1000000"]
    child = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    # The interpreter has its own way of stopping until the program has begun.
    begun = time.monotonic()
    while not any(tmp_path.iterdir()) and time.monotonic() - begun < WATCHDOG_S:
        time.sleep(0.05)
    time.sleep(0.2)
    child.send_signal(signal.SIGINT)
    _, words = child.communicate(timeout=WATCHDOG_S)
    assert child.returncode == 130, words
    assert not os.path.exists(tmp_path / "out" / "results.json")


@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted as Linux does")
def test_arrays_are_copied_once() -> None:
    code = r"""
        import re
        from pathlib import Path
        import numpy as np
        from moiregauge._analyze import run_of
        from moiregauge._arguments import asked
        array = np.ones((4096, 4096))
        status = Path("/proc/self/status")
        peak = lambda: 1024 * int(re.search(r"VmHWM:\s*(\d+)", status.read_text())[1])
        before = peak()
        run = run_of(asked(array, None, 0.1, None, {}), {})
        print((peak() - before) / array.nbytes)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=WATCHDOG_S)
    assert done.returncode == 0, done.stderr
    assert 0.5 < float(done.stdout) < 1.2, done.stdout


def test_a_bar_is_shown(scans: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mg.analyze([scans], progress=True)
    shown = capsys.readouterr().err
    assert "measuring" in shown and "4/4" in shown and shown.endswith("\n")
    with pytest.raises(TypeError, match="progress"):
        mg.analyze([scans], progress="yes")
