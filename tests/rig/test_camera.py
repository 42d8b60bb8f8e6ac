from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from magbend.core.errors import CameraError, ConfigError
from magbend.rig.bench.open import open_camera
from magbend.rig.camera.capture import BrokenPictureError, TornPictureTest
from magbend.rig.camera.config import CameraConfig
from magbend.rig.camera.mjpeg import MultipartParser, decode_jpeg
from magbend.rig.camera.protocol import encode_png, grab_median, median
from magbend.rig.clock import SteppedClock, SystemClock

GENERATOR = np.random.default_rng(5)
NOISE = GENERATOR.integers(0, 12, (120, 160), dtype=np.uint8)


def stamped_jpeg(number: int) -> bytes:
    """A noisy picture that carries its number in eight grey squares."""
    image = NOISE + np.uint8(100)
    for bit in range(16):
        image[4:12, 4 + 9 * bit : 12 + 9 * bit] = 240 if number >> bit & 1 else 10
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes()


def stamp_of(image: np.ndarray) -> int:
    grey = image if image.ndim == 2 else image[:, :, 0]
    bits = (grey[8, 8 + 9 * bit] > 128 for bit in range(16))
    return sum(1 << bit for bit, is_set in enumerate(bits) if is_set)


class StreamServer:
    """A real MJPEG server on loopback; `send` decides what happens to frame n."""

    def __init__(self, fps: float = 50.0, length: bool = True) -> None:
        self.fps = fps
        self.length = length
        self.behave: Callable[[int, bytes], bytes | None] = lambda number, jpeg: jpeg
        self.made_s: dict[int, float] = {}
        self.connections = 0
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._is_closing = False
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._listener.getsockname()[1]}/stream"

    def _accept(self) -> None:
        while not self._is_closing:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self.connections += 1
            threading.Thread(
                target=self._serve, args=(connection,), daemon=True
            ).start()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError), connection:
            connection.recv(4096)
            connection.sendall(
                b"HTTP/1.0 200 OK\r\nContent-Type: "
                b"multipart/x-mixed-replace; boundary=frame\r\n\r\n"
            )
            while not self._is_closing:
                number = len(self.made_s)
                self.made_s[number] = time.monotonic()
                jpeg = self.behave(number, stamped_jpeg(number))
                if jpeg is None:
                    return
                size = f"Content-Length: {len(jpeg)}\r\n" if self.length else ""
                head = f"--frame\r\nContent-Type: image/jpeg\r\n{size}\r\n"
                connection.sendall(head.encode() + jpeg + b"\r\n")
                time.sleep(1.0 / self.fps)

    def close(self) -> None:
        self._is_closing = True
        self._listener.close()


@pytest.fixture
def server() -> Iterator[StreamServer]:
    stream = StreamServer()
    yield stream
    stream.close()


@contextlib.contextmanager
def opened(url: str, **options) -> Iterator:
    config = CameraConfig(
        **{
            "source": url,
            "frame_timeout_s": 0.4,
            "latency_s": 0.0,
            "warmup_s": 0.05,
            **options,
        }
    )
    camera = open_camera(config, Path(), SystemClock())
    try:
        yield camera
    finally:
        camera.close()


@pytest.mark.parametrize("backend", ["mjpeg", "opencv"])
def test_a_picture_is_newer_than_asked_after_a_slow_reader(server, backend) -> None:
    with opened(server.url, backend=backend, frame_timeout_s=3.0) as camera:
        ages = []
        for _ in range(4):
            time.sleep(0.05)
            asked_s = time.monotonic()
            frame = camera.grab_after(asked_s)
            made_s = server.made_s[stamp_of(frame.image)]
            ages.append(time.monotonic() - made_s)
            if backend == "mjpeg":
                assert made_s >= asked_s - 1.0 / server.fps
        print(f"{backend}: oldest picture {max(ages) * 1e3:.0f} ms")
        assert max(ages) < 0.25


