"""Rows as CSV text that a spreadsheet opens without harm, counted and hashed while it goes out."""

import csv
import hashlib
import io
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

from server.services import codebook

ROWS_A_PIECE = 1_000
UNSAFE = frozenset("=+-@\t\r")
"""A spreadsheet runs a text that begins with one of these."""


class Sheet:
    """One CSV file in the making: RFC 4180, the header of the codebook first."""

    def __init__(self, table: str) -> None:
        self.table = table
        self.name = f"{table}.csv"
        self._text = io.StringIO()
        self._writer = csv.writer(self._text, lineterminator="\r\n")
        self._writer.writerow(codebook.header(table))
        columns = codebook.TABLES.get(table, codebook.CODEBOOK)
        self._guarded = tuple(index for index, column in enumerate(columns) if column.type == "string")
        self._digest = hashlib.sha256()
        self._rows = self._bytes = 0

    def pieces(self, rows: Iterable[Sequence[Any]] = ()) -> Iterator[bytes]:
        """Give the text of more rows; the first piece of all begins with the header."""
        iterator = iter(rows)
        while batch := [safe(row, self._guarded) for row in islice(iterator, ROWS_A_PIECE)]:
            self._writer.writerows(batch)
            self._rows += len(batch)
            yield self._taken()
        if self._text.tell():
            yield self._taken()

    def _taken(self) -> bytes:
        piece = self._text.getvalue().encode()
        self._text.seek(0)
        self._text.truncate()
        self._digest.update(piece)
        self._bytes += len(piece)
        return piece

    @property
    def facts(self) -> dict[str, Any]:
        """What the manifest says of this file, once every piece has been taken."""
        return {"rows": self._rows, "bytes": self._bytes, "sha256": self._digest.hexdigest()}


def plain(header: Sequence[str], rows: Iterable[Sequence[str]]) -> bytes:
    """A small CSV file of texts that is in no codebook."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(header)
    writer.writerows(safe(row, range(len(header))) for row in rows)
    return text.getvalue().encode()


def safe(row: Sequence[Any], guarded: Sequence[int]) -> Sequence[Any]:
    """Put `'` before the texts that a spreadsheet would run; numbers stay numbers.

    >>> safe(["=1+1", -2], [0, 1])
    ["'=1+1", -2]
    """
    for index in guarded:
        cell = row[index]
        if cell and cell.__class__ is str and cell[0] in UNSAFE:
            break
    else:
        return row
    return [guard(cell) if index in guarded else cell for index, cell in enumerate(row)]


def guard(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in UNSAFE else cell
