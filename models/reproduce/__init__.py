"""`hatlab reproduce`: every number of a table, trained, measured and written by one command.

tables      what a table asks for: methods in rows, tasks in columns, the paper's figures (models/tables)
cells       what is known about one trained agent (recipe, seed), one JSON file each
work        one cell in a process of its own: train, measure, store
crew        several such processes at once, ancestors first
page        the Markdown and CSV of a table, made from the stored cells alone
"""
