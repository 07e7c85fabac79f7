"""Text of unknown encoding and separator, as rows of words."""

import codecs
import csv
import io
from pathlib import Path

from coramp.counts.table import Findings
from coramp.errors import CorampError

UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
SEPARATORS = ";,\t"
AS_UTF_8 = "is UTF-8"

Words = list[tuple[int, list[str]]]
"""Rows of words, each with its number in the file, the first being 1."""


def content_of(path: Path) -> bytes:
    """Returns the content of a file; raises CorampError where it cannot be read or is empty."""
    allowed = "allowed is a file of counts: CSV, Parquet, or one of SUMO's"
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CorampError(f"{path}: cannot be read: {error.strerror}; {allowed}") from error
    if not content.strip():
        raise CorampError(f"{path}: is empty; {allowed}")
    return content


def text_of(content: bytes, findings: Findings) -> str:
    """Returns the text of a file. UTF-8 may have a byte-order mark; others are told, or read.

    What is neither UTF-8 nor UTF-16 with its mark is taken as Latin-1, with the row of its first
    letter that is not ASCII.
    """
    if content.startswith(UTF_16):
        findings.tell(0, "is encoded in UTF-16", AS_UTF_8, "read as such")
        try:
            return content.decode("utf-16")
        except UnicodeDecodeError:
            raise CorampError("is cut off within a letter; allowed is a whole file") from None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        findings.tell(row, "is not UTF-8, perhaps Latin-1", AS_UTF_8, "read as Latin-1")
        return content.decode("latin-1")


def words_of(text: str) -> Words:
    """Returns the words of each row that is not empty; the first row says what separates them."""
    head = next((row for row in text.splitlines() if row.strip()), "")
    separator = max(SEPARATORS, key=head.count)
    reader = csv.reader(io.StringIO(text), delimiter=separator, skipinitialspace=True)
    found: Words = []
    try:
        for words in reader:
            if any(word.strip() for word in words):
                found.append((reader.line_num, [word.strip() for word in words]))
    except csv.Error as error:
        raise CorampError(f"row {reader.line_num}: {error}; allowed is CSV") from error
    return found
