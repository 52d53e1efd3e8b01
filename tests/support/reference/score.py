"""Slots, score and metrics of an episode."""

import math
from collections import defaultdict

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse.csgraph import connected_components
from tests.support.reference.senses import can_see, radio_alive
from tests.support.reference.state import TOUCHING, Array, Complexes, State, free_gaps, positions, working

import posse


def slots(s: posse.Scenario) -> Complexes:
    """Return the slots in the slot frame as x + iy, from their definition."""
    n, d, apart = s.num_trackers, s.formation_distance, s.formation_spacing
    if s.formation == "ring":
        radius = max(d, apart / (2 * math.sin(math.pi / n)) if n > 1 else d)
        return np.asarray(-radius * np.exp(2j * np.pi * np.arange(n) / n))
    if s.formation == "rows":
        wide = math.ceil(math.sqrt(n))
        places = []
        for k in range(n):
            row, column = divmod(k, wide)
            in_row = min(wide, n - row * wide)
            places.append(complex(-d - apart * row, apart * (column - (in_row - 1) / 2)))
        return np.array(places)
    wing = [-d + 0j]
    for k in range(1, n):
        arm = (k + 1) // 2 * apart
        wing.append(-d + arm * np.exp(1j * math.radians(135 if k % 2 else -135)))
    return np.array(wing)


class Episode:
    """Every metric of an episode, computed from its states."""

    def __init__(self, scenario: posse.Scenario) -> None:
        n = scenario.num_trackers
        self.scenario, self.score = scenario, 0.0
        self.occupied: dict[int, int] = {}
        self.distance: Array = np.zeros(n)
        self.progress: Array = np.zeros(n)
        self.onsets: Array = np.zeros(n)
        self._start: Complexes = np.zeros(n, np.complex128)
        self._arrived = np.zeros(n, np.bool_)
        self._touch = np.zeros((n, n + 1 + scenario.num_obstacles + 4), np.bool_)
        self._touched, self._working, self._least = False, n, math.inf
        self._held_from: int | None = None
        self._first: dict[str, int] = {}  # the step at which something first happened
        self._sums: dict[str, float] = defaultdict(float)

    def follow(self, state: State) -> None:
        """Process the state after the next step; the first one is the start of the episode."""
        s, n = self.scenario, self.scenario.num_trackers
        p, alive, step = positions(state), working(state), int(state["world_step"])
        if step == 0:
            self._start = p[:n].copy()
        gaps = free_gaps(s, state)
        self._least = min(self._least, float(gaps.min()))
        begun = (touch := gaps <= TOUCHING) & ~self._touch
        self._touch, self._touched = touch, self._touched or bool(touch.any())
        self.onsets = begun.sum(axis=1).astype(np.float64)
        self._sums["tracker_contacts"] += int(begun[:, :n].sum()) // 2
        self._sums["target_contacts"] += int(begun[:, n].sum())
        self._sums["obstacle_contacts"] += int(begun[:, n + 1 :].sum())
        frame = complex(state["world_frame_cos"], state["world_frame_sin"])
        places = p[n] + slots(s) * frame
        away = np.abs(p[:n, None] - places[None, :])
        near = (away <= s.tolerance) & (alive & ~touch.any(axis=1))[:, None]
        rows, columns = linear_sum_assignment(-near.astype(float))
        taken = {int(c) for r, c in zip(rows, columns, strict=True) if near[r, c]}
        self.occupied = {}
        for i in range(n):
            own = [c for c in range(n) if near[i, c] and c not in self.occupied.values()]
            if own:
                self.occupied[i] = own[0]
        assert set(self.occupied.values()) == taken, "which slots are taken does not depend on who"
        free = [c for c in range(n) if c not in taken]
        nearest = away[:, free or slice(None)].min(axis=1)
        distance = np.array([away[i, self.occupied[i]] if i in self.occupied else nearest[i] for i in range(n)])
        self.progress = self.distance - distance if step else np.zeros(n)
        self.distance = distance
        sees = [can_see(s, state, i) for i in range(n)]
        if any(sees):
            self._first.setdefault("detection", step)
        if step == 0:
            return
        count = int(alive.sum())
        if count < self._working:
            self._working, self._held_from = count, None
            self._first.setdefault("loss", step - 1)
        self.score = min(1.0, len(taken) / count)
        if len(taken) < count:
            self._held_from = None
        elif self._held_from is None:
            self._held_from = step
        enough = min(max(1, round(s.settle_time / s.control_step)), s.horizon)
        if self._held_from is not None and step - self._held_from + 1 >= enough:
            self._first.setdefault("settling", self._held_from)
            if "loss" in self._first:
                self._first.setdefault("recovery", self._held_from)
        reach = np.array(s.tracker_speeds)[:, None] * step * s.control_step + s.tolerance
        could = (np.abs(self._start[:, None] - places[None, :]) <= reach).any(axis=1)
        self._arrived |= could & alive
        v = state["tracker_speed"].astype(np.float64) / s.tracker_speeds
        turn = state["tracker_turn_rate"].astype(np.float64) / s.tracker_turn_rates
        for name, value in (
            ("steps", 1),
            ("score", self.score),
            ("safe_score", 0.0 if self._touched else self.score),
            ("bound", (self._arrived & alive).sum() / count),
            ("error", distance[alive].sum()),
            ("effort", (v**2 + turn**2)[alive].sum()),
            ("sight", sum(sees)),
            ("tracker_steps", count),
            ("connected", self._connected(state)),
        ):
            self._sums[name] += float(value)

    def _connected(self, state: State) -> bool:
        s = self.scenario
        members = np.flatnonzero(working(state))
        if len(members) < 2:
            return True
        p = positions(state)[members]
        can = np.array([radio_alive(s, state, i) for i in members.tolist()])
        links = (np.abs(p[:, None] - p[None, :]) <= s.radio_range) & can[:, None] & can[None, :]
        return bool(connected_components(links, directed=False)[0] == 1)

    def metrics(self) -> dict[str, float]:
        """Return every metric by name."""
        s, sums = self.scenario, self._sums

        def time(name: str, since: int = 0) -> float:
            return (self._first[name] - since) * s.control_step if name in self._first else math.nan

        return {
            **{name: sums[name] / sums["steps"] for name in ("score", "safe_score", "bound")},
            "detection_time": time("detection"),
            "settling_time": time("settling"),
            "recovery_time": time("recovery", self._first.get("loss", 0)),
            "tracking_error": sums["error"] / sums["tracker_steps"],
            "time_in_sight": sums["sight"] / sums["tracker_steps"],
            **{name: sums[name] for name in ("tracker_contacts", "obstacle_contacts", "target_contacts")},
            "contact_free": float(not self._touched),
            "least_gap": self._least,
            "control_effort": sums["effort"] / sums["tracker_steps"],
            "time_connected": sums["connected"] / sums["steps"],
            "duration": sums["steps"] * s.control_step,
        }
