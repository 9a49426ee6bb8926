"""Write a table from what is stored, as Markdown and as CSV."""

from pathlib import Path

from models.reproduce.cells import Shelf
from models.reproduce.lines import Stock
from models.reproduce.page import page
from models.reproduce.sheet import sheet
from models.reproduce.tables import Table


def write(table: Table, shelf: Shelf, out: Path) -> tuple[Path, Path]:
    """Write `<out>/<table>.md` and `.csv`."""
    stock = Stock(table, shelf)
    out.mkdir(parents=True, exist_ok=True)
    written = out / f"{table.name}.md", out / f"{table.name}.csv"
    for path, text in zip(written, (page(stock), sheet(stock)), strict=True):
        path.write_text(text, encoding="utf-8")
    return written
