"""A study without questions: what is left where only its rounds are measured or tested."""

from collections.abc import Mapping
from typing import Any

ROUNDS_ONLY: Mapping[str, Any] = {
    "quiz": (),
    "attention": (),
    "questionnaires": (),
    "token_probe": False,
    "codes": {},
    "pay": None,
}
"""Fields of a definition that leave instructions and rounds, and nothing else."""
