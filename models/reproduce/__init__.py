"""`hatlab reproduce`: every number of a table, trained, measured and written by one command.

tables      what a table asks for: methods in rows, tasks in columns, the paper's figures (models/tables)
cells       what is known about one trained agent (recipe, seed), one JSON file each
work        one cell in a process of its own: train, measure, store
crew        several such processes at once, ancestors first
page        the Markdown and CSV of a table, made from the stored cells alone
"""

from pathlib import Path

from models.reproduce import cells, crew, tables
from models.reproduce.lines import Stock
from models.reproduce.page import page
from models.reproduce.sheet import sheet

__all__ = ["cells", "crew", "tables", "write"]


def write(table: tables.Table, shelf: cells.Shelf, out: Path) -> tuple[Path, Path]:
    """Write a table from what is stored, as Markdown and as CSV."""
    stock = Stock(table, shelf)
    out.mkdir(parents=True, exist_ok=True)
    written = out / f"{table.name}.md", out / f"{table.name}.csv"
    for path, text in zip(written, (page(stock), sheet(stock)), strict=True):
        path.write_text(text, encoding="utf-8")
    return written
