"""The slot law among the inputs of learned teams, played without learning behind the safeguard; ``test`` worlds."""

from typing import Any

from posse import ObservationLayout
from posse.numeric import FloatArray
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.learned.features import FEATURES, NUM_FEATURES
from posse_baselines.policy import BasePolicy
from posse_baselines.safeguard import Guard
from posse_training.evaluation.evaluation import evaluate
from posse_training.leaderboard import SEED, WORLDS


class SlotLaw(BasePolicy):
    """Wants the velocity of the slot law, or where to look for the target."""

    name = "slot-law"
    message_size = MESSAGE_SIZE  # of the safeguard, where poses drift

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the inputs' memory and the safeguard's."""
        return Encoder(Encoding.of(layout, "features"), layout, num_worlds), Guard(layout, num_worlds)

    def act(self, observations: FloatArray, memory: Any) -> tuple[FloatArray, Any]:
        """Return the actions that carry it out."""
        encoder, guard = memory
        law = encoder.encode(observations, guard)[:, :NUM_FEATURES].copy().view(FEATURES)
        wanted = (law["law_speed"] * law["law_direction"]).view("f4").reshape(*observations.shape[:2], 2)
        return guard.actions(observations, wanted), memory


if __name__ == "__main__":
    for scenario in ("smart", "radio", "search", "leader-loss", "obstacles", "field", "robots", "duel"):
        print(scenario, evaluate(SlotLaw(), scenario, WORLDS, SEED, progress=False).estimate("safe_score"))
