"""How the return of a training and the safe score go together, over test worlds: python benchmarks/returns.py."""

from collections.abc import Mapping

import numpy as np

import posse
from posse_baselines import load, policy_names
from posse_baselines.playing import rollout
from posse_training.train.presets import default_settings

CONTACTS = ("world_contacts_tracker", "world_contacts_obstacle", "world_contacts_target")


def correlations(policy_name: str, scenario: str, weights: Mapping[str, float]) -> tuple[float, float]:
    """Return the correlations of the return with the safe score: until the first contact, and of the whole episode."""
    policy = load(policy_name)
    weighted = posse.get_scenario(scenario, message_size=policy.message_size, reward_weights=weights)
    batch = posse.batch(weighted, 300, seed=3, split="test")
    played = rollout(batch, policy, ["rewards", *CONTACTS])
    rewards = played["rewards"][..., : batch.scenario.num_trackers].mean(axis=-1)
    before = np.stack([played[name] for name in CONTACTS]).sum(axis=0)[:-1] == 0
    safe = played.metrics["safe_score"]
    until, whole = (np.corrcoef(r.sum(axis=0), safe)[0, 1] for r in (np.where(before, rewards, 0.0), rewards))
    return float(until), float(whole)


if __name__ == "__main__":
    print("| team | scenario | weights | return until the first contact | of the episode |\n|---|---|---|---|---|")
    for scenario in ("smart", "radio", "search", "leader-loss", "obstacles", "field", "duel", "robots"):
        shipped = [each for each in policy_names() if each in (f"learned-{scenario}", f"corrected-{scenario}")]
        own, trained = dict(posse.get_scenario(scenario).reward_weights), default_settings(scenario).reward_weights
        for whose, weights in (("scenario", own), ("training", trained)):
            for name in ("ddcs-tuned", *shipped):
                until, whole = correlations(name, scenario, weights)
                print(f"| `{name}` | `{scenario}` | {whose} | {until:.2f} | {whole:.2f} |", flush=True)
