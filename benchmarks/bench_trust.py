"""How well files hold: bits flipped, two writers, hostile folders, fuzzed inputs.

Prints the figures that `docs/explanations/trust.md` promises; every input is drawn from
a seed that no test uses. Run it with a share of the full counts: ``--share 0.1``.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from magbend.core.errors import MagbendError
from magbend.core.json import parse_json
from magbend.core.picture import decode_picture
from magbend.core.seal import is_whole
from magbend.rig import check_run, migrate_run, read_run, verify_run
from magbend.rig.runs.read import read_steps

RUNS = Path(__file__).parents[1] / "fixtures" / "runs"
SEED = 90_210
WRITER = """
import pathlib, sys, time
from magbend.core.errors import MagbendError
from magbend.rig.runs.folder import RunFolder
from magbend.rig.runs.read import is_run
from magbend.core.owned import owning_folder
out, name, wait = pathlib.Path(sys.argv[1]), sys.argv[2], float(sys.argv[3])
time.sleep(wait)
try:
    with owning_folder(out, "run", "rig run", ours=is_run):
        manifest = {"name": name, "plan": {"gaps_mm": [3, 2, 1]}}
        folder = RunFolder.create(out, manifest, "plan")
        for index in range(3):
            picture = {folder.image_name(index): name.encode() * 1000}
            folder.commit_step({"index": index, "gap_mm": 3 - index}, picture)
            time.sleep(0.02)
        folder.finish("success", "done")
    print("wrote")
except MagbendError as error:
    print("refused:", error)