def test_a_backlog_is_skipped(server) -> None:
    with opened(server.url) as camera:
        with camera._changed:  # the reader thread stands still: the queue fills
            held_s = time.monotonic()
            while time.monotonic() - held_s < 0.5:
                time.sleep(0.05)
        asked_s = time.monotonic()
        frame = camera.grab_after(asked_s)
        assert server.made_s[stamp_of(frame.image)] >= asked_s - 1.0 / server.fps


@pytest.mark.parametrize("backend", ["mjpeg", "opencv"])
def test_a_truncated_picture_is_never_handed_out(server, backend: str) -> None:
    server.behave = lambda n, jpeg: jpeg[: len(jpeg) // 2] if n % 2 else jpeg
    with opened(server.url, backend=backend, frame_timeout_s=3.0) as camera:
        after_s = time.monotonic()
        for _ in range(10):
            frame = camera.grab_after(after_s)
            after_s = frame.arrival_s
            assert stamp_of(frame.image) % 2 == 0
            assert np.std(frame.image[-8:].astype(float)) > 1.0
        assert camera.identity["broken"] >= 9


def test_truncation_against_the_declared_length_is_caught() -> None:
    whole, cut = stamped_jpeg(1), stamped_jpeg(2)[:500]
    head = b"--b\r\nContent-Length: %d\r\n\r\n"
    stream = head % 9000 + cut + head % len(whole) + whole + b"\r\n--b"
    parser = MultipartParser(b"--b")
    parser.feed(stream, 1.0)
    first, second = parser.next_part(), parser.next_part()
    with pytest.raises(BrokenPictureError, match="cut off after 500 bytes"):
        decode_jpeg(first[0])
    assert stamp_of(decode_jpeg(second[0])) == 1


@pytest.mark.parametrize("size", [1, 7, 1000, 100_000])
def test_parts_do_not_depend_on_how_the_bytes_arrive(size: int) -> None:
    pictures = [stamped_jpeg(n) for n in range(4)]
    stream = b"".join(
        b"--x\r\nContent-Type: image/jpeg\r\n\r\n" + jpeg + b"\r\n" for jpeg in pictures
    )
    parser = MultipartParser(b"--x")
    stamps = []
    for at in range(0, len(stream), size):
        parser.feed(stream[at : at + size], float(at))
        while (part := parser.next_part()) is not None:
            stamps.append(stamp_of(decode_jpeg(part[0])))
    assert stamps == [0, 1, 2, 3]


def test_a_stalled_stream_is_named_and_comes_back_by_itself(server) -> None:
    go_on = threading.Event()

    def stall(number: int, jpeg: bytes) -> bytes:
        if number >= 30:
            go_on.wait(5.0)
        return jpeg

    server.behave = stall
    with opened(server.url) as camera:
        while len(server.made_s) < 31:
            time.sleep(0.02)
        with pytest.raises(CameraError, match="stalled"):
            camera.grab_after(time.monotonic() + 0.4)
        go_on.set()
        asked_s = time.monotonic()
        frame = camera.grab_after(asked_s)
        assert frame.arrival_s > asked_s
        assert camera.identity["reopened"] >= 1


@pytest.mark.parametrize("backend", ["mjpeg", "opencv"])
def test_a_closed_stream_is_opened_again(server, backend: str) -> None:
    server.behave = lambda n, jpeg: None if n == 20 else jpeg
    with opened(server.url, backend=backend, frame_timeout_s=3.0) as camera:
        while len(server.made_s) < 21:
            time.sleep(0.02)
        asked_s = time.monotonic() + 0.05
        frame = camera.grab_after(asked_s)
        assert stamp_of(frame.image) > 20
        assert server.connections >= 2


def test_a_server_that_is_gone_is_named(server) -> None:
    url = server.url
    server.close()
    with pytest.raises(CameraError, match="refused"), opened(url):
        pass


def test_an_address_without_motion_jpeg_is_named() -> None:
    listener = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listener.accept()
                with connection:
                    connection.recv(4096)
                    connection.sendall(
                        b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<html>"
                    )

    threading.Thread(target=answer, daemon=True).start()
    url = f"http://127.0.0.1:{listener.getsockname()[1]}/"
    try:
        with pytest.raises(CameraError, match="text/html"), opened(url):
            pass
    finally:
        listener.close()


def test_the_password_of_an_address_is_nowhere(server) -> None:
    url = server.url.replace("http://", "http://lab:secret@")
    with opened(url) as camera:
        assert "secret" not in str(camera.identity)


def test_a_missing_device_is_named() -> None:
    with pytest.raises(CameraError, match="cannot be opened"), opened("/dev/video97"):
        pass


def test_a_flat_band_is_torn_until_it_is_the_scene() -> None:
    judge = TornPictureTest()
    good = NOISE + np.uint8(100)
    torn = good.copy()
    torn[60:] = 128
    white = good.copy()
    white[60:] = 255
    assert [judge.is_torn(i) for i in (good, torn, good, white)] == [
        False, True, False, False,
    ]  # fmt: skip
    assert [judge.is_torn(torn) for _ in range(6)] == [True] * 4 + [False] * 2


def test_the_median_drops_an_outlier_and_keeps_the_type() -> None:
    stack = [np.full((4, 4, 3), v, np.uint8) for v in (10, 12, 200)]
    assert np.array_equal(median(stack), np.full((4, 4, 3), 12, np.uint8))
    assert median(stack[:1]) is stack[0]
    with pytest.raises(CameraError, match="size"):
        median([stack[0], np.zeros((5, 4, 3), np.uint8)])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_photographs_are_stored_pixel_for_pixel(dtype) -> None:
    image = GENERATOR.integers(0, np.iinfo(dtype).max, (31, 17, 3)).astype(dtype)
    data = np.frombuffer(encode_png(image), np.uint8)
    assert np.array_equal(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), image)


