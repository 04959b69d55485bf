"""No bit of a run, a score or a result of a verb has changed: the compositions of tests/bits_cases.py, one by one."""

import json

import bits
import pytest


@pytest.mark.parametrize("name", bits.NAMES)
def test_bits_are_those_that_were_kept(name, tmp_path):
    told = bits.difference(name, bits.compute(name, tmp_path))
    if told and name in bits.FITTED and (machine := bits.other_machine()):
        pytest.xfail(f"{told}; {machine}")
    assert not told, f"{told}; if that is meant: python tests/bits.py --write"


def test_every_hash_that_is_kept_is_compared():
    assert list(json.loads(bits.FILE.read_text())["hashes"]) == bits.NAMES
