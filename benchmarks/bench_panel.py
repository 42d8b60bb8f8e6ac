"""Rate and age of the live picture, delay of the overlay, CPU of an idle panel.

    python benchmarks/bench_panel.py [--seconds 10] [--pages 1]

The panel runs in a process of its own on the computed bench, homed and standing at
60 mm; this program is the page. The age of a picture is from its arrival at the panel
to its arrival here, on one machine; the overlay's delay from the picture's arrival to
the overlay's dispatch. CPU is that of the panel's process, in percent of one core.
A page that shows nothing is open in the line "idle", none in "alone".
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

import psutil
import websockets

from magbend.panel import prepare_demo


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pages", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rig = prepare_demo(Path(folder) / "bench", seed=2)
        command = [
            sys.executable, "-m", "magbend.cli.main", "panel", "--rig", str(rig),
            "--port", "0", "--no-browser", "--speed", "6",
        ]  # fmt: skip
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as panel:
            try:
                asyncio.run(measure(panel, options.seconds, options.pages))
            finally:
                panel.terminate()


async def measure(panel: subprocess.Popen[str], seconds: float, pages: int) -> None:
    """Print one line a state of the panel."""
    assert panel.stdout is not None
    while not (found := re.match(r"http://(\S+)/", panel.stdout.readline())):
        assert panel.poll() is None
    netloc = found[1]
    await asyncio.sleep(3.0)
    print(f"alone, no page open:    {await cpu(panel.pid, seconds):5.1f} % of a core")
    async with page(netloc) as idle:
        listening = asyncio.create_task(hear(idle, {}))
        await asyncio.sleep(1.0)
        print(
            f"idle, page open hidden: {await cpu(panel.pid, seconds):5.1f} % of a core"
        )
        command(netloc, "home", {})
        await asyncio.sleep(6.0)
        command(netloc, "goto", {"gap_mm": 60.0})
        await asyncio.sleep(8.0)
        listening.cancel()
    await watching(panel.pid, netloc, seconds, pages)


async def watching(pid: int, netloc: str, seconds: float, pages: int) -> None:
    sockets = [await page(netloc) for _ in range(pages)]
    seen: list[dict[str, list[float]]] = [{} for _ in sockets]
    tasks = [
        asyncio.create_task(hear(socket, one))
        for socket, one in zip(sockets, seen, strict=True)
    ]
    for socket in sockets:
        await socket.send(json.dumps({"picture": True, "awake": True}))
    await asyncio.sleep(2.0)
    for one in seen:
        one.clear()
    used = await cpu(pid, seconds)
    for task in tasks:
        task.cancel()
    ages = [age for one in seen for age in one.get("age_ms", [])]
    late = [delay for one in seen for delay in one.get("late_ms", [])]
    print(
        f"watched by {pages} page(s):   {used:5.1f} % of a core, "
        f"{len(ages) / seconds / pages:.1f} pictures/s a page, age median "
        f"{statistics.median(ages):.0f} ms (95 %: {quantile(ages):.0f} ms); "
        f"{len(late) / seconds / pages:.1f} overlays/s, "
        f"{statistics.median(late):.0f} ms after the picture "
        f"(95 %: {quantile(late):.0f} ms)"
    )


def page(netloc: str) -> Any:
    """Open a socket as a page does."""
    return websockets.connect(
        f"ws://{netloc}/socket?client={os.urandom(8).hex()}",
        origin=f"http://{netloc}", max_size=None,
    )  # fmt: skip


async def hear(socket: Any, seen: dict[str, list[float]]) -> None:
    async for message in socket:
        if isinstance(message, bytes):
            length = int.from_bytes(message[:4], "big")
            header = json.loads(message[4 : 4 + length])
            seen.setdefault("age_ms", []).append(1e3 * header["age_s"])
            await socket.send(json.dumps({"shown": header["number"]}))
        elif message.startswith('{"type": "overlay"'):
            seen.setdefault("late_ms", []).append(json.loads(message)["late_ms"])


def command(netloc: str, name: str, values: dict[str, float]) -> None:
    request = urllib.request.Request(
        f"http://{netloc}/api/{name}", json.dumps(values).encode(),
        {"Content-Type": "application/json", "X-Magbend-Client": "bench"},
    )  # fmt: skip
    with urllib.request.urlopen(request) as answer:
        answer.read()


async def cpu(pid: int, seconds: float) -> float:
    """Return the CPU of a process over some seconds, in percent of a core."""
    process = psutil.Process(pid)
    before, begun = sum(process.cpu_times()[:2]), time.monotonic()
    await asyncio.sleep(seconds)
    used = sum(process.cpu_times()[:2]) - before
    return 100.0 * used / (time.monotonic() - begun)


def quantile(values: list[float]) -> float:
    return sorted(values)[round(0.95 * (len(values) - 1))]


if __name__ == "__main__":
    main()
