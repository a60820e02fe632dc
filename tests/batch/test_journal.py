from __future__ import annotations

import pytest

from circlepose.batch.journal import Journal
from circlepose.errors import OutputError, UsageError

CONDITIONS = {"circlepose": "1", "method": "a"}
VALUES = {f"image{number}.png": {"number": number, "name": "caf\udce9\n"} for number in range(4)}


def opened(path, conditions=CONDITIONS, resume=True):
    return Journal(path, conditions, resume=resume, output="out.csv")


def found(path):
    with opened(path) as journal:
        return {key: journal.find(key) for key in VALUES if journal.find(key) is not None}


@pytest.fixture
def path(tmp_path):
    """A journal of four images."""
    path = tmp_path / "out.csv.journal"
    with opened(path) as journal:
        for key, values in VALUES.items():
            journal.add(key, values)
    return path


def test_what_was_added_is_found_when_it_is_opened_again(path):
    assert found(path) == VALUES
    with opened(path) as journal:
        assert journal.find("other") is None
        journal.add("image0.png", {"number": 10})
    assert found(path)["image0.png"] == {"number": 10}


def test_wherever_it_was_torn_the_whole_lines_are_found_and_it_can_be_added_to(path):
    content = path.read_bytes()
    ends = [at + 1 for at, byte in enumerate(content) if byte == ord("\n")]
    for cut in range(len(content)):
        path.write_bytes(content[:cut])
        whole = max(0, sum(end <= cut for end in ends) - 2)
        assert found(path) == dict(list(VALUES.items())[:whole]), cut
        with opened(path) as journal:
            journal.add("image3.png", {"number": 30})
        assert found(path)["image3.png"] == {"number": 30}, cut


def test_a_damaged_line_and_what_follows_it_are_done_again(path):
    content = path.read_bytes()
    lines = content.splitlines(keepends=True)
    at = len(b"".join(lines[:4]))
    for flipped in range(at, at + len(lines[4])):
        damaged = bytearray(content)
        damaged[flipped] ^= 4
        path.write_bytes(damaged)
        assert set(found(path)) == {"image0.png", "image1.png"}, flipped


def test_without_resume_it_begins_anew(path):
    with opened(path, resume=False) as journal:
        assert journal.discarded
        assert journal.find("image0.png") is None
    assert found(path) == {}
    with opened(path, resume=False) as journal:
        assert not journal.discarded


def test_other_conditions_are_refused_and_named(path):
    before = path.read_bytes()
    with pytest.raises(UsageError, match=r"method was a and is b; refine was not there and is True\. Give the"):
        opened(path, {"circlepose": "1", "method": "b", "refine": "True"})
    assert path.read_bytes() == before
    opened(path, {"method": "b"}, resume=False).__exit__()


def test_two_runs_do_not_write_the_same(path):
    pytest.importorskip("fcntl")
    with opened(path), pytest.raises(UsageError, match=r"out\.csv: another run is writing it"):
        opened(path)
    assert found(path) == VALUES


def test_a_file_that_is_no_journal_is_left_alone(path):
    path.write_text("precious")
    with pytest.raises(OutputError, match="exists and is not a circlepose journal; move or delete it"):
        opened(path)
    assert path.read_text() == "precious"


def test_a_journal_of_an_earlier_version_is_refused_and_never_misread(path):
    path.write_bytes(path.read_bytes().replace(b"journal 2", b"journal 1", 1))
    before = path.read_bytes()
    with pytest.raises(UsageError, match=r"by an earlier version of circlepose.*leave out --resume"):
        opened(path)
    assert path.read_bytes() == before
    with opened(path, resume=False) as journal:
        assert journal.discarded
    assert found(path) == {}


def test_a_missing_folder_is_told_in_terms_of_the_output(tmp_path):
    with pytest.raises(OutputError, match=r"^out\.csv: the folder"):
        opened(tmp_path / "gone" / "out.csv.journal")


def test_it_is_removed_when_nothing_is_left(path):
    with opened(path) as journal:
        journal.remove()
    assert not path.exists()
