"""How long the page waits for parts of a large image, and what the server needs for it: large.py PROGRAM [SIDE]

Writes an image of SIDE² pixels (16384 if not given; 1 GiB of disk) into a temporary folder and asks as the page does: the
header, the thumbnail, the whole image in blocks, then tiles at full resolution. Needs Linux, Python and numpy.
"""

import json
import re
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request
from pathlib import Path

import numpy as np

TILE = 1024


def write(path, side):
    """A hexagonal pattern as a Gwyddion simple field, row by row."""
    head = f"Gwyddion Simple Field 1.0\nXRes = {side}\nYRes = {side}\nXReal = 1e-5\nYReal = 1e-5\nXYUnits = m\nZUnits = m\n".encode()
    head += b"\0" * (4 - len(head) % 4)
    x = np.arange(side, dtype=np.float32) * (2 * np.pi / 40)
    with path.open("wb") as file:
        file.write(head)
        for j in range(side):
            y = j * 2 * np.pi / 40
            row = np.cos(x) + np.cos(x / 2 + 0.866 * y) + np.cos(x / 2 - 0.866 * y)
            file.write((1e-10 * row).astype("<f4").tobytes())


def main(program, side):
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / "large.gsf", side)
        server = subprocess.Popen([program, "serve", folder, "--no-browser"], stdout=subprocess.PIPE, text=True)
        try:
            origin, token = server.stdout.readline().strip().split("/#token=")
            asked = urllib.request.Request(
                f"{origin}/api/session", json.dumps({"token": token}).encode(), {"content-type": "application/json"}
            )
            with urllib.request.urlopen(asked) as answer:
                cookie = answer.headers["set-cookie"].split(";")[0]

            def get(what, **query):
                address = f"{origin}/api/{what}?{urllib.parse.urlencode(query)}"
                begun = time.monotonic()
                with urllib.request.urlopen(urllib.request.Request(address, headers={"cookie": cookie})) as answer:
                    content = answer.read()
                memory = re.findall(r"Vm(?:HWM|RSS):\s*(\d+)", Path(f"/proc/{server.pid}/status").read_text())
                seconds = time.monotonic() - begun
                peak, now = (int(kb) / 1024 for kb in memory)
                about = {key: value for key, value in query.items() if key != "file"}
                print(f"{what:8} {seconds:7.2f} s  {len(content) / 1e6:7.2f} MB  {now:6.0f} MB now, {peak:6.0f} MB at most  {about}")
                return content

            file = json.loads(get("folder", root=0, under=""))["files"][0]["file"]
            get("inspect", file=file)
            get("thumb", file=file, channel=0, size=160)
            get("image", file=file, channel=0, step=-(-side // TILE))
            for x, y in [(0, 0), (side // 2, side // 2), (side // 2 + TILE, side // 2), (side - TILE, side - TILE)]:
                get("image", file=file, channel=0, step=1, x=x, y=y, w=TILE, h=TILE)
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 16384)
