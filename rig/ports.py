"""The serial ports of this machine, and a port named by what is plugged in."""

from __future__ import annotations

import contextlib
import os
import stat
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..core.errors import StageError

_TWIN_PORTS = "magbend.rig.virtual"


def register_twin_urls() -> None:
    """Let pyserial open ports named ``twin://...``: it imports the package itself."""
    import serial

    packages = serial.protocol_handler_packages
    if _TWIN_PORTS not in packages:
        packages.append(_TWIN_PORTS)


@dataclass(frozen=True, slots=True, kw_only=True)
class PortInfo:
    """One serial port, and what is known of the device behind it."""

    device: str
    description: str
    serial_number: str
    usb_id: str


def list_ports() -> list[PortInfo]:
    """Return the serial ports of this machine, sorted by name."""
    from serial.tools import list_ports as tool

    ports = [
        PortInfo(
            device=port.device,
            description=port.description or "",
            serial_number=port.serial_number or "",
            usb_id=f"{port.vid:04x}:{port.pid:04x}" if port.vid else "",
        )
        for port in tool.comports()
    ]
    return sorted(ports, key=lambda port: port.device)


def resolve_port(spec: str) -> str:
    """Return the device name of a port.

    Parameters
    ----------
    spec : str
        A device name or URL, which is returned as it is; ``serial:NUMBER`` for the
        USB device with that serial number, whatever name it has today; or ``auto``
        for the only USB serial port there is.

    Raises
    ------
    StageError
        If no port, or more than one, fits.
    """
    if spec != "auto" and not spec.startswith("serial:"):
        return spec
    wanted = spec.removeprefix("serial:")
    ports = [port for port in list_ports() if port.usb_id]
    fitting = [p for p in ports if spec == "auto" or p.serial_number == wanted]
    if len(fitting) == 1:
        return fitting[0].device
    seen = ", ".join(port.device for port in ports) or "none"
    if not fitting and spec == "auto":
        raise StageError(
            "there is no USB serial port: is the cable in, and does it carry data? "
            "(stage.port is auto; a port of another kind must be named)"
        )
    if not fitting:
        raise StageError(f"there is no port with {spec}; USB serial ports here: {seen}")
    raise StageError(
        f"stage.port = {spec!r} fits more than one port ({seen}); name one of them"
    )


def why_not_allowed(port: str, *, network: bool) -> str:
    """Return why a port may not be named, in a clause; empty if it may.

    Of pyserial's addresses only the harmless are taken: others empty files, search the
    machine or start servers. Allowed are device names, ``auto``, ``serial:NUMBER``,
    the virtual ``twin://NAME`` and ``twinmeter://``, a meter's ``visa:RESOURCE``, and,
    with `network`, ``socket://HOST:PORT`` and ``visa:TCPIP...``.
    """
    if "\0" in port:
        return "holds a character that no port has"
    scheme, separator, rest = port.partition("://")
    on_network = (
        "" if network else "is on the network; if it is meant, add network = true"
    )
    if not separator:
        return on_network if port.lower().startswith("visa:tcpip") else ""
    scheme = scheme.lower()
    if scheme == "twin":
        return _why_no_twin(rest.partition("?")[0])
    if scheme == "twinmeter":
        return ""
    if scheme == "socket":
        return on_network
    return (
        "is an address of another kind; write a device name, auto, serial:NUMBER, "
        "twin://FILE.json, or socket://HOST:PORT with network = true"
    )


def _why_no_twin(name: str) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name:
        return "must lie in the folder of the rig file: twin://FILE.json"
    return ""


def allowed_port(port: str, *, network: bool) -> str:
    """Return `port` if it may be named in a file.

    Raises
    ------
    ValueError
        Why not, as the validator of a file says it.
    """
    why = why_not_allowed(port, network=network)
    if why:
        raise ValueError(why)
    return port


def check_port(port: str) -> None:
    """Refuse to open what is no port, whoever named it.

    Raises
    ------
    ValueError
        If it is an address of another kind, a file, a folder or a pipe.
    """
    why = why_not_allowed(port, network=True)
    if why and not port.lower().startswith("twin://"):
        raise ValueError(f"it {why}")
    if os.name != "posix" or "://" in port:
        return
    try:
        mode = Path(port).stat().st_mode
    except OSError:
        return  # opening it says what is wrong
    if not stat.S_ISCHR(mode):
        raise ValueError("it is no device, and is left alone")


def twin_under(port: str, folder: Path) -> str:
    """Return ``twin://FILE.json`` with its file in `folder`; else the port itself."""
    if not port.lower().startswith("twin://"):
        return port
    name, mark, query = port.partition("://")[2].partition("?")
    return f"twin://{folder / name}{mark}{query}" if name.endswith(".json") else port


def _serial_errors() -> tuple[type[Exception], ...]:
    # TypeError: a port that another thread closes in the middle of a read.
    found: list[type[Exception]] = [OSError, ValueError, TypeError]
    with contextlib.suppress(ImportError):  # Windows has none
        import termios

        found.append(termios.error)  # no OSError: a port refuses parity with it
    return tuple(found)


SERIAL_ERRORS = _serial_errors()
"""Whatever a port may raise when it is opened, set up, read or written."""


def why_not_open(port: str, error: Exception) -> str:
    """Return why a port does not open, and the way out, in a sentence."""
    text = str(error)
    busy = ("exclusively lock", "Access is denied", "busy", "temporarily unavailable")
    if any(word in text for word in busy):
        return (
            f"the port {port} is in use by another program; close that program, or "
            "stop it with: magbend rig stop"
        )
    if isinstance(error, PermissionError) or "Permission denied" in text:
        return (
            f"the port {port} may not be opened by this user; on Linux add the user "
            "to the group dialout and log in again"
        )
    if type(error).__name__ == "error":
        return (
            f"the port {port} refuses the line's settings (baud, bits, parity, stop "
            f"bits): {text}; another adapter, or other settings of the device, may do"
        )
    return (
        f"the port {port} cannot be opened: {text}; "
        "magbend rig ports lists what is there"
    )