def test_a_folder_replays_one_picture_a_step(tmp_path: Path) -> None:
    for number in (10, 2, 1):
        cv2.imwrite(str(tmp_path / f"shot_{number}.png"), np.full((8, 8), number, "u1"))
    clock = SteppedClock()
    camera = open_camera(CameraConfig(source=str(tmp_path)), Path(), clock)
    values = []
    for step in range(3):
        camera.at_step(step, 70.0)
        values.append(int(grab_median(camera, clock, 3).image[0, 0]))
    assert values == [1, 2, 10]
    camera.at_step(3, 40.0)
    with pytest.raises(CameraError, match="a picture for every step"):
        camera.grab_after(0.0)


def test_a_watched_folder_gives_what_is_saved_later(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "old.png"), np.full((8, 8), 1, "u1"))
    clock = SteppedClock()
    config = CameraConfig(source=str(tmp_path), watch=True, frame_timeout_s=0.5)
    camera = open_camera(config, Path(), clock)
    with pytest.raises(CameraError, match="a new picture must be saved"):
        camera.grab_after(0.0)
    cv2.imwrite(str(tmp_path / "new.png"), np.full((8, 8), 2, "u1"))
    assert camera.grab_after(0.0).image[0, 0] == 2


def test_a_video_is_replayed_frame_by_frame(tmp_path: Path) -> None:
    path = tmp_path / "swing.avi"
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48), isColor=False
    )
    for level in (40, 120, 200):
        writer.write(np.full((48, 64), level, np.uint8))
    writer.release()
    camera = open_camera(CameraConfig(source=str(path)), Path(), SteppedClock())
    levels = [float(camera.grab_after(0.0).image.mean()) for _ in range(3)]
    assert levels == pytest.approx([40, 120, 200], abs=3)
    with pytest.raises(CameraError, match="is over"):
        camera.grab_after(0.0)
    camera.close()


@pytest.mark.parametrize("name", ["exposure", "gain", "white_balance_K", "width_px"])
def test_a_setting_that_a_stream_cannot_take_is_refused(name: str) -> None:
    config = CameraConfig(source="http://127.0.0.1:9/stream", **{name: 100})
    with pytest.raises(ConfigError, match=rf"camera\.{name} cannot be set"):
        open_camera(config, Path(), SystemClock())


def test_the_twin_camera_is_not_made_here() -> None:
    with pytest.raises(ConfigError, match="twin"):
        open_camera(CameraConfig(backend="twin"), Path(), SteppedClock())
