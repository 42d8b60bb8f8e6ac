"""A sealed record notices every changed bit; a chain notices a line that is gone."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from magbend.core.seal import is_whole, seal_of, sealed

RECORD = {"index": 3, "gap_mm": 60.0, "flags": ["no_flux"], "name": 'a"b{}é\n'}


def test_every_single_bit_that_flips_is_noticed():
    for data in (sealed(RECORD).encode(), sealed(RECORD, indent=1).encode()):
        assert is_whole(data)
        for at in range(len(data)):
            for bit in range(8):
                flipped = bytearray(data)
                flipped[at] ^= 1 << bit
                assert not is_whole(bytes(flipped)), (at, bit)


def test_the_record_is_read_as_it_was_and_the_seal_is_its_last_key():
    text = sealed(RECORD, indent=1)
    data = json.loads(text)
    assert data.pop("seal") == seal_of(text.encode())
    assert data == RECORD


@given(st.dictionaries(st.text(), st.text() | st.integers() | st.none()))
def test_no_content_confuses_the_seal(record):
    record.pop("seal", None)
    record["fake"] = '"seal": "' + "0" * 64 + '"}'
    assert is_whole(sealed(record).encode())
    assert not is_whole(json.dumps(record).encode())
