"""How the return of a training and the safe score go together, over test worlds: python benchmarks/returns.py."""

import numpy as np

import posse
from posse_baselines import load, policy_names
from posse_baselines.playing import rollout

CONTACTS = ("world_contacts_tracker", "world_contacts_obstacle", "world_contacts_target")


def correlations(policy_name: str, scenario: str, worlds: int = 300) -> tuple[float, float]:
    """Return the correlations of the return with the safe score: until the first contact, and of the whole episode."""
    policy = load(policy_name)
    batch = posse.batch(scenario, worlds, seed=3, split="test", message_size=policy.message_size)
    played = rollout(batch, policy, ["rewards", *CONTACTS])
    rewards = played["rewards"].mean(axis=-1)
    before = np.stack([played[name] for name in CONTACTS]).sum(axis=0)[:-1] == 0
    safe = played.metrics["safe_score"]
    until, whole = (np.corrcoef(r.sum(axis=0), safe)[0, 1] for r in (np.where(before, rewards, 0.0), rewards))
    return float(until), float(whole)


if __name__ == "__main__":
    print("| team | scenario | return until the first contact | return of the whole episode |\n|---|---|---|---|")
    for scenario in ("smart", "radio", "search", "leader-loss", "obstacles", "field"):
        for name in (
            "ddcs-tuned",
            *(n for n in policy_names() if n in (f"learned-{scenario}", f"corrected-{scenario}")),
        ):
            until, whole = correlations(name, scenario)
            print(f"| `{name}` | `{scenario}` | {until:.2f} | {whole:.2f} |", flush=True)
