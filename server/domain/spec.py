"""What a trial is made from: everything that its world and its screen follow from, as one frozen value."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

from server.domain.study import Communication, Role

Start = Literal["init", "human", "alone"]
"""`init`: the task's own start. `human`: among 5-9 cars. `alone`: nobody else will ever drive (practice)."""
SeatHolder = Literal["human", "policy", "scripted"]
Phase = Literal["practice", "main"]


class Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class BundleName(Part):
    name: str
    sha256: str


class Panel(Part):
    """Where signs stand for one participant. Tokens and positions count from 0, numbers on screen from 1."""

    bundle: str
    sha256: str
    positions: tuple[tuple[float, float], ...]
    position_of_token: tuple[int, ...]
    number_at_position: tuple[int, ...]

    def number_of(self, token: int) -> int:
        return self.number_at_position[self.position_of_token[token]]

    def token_of(self, number: int) -> int:
        """The token behind a number on screen.

        Raises:
            ValueError: no sign has this number.
        """
        return self.position_of_token.index(self.number_at_position.index(number))


class Condition(Part):
    communication: Communication | None
    """None in practice: nothing is meant."""
    budget: float | None
    overlay: bool
    step_limit: int
    arrival: float
    child_sees_parent: bool
    panel: Panel | None
    blank: bool
    """Signs are drawn without number and colour."""


class TrialSpec(Part):
    task: str
    """Name of the environment."""
    task_version: int
    seed: int
    start: Start
    role: Role
    phase: Phase
    bundle: BundleName | None
    scripted: str | None
    seats: tuple[SeatHolder, ...]
    condition: Condition

    @property
    def seat(self) -> int:
        """The participant's."""
        return self.seats.index("human")
