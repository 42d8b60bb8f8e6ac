"""The serial ports of this machine, and a port named by what is plugged in."""

from __future__ import annotations

from dataclasses import dataclass

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
    return (
        f"the port {port} cannot be opened: {text}; "
        "magbend rig ports lists what is there"
    )
