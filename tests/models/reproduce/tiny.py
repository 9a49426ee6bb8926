"""A table with recipes that train in a second: an agent, one that starts from it, one not written yet."""

from pathlib import Path

from models.reproduce.cells import Shelf

TABLE = """
title = "Tiny"
text = "For tests."
episodes = 30
[[column]]
key = "easy"
title = "Traffic Junction, easy"
seeds = [1, 2]
measures = [{ path = "views.greedy.success", title = "success" }]
converged = { column = "success", paper = "views.greedy.success" }
[[row]]
method = "Plain"
[row.cells.easy]
recipe = "plain"
paper = { "views.greedy.success" = 0.02 }
epochs = 2
public_cpu_minutes = 90
[[row]]
method = "Names"
cells.easy = { recipe = "names", paper = { "views.greedy.success" = 0.9 }, epochs = 3, additional = true }
[[row]]
method = "Later"
cells.easy = { recipe = "later" }
"""
PLAIN = """
name = "traffic_junction/plain"
task = "traffic_junction/easy"
seed = 9
[model]
hidden = 8
message = 4
[check]
every = 1
episodes = 10
[[phase]]
name = "drive"
updates = 25
episodes = 4
"""
NAMES = """
name = "traffic_junction/names"
task = "traffic_junction/easy"
seed = 9
init_from = "run:plain"
[model]
hidden = 8
message = 4
tokens = 3
channel = "prototype"
[check]
every = 1
episodes = 10
[[phase]]
name = "speak"
updates = 3
episodes = 4
"""


def laid_out(folder: Path) -> Shelf:
    """A folder with recipes and table, and where a test keeps everything else."""
    recipes = folder / "recipes"
    recipes.mkdir(parents=True)
    (recipes / "plain.toml").write_text(PLAIN)
    (recipes / "names.toml").write_text(NAMES)
    (folder / "tiny.toml").write_text(TABLE)
    return shelf_in(folder)


def shelf_in(folder: Path) -> Shelf:
    """Everything at its place in a folder that was laid out."""
    return Shelf(folder / "recipes", folder / "runs", folder / "out" / "cells", folder / "bundles", 30)
