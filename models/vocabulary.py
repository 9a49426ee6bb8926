"""The words every layer shares: who speaks, what an action and a token are. Standard library only."""

from dataclasses import dataclass

AgentID = int
Action = int
Token = int
Gate = bool

SILENT: Token = -1
"""No token: an absent seat, or a seat that does not speak."""


@dataclass(frozen=True, slots=True)
class Message:
    """What one seat said in one state. A closed gate means that nobody heard it."""

    sender: AgentID
    token: Token
    gate: Gate
