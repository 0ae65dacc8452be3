"""Headers of pages of measured results: what is written is read again, and nothing that is no header is."""

from __future__ import annotations

import hashlib
from datetime import date

import pytest

from macs.fronts.provenance import versions
from runs.report import page as page_header
from runs.report.page import PageHeader, digest


def test_header_as_written_is_read_again(tmp_path):
    file = tmp_path / "study.toml"
    file.write_bytes(b'name = "one"\n')
    header = PageHeader.now("macs study report out/one --page one.md", digest(file))
    assert header.date == date.today().isoformat()
    assert header.digest == hashlib.sha256(b'name = "one"\n').hexdigest() == digest(file)
    text = str(header)
    assert text.splitlines()[0] == "<!-- made by: macs study report out/one --page one.md"
    assert [line.split(": ")[0] for line in text.splitlines()[1:]] == ["digest", "version", "date"] and text.endswith(" -->")
    assert PageHeader.read(f"{text}\n\n# One\n\n<!-- more -->\n") == header


def test_the_version_is_of_the_code_that_searches(tmp_path, monkeypatch):
    (tmp_path / "macs").mkdir()
    module = tmp_path / "macs" / "search.py"
    module.write_text("step = 1\n")
    monkeypatch.setattr(page_header.macs, "__path__", [str(tmp_path / "macs")])
    before = page_header.code()
    assert page_header.code() == before and len(before) == page_header.CODE_DIGITS
    assert page_header.version() == f"{versions()['macs-trajectories']}+{before}"
    module.write_text("step = 2\n")
    assert page_header.code() != before


def test_digest_is_of_all_files_in_their_order(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("1")
    two.write_text("2")
    assert digest(one, two) == hashlib.sha256(b"12").hexdigest() != digest(two, one)
    with pytest.raises(OSError, match="none"):
        digest(one, tmp_path / "none")


@pytest.mark.parametrize("text", ["", "# One\n", "<!-- a comment -->\n", "<!-- made by: x\ndigest: y\nversion: z -->", "<!-- made by: x"])
def test_what_is_no_header_is_refused(text):
    with pytest.raises(ValueError, match="does not begin"):
        PageHeader.read(text)


@pytest.mark.parametrize("command", ["", " ", "a\nb", "a --> b", "a\u2028b"])
def test_entries_that_would_end_the_comment_are_refused(command):
    with pytest.raises(ValueError, match="made by"):
        PageHeader(command, "d", "v", "2026-01-01")
