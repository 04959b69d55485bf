"""No bit of a run, a score or a result of a verb has changed: the compositions of tests/bits.yaml, one by one."""

import json

import bits
import pytest


@pytest.mark.parametrize("name", bits.NAMES)
def test_bits_are_those_that_were_kept(name, tmp_path):
    told = bits.difference(name, bits.compute(name, tmp_path))
    if told and bits.fitted(told):
        pytest.xfail(f"{told}; {bits.other_machine()}")
    assert not told, f"{told}; if that is meant: python tests/bits.py --write"


def test_another_machine_excuses_the_result_of_a_fit_and_no_trajectory(monkeypatch):
    monkeypatch.setattr(bits, "other_machine", lambda: "elsewhere")
    assert bits.fitted("verbs, wedge: 2 calibrate_lateral")
    assert not bits.fitted("verbs, wedge: 2 calibrate_lateral, 2 trajectory")
    assert not bits.fitted("open_loop: results")
    monkeypatch.setattr(bits, "other_machine", lambda: "")
    assert not bits.fitted("verbs, wedge: 2 calibrate_lateral")


def test_part_of_the_file_written_elsewhere_keeps_no_result_of_a_fit(monkeypatch, tmp_path, capsys):
    file = tmp_path / "bits.json"
    before = {"functions": {"numpy": "another"}, "hashes": {"open_loop": {"trajectory": "old"}}}
    file.write_text(json.dumps(before))
    monkeypatch.setattr(bits, "FILE", file)
    monkeypatch.setattr("sys.argv", ["bits.py", "--write", "wedge"])
    with pytest.raises(SystemExit):
        bits.main()
    assert "write all" in capsys.readouterr().err and json.loads(file.read_text()) == before
    monkeypatch.setattr("sys.argv", ["bits.py", "--write", "open_loop"])
    bits.main()
    after = json.loads(file.read_text())
    assert after["functions"] == before["functions"] and after["hashes"]["open_loop"] != before["hashes"]["open_loop"]


def test_every_hash_that_is_kept_is_compared():
    assert list(json.loads(bits.FILE.read_text())["hashes"]) == bits.NAMES
