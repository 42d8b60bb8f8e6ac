"""Make a release: changelog, hashed pins, wheel and sdist, checked and tried.

``make release VERSION=0.2.0`` writes the version, joins ``changes/`` into CHANGELOG.md,
pins every dependency with its hashes, builds, lets twine read the result, and installs
the wheel into an empty environment where it must bend a rod. Nothing is uploaded.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KINDS = {"added": "Added", "changed": "Changed", "fixed": "Fixed"}
TIP = "29.53532"
"""x in mm of the tip of GMC 2 at 50 mT and 90 degrees."""


def set_version(version: str) -> None:
    """Write the version where it stands: pyproject.toml and CITATION.cff."""
    today = datetime.now(UTC).date().isoformat()
    edits = {
        "pyproject.toml": [(r'(?m)^version = "[^"]*"', f'version = "{version}"')],
        "CITATION.cff": [
            (r"(?m)^version: .*", f"version: {version}"),
            (r"(?m)^date-released: .*", f"date-released: {today}"),
        ],
    }
    for name, pairs in edits.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        for pattern, new in pairs:
            text = re.sub(pattern, new, text, count=1)
        (ROOT / name).write_text(text, encoding="utf-8")


def join_changes(version: str) -> None:
    """Put the fragments of ``changes/`` on top of CHANGELOG.md and remove them."""
    lines = [f"## {version} ({datetime.now(UTC).date().isoformat()})", ""]
    for kind, title in KINDS.items():
        paths = sorted((ROOT / "changes").glob(f"*.{kind}.md"))
        said = [path.read_text(encoding="utf-8").strip() for path in paths]
        said = [text if text.startswith(("-", "*")) else f"- {text}" for text in said]
        if said:
            lines += [f"### {title}", "", *said, ""]
        for path in paths:
            path.unlink()
    log = ROOT / "CHANGELOG.md"
    head, *rest = re.split(r"(?m)^(?=## )", log.read_text(encoding="utf-8"), maxsplit=1)
    log.write_text(head + "\n".join(lines) + "\n" + "".join(rest), encoding="utf-8")


def pin_with_hashes() -> None:
    """Write requirements.txt: every dependency of every extra, with its digests."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = set(project["project"]["optional-dependencies"]) - {"all"}  # is the others
    run(
        sys.executable, "-m", "piptools", "compile", "--quiet", "--generate-hashes",
        "--no-emit-index-url", "--no-emit-find-links", "--no-header", "--strip-extras",
        *(f"--extra={name}" for name in sorted(extras)),
        "--constraint", "constraints.txt",
        "--output-file", "requirements.txt", "pyproject.toml",
    )  # fmt: skip


def build() -> Path:
    """Build sdist and wheel, let twine read them; return the wheel."""
    shutil.rmtree(ROOT / "dist", ignore_errors=True)
    run(sys.executable, "-m", "build", "--outdir", "dist")
    made = sorted((ROOT / "dist").iterdir())
    run(sys.executable, "-m", "twine", "check", "--strict", *map(str, made))
    return next(path for path in made if path.suffix == ".whl")


def try_out(wheel: Path) -> None:
    """Install the wheel into an empty environment and bend a rod with it."""
    with tempfile.TemporaryDirectory() as folder:
        run(sys.executable, "-m", "venv", folder)
        binaries = Path(folder) / ("Scripts" if sys.platform == "win32" else "bin")
        run(str(binaries / "python"), "-m", "pip", "install", "--quiet",
            "--constraint", "constraints.txt", str(wheel))  # fmt: skip
        done = subprocess.run(
            [binaries / "magbend", "sim", "shape", "--gmc", "2", "--field-mT", "50"],
            check=True, capture_output=True, text=True, cwd=folder,
        )  # fmt: skip
        if TIP not in done.stdout:
            sys.exit(f"the installed wheel bends another rod:\n{done.stdout}")
        run(str(binaries / "magbend"), "examples", "--out", f"{folder}/examples")


def run(*command: str) -> None:
    """Run a command in the repository; stop where it fails."""
    if subprocess.run(command, cwd=ROOT, check=False).returncode:
        sys.exit(f"failed: {' '.join(command)}")


def main() -> None:
    """Make the release named on the command line."""
    if len(sys.argv) != 2 or not re.fullmatch(r"\d+\.\d+\.\d+", sys.argv[1]):
        sys.exit("Input VERSION must be three numbers: make release VERSION=0.2.0")
    set_version(sys.argv[1])
    join_changes(sys.argv[1])
    pin_with_hashes()
    try_out(build())
    print("look at git diff and dist/, commit, tag, and upload dist/ with twine")


if __name__ == "__main__":
    main()
