"""No password of an address reaches a record, a message or a page."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.core.urls import HIDDEN, without_secrets


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("http://cam/video?width=1600", "http://cam/video?width=1600"),
        ("http://me:pw@cam:81/v", "http://cam:81/v"),
        ("rtsp://me:p%40w@[::1]:554/s", "rtsp://[::1]:554/s"),
        ("http://cam/v?token=abc&size=640x480", "http://cam/v?token=***&size=640x480"),
        ("http://cam/v?pin=1234", "http://cam/v?pin=***"),
        ("http://cam/v?x=hunter2#frag", "http://cam/v?x=***#***"),
        ("http://cam/v?hunter2", "http://cam/v?***"),
        ("http://cam:port/v", "http://***"),
        ("twin://board.json?speed=4", "twin://board.json?speed=4"),
        ("/dev/ttyACM0", "/dev/ttyACM0"),
    ],
)
def test_addresses_are_shown_without_what_opens_them(address, shown):
    assert without_secrets(address) == shown


word = st.text(alphabet="abcdefghXYZ23456789", min_size=6, max_size=20)


@given(user=word, password=word, token=word)
def test_no_secret_survives_and_a_second_time_changes_nothing(user, password, token):
    secret = f"Q{password}"
    address = (
        f"https://{user}:{secret}@host.example:8443/live?token={secret}&s={secret}"
    )
    shown = without_secrets(address + f"#{token}{secret}")
    assert secret not in shown
    assert HIDDEN in shown
    assert without_secrets(shown) == shown
