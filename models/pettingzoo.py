"""The environments as PettingZoo parallel environments, for researchers' own learners. Needs `pettingzoo`.

    env = parallel_env("traffic_junction/medium")
    observations, infos = env.reset(seed=7)

One adapter is one episode at a time (B = 1). Seats keep their names for the whole episode: a slot of Traffic
Junction without a car stays among the agents, observes zeros and is paid nothing; `infos[agent]["alive"]`
says which are occupied. Messages are not part of the environment: agents that talk do so in their learner.

`reset(seed=s)` plays the world of seed s, as everywhere in hatlab; later resets without a seed go on from it
in a fixed order.
"""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from models import rng
from models.envs.api import Environment
from models.envs.registry import make

RESETS = 17
"""Stream of the seeds of resets without a seed: step is how many there were since the last seed."""

Observation = NDArray[np.float32]


def parallel_env(task: str) -> "TaskEnv":
    """Return the PettingZoo environment of a task.

    Raises:
        UnknownTaskError: the task is not in `models.envs.registry.NAMES`.
    """
    return TaskEnv(make(task))


class TaskEnv(ParallelEnv[str, Observation, int]):  # type: ignore[misc]
    """One episode of an environment at a time, in PettingZoo's words."""

    metadata: dict[str, Any]

    def __init__(self, env: Environment[Any]) -> None:
        self.env = env
        self.metadata = {"render_modes": [], "name": f"{env.name.replace('/', '_')}_v{env.version}"}
        self.render_mode = None
        self.possible_agents = [f"seat_{seat}" for seat in range(env.agents)]
        self.agents: list[str] = []
        # flags, shares and counts of seats in a cell: none exceeds the number of agents
        shape = (env.observation_size,)
        self.observation_spaces = {
            agent: gymnasium.spaces.Box(0, env.agents, shape, np.float32) for agent in self.possible_agents
        }
        self.action_spaces = {agent: gymnasium.spaces.Discrete(env.actions) for agent in self.possible_agents}
        self._seed = int(np.random.SeedSequence().generate_state(1, np.uint64)[0])
        self._resets = 0

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Discrete:
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin an episode; `options` are accepted and change nothing."""
        del options
        if seed is None:
            world = rng.word(self._seed, RESETS, self._resets, 0)
            self._resets += 1
        else:
            world, self._seed, self._resets = seed, seed, 0
        self._state = self.env.init(np.array([world], np.uint64))
        self.agents = list(self.possible_agents)
        return self._observations(), self._infos()

    def step(
        self, actions: dict[str, int]
    ) -> tuple[
        dict[str, Observation],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Move the world; agents without an action take action 0.

        A found child terminates an episode, the last step truncates it.

        Raises:
            RuntimeError: no episode is running.
        """
        if not self.agents:
            raise RuntimeError("no episode is running: call reset() first")
        taken = np.array([[actions.get(agent, 0) for agent in self.possible_agents]], np.int32)
        self._state, reward = self.env.step(self._state, taken)
        over = bool(self.env.done(self._state)[0])
        unclocked = replace(self._state, t=np.zeros(1, np.int32))
        terminated = over and bool(self.env.done(unclocked)[0])
        observations, infos, seats = self._observations(), self._infos(), self.agents
        rewards = {agent: float(pay) for agent, pay in zip(seats, reward[0], strict=True)}
        self.agents = [] if over else seats
        ends = dict.fromkeys(seats, terminated), dict.fromkeys(seats, over and not terminated)
        return observations, rewards, *ends, infos

    def _observations(self) -> dict[str, Observation]:
        return dict(zip(self.possible_agents, self.env.observe(self._state)[0], strict=True))

    def _infos(self) -> dict[str, dict[str, Any]]:
        alive = self.env.alive(self._state)[0]
        return {agent: {"alive": bool(here)} for agent, here in zip(self.possible_agents, alive, strict=True)}
