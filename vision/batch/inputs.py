"""What to measure: files, folders, runs and videos as one list of named pictures."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from ...core.errors import VisionError
from ..picture.header import count_pages
from ..picture.photo import Photo, as_photo, read_photo, refuse_special
from ..picture.video import Video, count_frames

PICTURES = frozenset(
    (
        ".png",
        ".jpg",
        ".jpeg",
        ".tif",
        ".tiff",
        ".bmp",
        ".webp",
        ".avif",
        ".heic",
        ".heif",
    )
)
UNREADABLE = frozenset(
    (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".gif", ".psd",
     ".xcf", ".jp2", ".jxl", ".pdf")
)  # fmt: skip
"""Pictures that are not read: named in a row of their own, never left out silently."""
VIDEOS = frozenset({".avi", ".mp4", ".m4v", ".mov", ".mkv", ".webm"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """One picture to measure.

    Parameters
    ----------
    image : str
        Its name in the tables: the file's name, or ``video_000123`` for a frame.
    path : Path
        The file.
    frame : int or None
        Number of the frame in a video.
    overlay : str
        Name of its overlay.
    run : Path or None
        The run or video it belongs to, which has one clamp; None if loose.
    """

    image: str
    path: Path
    frame: int | None = None
    overlay: str = ""
    run: Path | None = None

    def follows(self, other: Source) -> bool:
        """Whether this is the next frame of the same film."""
        if self.frame is None or other.frame is None:
            return False
        return self.path == other.path and self.frame == other.frame + 1


def list_sources(paths: Iterable[Path]) -> list[Source]:
    """Return every picture that the user's paths mean, in their order.

    A folder stands for its pictures sorted by name, a run for those in its
    ``images/``, a video for its frames. Files of the same name keep the name of their
    folder.

    Raises
    ------
    VisionError
        If a path is missing or a folder has no picture.
    """
    sources: list[Source] = []
    for path in paths:
        if path.is_dir():
            sources.extend(_of_folder(path))
        elif not path.exists():
            raise VisionError(f"{path}: there is no such file")
        elif path.suffix.lower() in VIDEOS:
            refuse_special(path)
            sources.extend(_of_video(path))
        else:
            sources.extend(_of_picture(path))
    if not sources:
        raise VisionError(
            "at least one photograph must be given; instead received none"
        )
    return _with_distinct_names(sources)


def _of_folder(folder: Path) -> list[Source]:
    is_run = (folder / "run.json").exists() or (folder / "steps.jsonl").exists()
    within = folder / "images" if is_run else folder
    found = (
        sorted(
            path
            for path in within.iterdir()
            if path.suffix.lower() in PICTURES | UNREADABLE
            and not path.name.startswith(".")
            and not path.is_dir()
        )
        if within.is_dir()
        else []
    )
    if not found:
        raise VisionError(f"{within}: this folder has no photographs")
    run = folder.resolve() if is_run else None
    return [source for path in found for source in _of_picture(path, run)]


def _of_picture(path: Path, run: Path | None = None) -> list[Source]:
    """Return a picture, or each page of a TIFF with several."""
    pages = count_pages(path)
    if pages < 2:
        return [Source(image=path.name, path=path, run=run)]
    return [
        Source(image=f"{path.stem}_{page:06d}", path=path, frame=page, run=run or path)
        for page in range(pages)
    ]


def _of_video(path: Path) -> list[Source]:
    count = count_frames(path)
    if count <= 0:
        return [Source(image=path.name, path=path, frame=0)]  # fails in its row
    return [
        Source(image=f"{path.stem}_{frame:06d}", path=path, frame=frame, run=path)
        for frame in range(count)
    ]


def _with_distinct_names(sources: list[Source]) -> list[Source]:
    """Add the folder's name, then a number, to names that occur twice."""
    unique = _renamed(list(dict.fromkeys(sources)), by_number=False)
    unique = _renamed(unique, by_number=True)
    stems = Counter(_stem(source) for source in unique)
    return [
        replace(
            source,
            overlay=(source.image if stems[_stem(source)] > 1 else _stem(source))
            + ".png",
        )
        for source in unique
    ]


def _renamed(sources: list[Source], *, by_number: bool) -> list[Source]:
    held = Counter(source.image for source in sources)
    renamed = []
    for index, source in enumerate(sources):
        before = f"{index:04d}" if by_number else source.path.parent.name
        image = f"{before}_{source.image}" if held[source.image] > 1 else source.image
        renamed.append(replace(source, image=image))
    return renamed


def _stem(source: Source) -> str:
    return source.image if source.frame is not None else Path(source.image).stem


def read_source(source: Source, *, linear: bool | None = None) -> Photo:
    """Read one picture; `linear` as for `read_photo`.

    Raises
    ------
    VisionError
        If it cannot be read.
    """
    ending = source.path.suffix.lower()
    if ending in UNREADABLE:
        raise VisionError(
            f"{source.path.name}: {ending[1:].upper()} is not read; convert it to PNG, "
            "TIFF or JPEG"
        )
    if ending not in VIDEOS:
        return read_photo(source.path, linear=linear, page=source.frame or 0)
    video = _video(source.path)
    if not video.opened:
        raise VisionError(
            f"{source.path.name}: this video cannot be opened or has no frames"
        )
    pixels = video.read(source.frame or 0)
    if pixels is None:
        raise VisionError(
            f"{source.path.name}: frame {source.frame} cannot be decoded; "
            "the video may be cut off"
        )
    return as_photo(pixels, source=source.image)


def digest(source: Source) -> str:
    """Return the SHA-256 of the file (of a video: with the number of the frame)."""
    refuse_special(source.path)
    key = _file_digest(source.path, source.path.stat().st_mtime_ns)
    return key if source.frame is None else f"{key}#{source.frame}"


@cache
def _file_digest(path: Path, _changed: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@cache
def _video(path: Path) -> Video:
    return Video(path)