"""


def proved(kind: str, folder: Path) -> Path:
    out = folder / kind
    shutil.copytree(RUNS / f"format_1_{kind}", out)
    migrate_run(out)
    return out


def flip_bits(share: float, generator: random.Random) -> None:
    """Flip one bit in every file of a finished and of a cut-off run."""
    with tempfile.TemporaryDirectory() as name:
        for kind in ("finished", "cut_off"):
            out = proved(kind, Path(name))
            files = sorted(path for path in out.rglob("*") if path.is_file())
            tried = named = 0
            for path in files:
                data = path.read_bytes()
                for _ in range(max(1, round(20 * share)) if data else 0):
                    flipped = bytearray(data)
                    flipped[generator.randrange(len(data))] ^= 1 << generator.randrange(
                        8
                    )
                    path.write_bytes(flipped)
                    check = check_run(out)
                    inner = path.relative_to(out).as_posix()
                    bad = [one.name for one in check.files if one.status != "good"]
                    named += any(inner in one for one in (*bad, *check.problems))
                    tried += 1
                path.write_bytes(data)
            print(f"{kind}: {named} of {tried} flipped bits named, {len(files)} files")


def two_writers(share: float, generator: random.Random) -> None:
    """Let two processes begin a run in one folder, at random moments."""
    lost = 0
    times = max(2, round(10 * share))
    for _ in range(times):
        with tempfile.TemporaryDirectory() as name:
            out = Path(name) / "run"
            waits = (0.0, generator.uniform(0.0, 0.12))
            started = [
                subprocess.Popen(
                    [sys.executable, "-c", WRITER, str(out), word, str(wait)],
                    stdout=subprocess.PIPE, text=True,
                )
                for word, wait in zip(("one", "two"), waits, strict=True)
            ]  # fmt: skip
            said = [process.communicate(timeout=120)[0] for process in started]
            wrote = [word.startswith("wrote") for word in said]
            good = verify_run(out) == [] and len(read_run(out).steps) == 3
            lost += not (good and sum(wrote) == 1)
    print(f"two writers: {lost} of {times} interleavings lost or mixed anything")


def hostile(folder: Path) -> list[tuple[str, Path]]:
    """Make folders that hang or choke a careless reader."""
    made = []

    def run_with(name: str, file: str, data: bytes) -> None:
        out = folder / name
        shutil.copytree(RUNS / "format_1_finished", out)
        (out / file).write_bytes(data)
        made.append((name, out))

    steps = (RUNS / "format_1_finished" / "steps.jsonl").read_bytes().splitlines()
    run_with("deep run.json", "run.json", b'{"schema": 2, "plan": ' + b"[" * 100_000)
    run_with("null plan", "run.json", b'{"schema": 2, "plan": null, "rig": 3}')
    run_with("digits", "run.json", b'{"schema": ' + b"9" * 400 + b"}")
    run_with("no status", "end.json", b"{}")
    run_with("null hashes", "end.json", b'{"status": "success", "sha256": null}')
    run_with(
        "50 000 lines",
        "steps.jsonl",
        b"\n".join(b'{"index": %d, "gap_mm": 1}' % i for i in range(50_000)) + b"\n",
    )
    run_with(
        "names that leave",
        "steps.jsonl",
        steps[0].replace(b"images/step_000.png", b"../../../etc/passwd") + b"\n",
    )
    run_with("null files", "steps.jsonl", b'{"index": 0, "files": [null]}\n')
    run_with("text in a number", "steps.jsonl", b'{"index": 0, "gap_mm": "x"}\n')
    for name, file in (("pipe", "run.json"), ("zero", "images/step_000.png")):
        out = folder / name
        shutil.copytree(RUNS / "format_1_finished", out)
        (out / file).unlink()
        if name == "pipe":
            __import__("os").mkfifo(out / file)
        else:
            (out / file).symlink_to("/dev/zero")
        made.append((name, out))
    return made


def hostile_folders() -> None:
    """Verify and load hostile folders in processes of their own."""
    with tempfile.TemporaryDirectory() as name:
        for kind, out in hostile(Path(name)):
            for words in (
                ["rig", "verify", str(out)],
                ["analysis", "compare", str(out)],
            ):
                start_s = time.monotonic()
                done = subprocess.run(
                    [sys.executable, "-m", "magbend.cli.main", *words],
                    capture_output=True, text=True, timeout=120, check=False,
                )  # fmt: skip
                took_s = time.monotonic() - start_s
                peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
                said = (done.stdout + done.stderr).strip().splitlines()
                trace = any("Traceback" in line for line in said)
                print(
                    f"{kind:18} {words[1]:8} rc {done.returncode}, {took_s:4.1f} s, "
                    f"peak so far {peak:.2f} GB{', TRACEBACK' if trace else ''}: "
                    f"{said[0][-90:] if said else ''}"
                )


def fuzz(share: float, generator: random.Random) -> None:
    """Change bytes of records and pictures; count what is no sentence."""
    count, wrong, accepted = round(20_000 * share), 0, 0
    png = (RUNS / "format_1_finished/images/step_000.png").read_bytes()[:4000]
    with tempfile.TemporaryDirectory() as name:
        out = proved("finished", Path(name))
        texts = [(out / one).read_bytes() for one in ("run.json", "end.json")]
        lines = (out / "steps.jsonl").read_bytes()
        for turn in range(count):
            kind = turn % 4
            data = bytearray([*texts, lines, png][kind])
            for _ in range(generator.randrange(1, 6)):
                at = generator.randrange(len(data))
                act = generator.randrange(3)
                if act == 0:
                    data[at] = generator.randrange(256)
                elif act == 1:
                    del data[at : at + generator.randrange(1, 40)]
                else:
                    data[at:at] = generator.randbytes(generator.randrange(1, 40))
            is_same = bytes(data) == [*texts, lines, png][kind]
            try:
                if kind < 2:
                    accepted += is_whole(bytes(data)) and not is_same
                    with contextlib.suppress(ValueError):
                        parse_json(bytes(data))
                elif kind == 2:
                    path = Path(name) / "steps.jsonl"
                    path.write_bytes(data)
                    read_steps(path)
                else:
                    decode_picture(bytes(data), "x", MagbendError)
            except MagbendError:
                pass
            except Exception as error:  # what a fuzz loop is for
                wrong += 1
                print(f"{type(error).__name__}: {error}")
    print(f"fuzz: {count} inputs, {wrong} not a sentence, {accepted} silently accepted")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0)
    share = parser.parse_args().share
    generator = random.Random(SEED)
    flip_bits(share, generator)
    two_writers(share, generator)
    hostile_folders()
    fuzz(share, generator)
