"""Virtual devices: the same driver code runs on them and on the bench."""

from __future__ import annotations


def register_twin_urls() -> None:
    """Let pyserial open ports named ``twin://...`` (see `protocol_twin`)."""
    import serial

    packages = serial.protocol_handler_packages
    if __name__ not in packages:
        packages.append(__name__)
