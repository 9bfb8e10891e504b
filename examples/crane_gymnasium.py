"""A Gymnasium environment of the crane: drives' voltages in, swing and position error out.

An episode brings the load to a slew angle in calm water. Observed are the joints, the load's
offset from the tip with its rates, and what is left to go; an action is three voltages over ±10,
applied for 32 samples. Needs `gymnasium`, which the package does not.

    .venv/bin/python examples/crane_gymnasium.py
"""

# %%
from math import radians
from typing import Any

import gymnasium
import numpy as np

from swashplate.crane import Crane, CraneStepper

# %%
SAMPLES, SECONDS, TARGET = 32, 40.0, radians(45.0)
"""Samples of an action, length of an episode, slew that is wanted."""


# %%
class CraneEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """The TG3637 on its identified drives; reward is minus squared swing and squared error."""

    def __init__(self) -> None:
        self.crane = Crane.preset("tg3637")
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (8,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin anew, the load at rest, the rope drawn from 15 to 25 m."""
        super().reset(seed=seed)
        rope = self.np_random.uniform(15.0, 25.0)
        self.stepper = CraneStepper(self.crane, actuation="direct", rope_m=rope)
        self.time, self.offset = 0.0, np.zeros(2)
        return self.observe(self.stepper.step((0.0, 0.0, 0.0)))[0], {}

    def observe(self, last: dict[str, float]) -> tuple[np.ndarray, float]:
        """What is seen of the last sample, and its reward."""
        offset = np.array([last["load_x"] - last["tip_x"], last["load_y"] - last["tip_y"]])
        rates = (offset - self.offset) * 512.0 / SAMPLES
        self.offset = offset
        left = TARGET - last["shaft_slew"]
        seen = [last["rope"], last["shaft_slew"], last["boom_sin"], *offset, *rates, left]
        swing = float(offset @ offset) / last["rope"] ** 2
        return np.array(seen, dtype=np.float32), -swing - left**2

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Hold three voltages for a while."""
        volts = np.tile(10.0 * np.clip(action, -1.0, 1.0).astype(float), (SAMPLES, 1))
        out = self.stepper.take(volts, np.zeros((SAMPLES, 1)))
        seen, reward = self.observe(self.stepper.named(out[-1]))
        self.time += SAMPLES / 512.0
        return seen, reward, False, self.time >= SECONDS, {}


# %%
def main() -> None:
    """Print what a proportional slew earns, with and without the load's offset fed back."""
    env = CraneEnv()
    for back in (0.0, 0.15):
        seen, _ = env.reset(seed=1)
        total, done = 0.0, False
        while not done:
            across = -(seen[3] * np.sin(seen[1]) + seen[4] * np.cos(seen[1]))  # to starboard
            wanted = 1.5 * seen[7] + back * across
            seen, reward, _, done, _ = env.step(np.array([0.0, wanted, 0.0], np.float32))
            total += reward
        swing = np.degrees(np.hypot(seen[3], seen[4]) / seen[0])
        print(f"feedback {back:.2f}: return {total:.1f}, {np.degrees(seen[7]):.2f} deg left to go, "
              f"swing {swing:.2f} deg at the end")  # fmt: skip


# %%
if __name__ == "__main__":
    main()
