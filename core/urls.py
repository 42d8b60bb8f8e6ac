"""Addresses without what opens them: for records, messages and pages."""

from __future__ import annotations

import re
from urllib.parse import urlsplit

_SECRET = re.compile(
    r"(?i)pass|pwd|pin\b|token|secret|key|auth|sig|session|user|login|account|cred"
)
_HARMLESS = re.compile(r"[0-9]{1,5}|[0-9]{1,4}x[0-9]{1,4}|true|false|mjpe?g|jpe?g|png")
HIDDEN = "***"


def without_secrets(text: str) -> str:
    """Return an address without user, password and secret values of its query.

    Of a query only values stay that cannot be secrets (short numbers, sizes, kinds of
    picture), under names that do not sound like one. Other texts stay as they are.
    """
    if "://" not in text:
        return text
    try:
        parts = urlsplit(text)
        port = f":{parts.port}" if parts.port else ""
        host = parts.hostname or ""
    except ValueError:
        return f"{text.partition('://')[0]}://{HIDDEN}"
    host = f"[{host}]" if ":" in host else host
    query = "&".join(_harmless(pair) for pair in parts.query.split("&") if pair)
    fragment = HIDDEN if parts.fragment else ""
    return parts._replace(
        netloc=f"{host}{port}", query=query, fragment=fragment
    ).geturl()


def _harmless(pair: str) -> str:
    name, equals, value = pair.partition("=")
    if not equals:
        return HIDDEN if not _HARMLESS.fullmatch(name) else name
    if not value or (_HARMLESS.fullmatch(value) and not _SECRET.search(name)):
        return pair
    return f"{name}={HIDDEN}"
