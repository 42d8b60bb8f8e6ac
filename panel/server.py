"""Serve the panel: the address, the port that must be free, the token, the browser."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass

from ..core.errors import InputError, RigError
from .panel import Panel

DEFAULT_PORT = 8765


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where the panel listens.

    Parameters
    ----------
    host : str
        An address of this machine; beyond loopback a token is made and asked for.
    port : int
        0 takes any free one.
    names : tuple of str
        Further names by which browsers reach it, such as that of a TLS proxy.

    Raises
    ------
    InputError
        If the host is no address of a machine, or the port no port.
    """

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        try:
            ipaddress.ip_address(self.host)
        except ValueError:
            raise InputError(
                f"--host must be an address of this machine, such as 127.0.0.1; "
                f"instead received {self.host!r}"
            ) from None
        if not 0 <= self.port <= 65535:
            raise InputError(
                f"--port must be from 0 to 65535; instead received {self.port}"
            )

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return ipaddress.ip_address(self.host).is_loopback

    def is_ours(self, host: str, port: int) -> bool:
        """Whether a browser that asks for `host` means this panel.

        Names must be ours, since a foreign name may be made to point here; a bare
        address cannot, so beyond loopback any address with our port will do.
        """
        name, _, given_port = host.rpartition(":")
        if given_port != str(port) and host not in self.names:
            return False
        if name in ("127.0.0.1", "localhost", "[::1]", *self.names):
            return True
        return host in self.names or (not self.is_loopback and _is_address(name))


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


def listen(address: Address) -> socket.socket:
    """Return a socket that listens at an address.

    Raises
    ------
    RigError
        If the port is taken, or the address is not one of this machine.
    """
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((address.host, address.port))
        listener.listen(128)  # whoever reads the address may connect at once
    except OSError as error:
        listener.close()
        raise RigError(_why_not(address, error)) from None
    return listener


def _why_not(address: Address, error: OSError) -> str:
    where = f"port {address.port} of {address.host}"
    if error.errno == errno.EADDRINUSE:
        return (
            f"{where} is taken, perhaps by another panel: look at "
            f"http://{address.host}:{address.port}/, or name another one with --port"
        )
    if error.errno == errno.EACCES:
        return f"{where} is reserved by the system; name one above 1023 with --port"
    return f"cannot listen on {where}: {error.strerror}"


def serve(
    panel: Panel,
    address: Address,
    *,
    browser: bool = True,
    tell: Callable[[str], None],
    stop: threading.Event | None = None,
) -> None:
    """Serve the panel until Ctrl-C.

    Parameters
    ----------
    panel : Panel
        What is served; closed at the end, which leaves runs alone.
    address : Address
        Where.
    browser : bool
        Open the page in the browser of this machine.
    tell : callable
        Told the address of the page, with its token, and what else is to be known.
    stop : Event, optional
        Ends it from another thread.

    Raises
    ------
    RigError
        If the port is taken.
    """
    import uvicorn

    from .app import make_app

    with contextlib.closing(listen(address)) as listener:
        port = int(listener.getsockname()[1])
        token = "" if address.is_loopback else secrets.token_urlsafe(24)
        app = make_app(panel, lambda host: address.is_ours(host, port), token=token)
        server = uvicorn.Server(
            uvicorn.Config(
                app, log_level="error", access_log=False, server_header=False,
                ws="websockets-sansio", ws_per_message_deflate=False,
                ws_max_size=65536, timeout_graceful_shutdown=1, lifespan="on",
            )
        )  # fmt: skip
        own = f"[{address.host}]" if ":" in address.host else address.host
        url = f"http://{own}:{port}/" + (f"?token={token}" if token else "")
        tell(url)
        if token:
            tell(
                "anybody with this address may move the bench; it is not encrypted: "
                "put a proxy with TLS in front of it where the network is not yours"
            )
        panel.begin()
        try:
            if browser:
                threading.Timer(0.5, webbrowser.open, (url,)).start()
            if stop is not None:
                threading.Thread(
                    target=_end, args=(server, stop), daemon=True, name="panel end"
                ).start()
            server.run(sockets=[listener])
        finally:
            panel.close()


def _end(server: object, stop: threading.Event) -> None:
    stop.wait()
    server.should_exit = True  # type: ignore[attr-defined]
