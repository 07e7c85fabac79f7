"""Text of unknown encoding and separator, as rows of words."""

import codecs
import csv
import io
import re
from pathlib import Path

from coramp.counts.table import Findings
from coramp.errors import CorampError

UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
SEPARATORS = ";,\t"
AS_UTF_8 = "is UTF-8"
ALLOWED = "allowed is a file of counts: CSV, Parquet, or one of SUMO's"
NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")
"""Bytes that no text has, but UTF-16."""
PACKED = {b"PK\x03\x04": "is a spreadsheet or packed (zip)", b"\x1f\x8b": "is packed (gzip)"}
HEAD_BYTES, MOST = 200, 0.8
"""Of so many bytes at the beginning, this share of every other one is 0 in UTF-16."""
NAMES_SEPARATOR = "sep="
"""With it a spreadsheet says in the first row what separates words."""

Words = list[tuple[int, list[str]]]
"""Rows of words, each with its number in the file, the first being 1."""


def content_of(path: Path) -> bytes:
    """Returns the content of a file; raises CorampError where it cannot be read or is empty."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CorampError(f"{path}: cannot be read: {error.strerror}; {ALLOWED}") from error
    if not content.strip():
        raise CorampError(f"{path}: is empty; {ALLOWED}")
    return content


def text_of(content: bytes, findings: Findings) -> str:
    """Returns the text of a file. UTF-8 may have a byte-order mark; others are told, or read.

    What is neither UTF-8 nor UTF-16 is taken as Latin-1, with the row of its first letter that is
    not ASCII. Raises CorampError for what is no text.
    """
    for mark, what in PACKED.items():
        if content.startswith(mark):
            raise CorampError(f"{what}; {ALLOWED}, not packed")
    if content.startswith(UTF_16):
        findings.tell(0, "is encoded in UTF-16", AS_UTF_8, "read as such")
        try:
            return content.decode("utf-16")
        except UnicodeDecodeError:
            raise CorampError("is cut off within a letter; allowed is a whole file") from None
    if name := _utf_16_without_mark(content):
        findings.tell(0, "is encoded in UTF-16 without its mark", AS_UTF_8, "read as such")
        return content.decode(name, "replace")
    if strange := NO_TEXT.search(content):
        row = content[: strange.start()].count(b"\n") + 1
        raise CorampError(f"row {row}: byte 0x{strange.group().hex()} is no text; {ALLOWED}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        findings.tell(row, "is not UTF-8, perhaps Latin-1", AS_UTF_8, "read as Latin-1")
        return content.decode("latin-1")


def _utf_16_without_mark(content: bytes) -> str | None:
    """Which kind of UTF-16 a file seems to be, by its first letters; None where it is none."""
    head = content[:HEAD_BYTES]
    for name, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[0::2])):
        if zeros and zeros.count(0) >= MOST * len(zeros):
            others = head[0::2] if name == "utf-16-le" else head[1::2]
            return name if others.count(0) == 0 else None
    return None


def words_of(text: str) -> Words:
    """Returns the words of each row that is not empty; the first row says what separates them."""
    head = next((row for row in text.splitlines() if row.strip()), "")
    separator = max(SEPARATORS, key=head.count)
    # any kind of line end
    lines = io.StringIO(text, newline=None)
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    found: Words = []
    try:
        for words in reader:
            if not found and words and words[0].startswith(NAMES_SEPARATOR):
                continue
            if any(word.strip() for word in words):
                found.append((reader.line_num, [word.strip() for word in words]))
    except csv.Error as error:
        raise CorampError(f"row {reader.line_num}: {error}; allowed is CSV") from error
    return found
