"""The game: rounds, steering and picture together. It needs no window."""

from __future__ import annotations

from typing import Final

import numpy as np
import pygame

from posse import Scenario, ScenarioError
from posse.rendering.camera import Camera
from posse.rendering.canvas import Canvas
from posse.rendering.content.view import View
from posse.rendering.picture import action_of, draw_picture, viewport_of
from posse.rendering.style import FAINT_INK, GRID, INK, PAPER, TARGET
from posse_baselines import Policy, PolicyError
from posse_training.errors import SettingsError
from posse_training.play.round import Round
from posse_training.play.session import COUNTDOWN, OVER, PAUSED, READY, RUNNING, Session, advance, finish, react
from posse_training.play.steering import KEYS, Wheel, steer
from posse_training.replay import Replay, join
from posse_training.viewer.layout import lay_out

_GO: Final = (pygame.K_RETURN, pygame.K_KP_ENTER, pygame.K_SPACE)
_MOST_STEPS: Final = 4
"""Control steps in a tick: after a pause of the machine the game goes on, and does not jump."""


def robot_of(name: str, num_trackers: int) -> int:
    """Return the number of the robot with a name: ``"target"``, or ``"tracker_2"``.

    Raises:
        SettingsError: There is no such robot.
    """
    names = [f"tracker_{k}" for k in range(num_trackers)]
    if name in ("target", "target_0"):
        return num_trackers
    if name not in names:
        raise SettingsError(f"--as {name} is no robot; there are: target, {', '.join(names)}")
    return names.index(name)


class Game:
    """A session in which a person drives one robot against, or with, a policy.

    Args:
        policy: Drives the trackers, all but the player's.
        scenario: What to play.
        robot: Number of the player's tracker; N: the target.
        seed: Seed of the worlds.
        world: Index of the first world.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        size: Of the window, px.

    Attributes:
        session: Where the session stands.
        wheel: What the player asks of the robot.

    Raises:
        PolicyError: The policy does not fit the scenario.
        ScenarioError: The scenario's target cannot be driven; a seed, world or split that there is
            not.
    """

    def __init__(
        self,
        policy: Policy,
        scenario: Scenario,
        robot: int,
        *,
        seed: int = 7,
        world: int = 0,
        split: str = "test",
        size: tuple[int, int] = (1280, 720),
    ) -> None:
        if policy.reads_state and robot == scenario.num_trackers:
            raise PolicyError(
                f"{policy.name!r} knows the state and plays the target's motion ahead: it cannot "
                "play against a person. Choose another policy"
            )
        changed = {"message_size": max(scenario.message_size, policy.message_size)}
        self._as_target = robot == scenario.num_trackers
        if self._as_target:
            self._scenario = scenario.replace(target_motion="agent", **changed)
        else:
            self._scenario = scenario.replace(**changed)
            if scenario.num_agents != scenario.num_trackers:
                raise ScenarioError(
                    f"the target of {scenario.name!r} is an agent that nobody drives: play as the target"
                )
        self._policy, self._robot = policy, robot
        self._seed, self._split = seed, split
        self.session = Session(world=world)
        self.wheel = Wheel()
        self._held: set[int] = set()
        self._time = 0.0  # s that have passed and are not played yet
        self._best: tuple[float, Replay] | None = None
        self._last: Replay | None = None
        self._begin(world).step(self.wheel)  # compiles what a round needs, before the window opens
        self._round = self._begin(world)
        self._shown = (world, 0)  # the world and the count of rounds that it was made for
        self.resize(size)

    @property
    def closed(self) -> bool:
        """Whether the player has ended the session."""
        return self.session.closed

    @property
    def round(self) -> Round:
        """The round that is played."""
        return self._round

    def resize(self, size: tuple[int, int]) -> None:
        """Fit the game to a window of a size (width, height), px."""
        self._layout = lay_out(size, panel=False)
        self._canvas = Canvas(self._layout.size, 2)
        viewport = viewport_of(self._layout.picture, self._layout.point)
        self._camera = Camera(viewport, self._scenario.arena, whole=False)
        self._camera.follow(action_of(self._round.scene), 0.0)

    def handle(self, event: pygame.event.Event) -> None:
        """React to an event of pygame."""
        if event.type == pygame.VIDEORESIZE:
            self.resize((event.w, event.h))
        elif event.type == pygame.QUIT:
            self._react("quit")
        elif event.type == pygame.KEYUP:
            self._held.discard(event.key)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._held.clear()
            if self.session.phase == RUNNING:
                self._react("pause")
        elif event.type == pygame.KEYDOWN:
            if event.key in KEYS:
                self._held.add(event.key)
            elif event.key in (pygame.K_ESCAPE, pygame.K_q):
                self._react("quit")
            elif event.key == pygame.K_p:
                self._react("pause")
            elif event.key == pygame.K_n:
                self._react("next")
            elif event.key in _GO:
                self._react("go")

    def tick(self, seconds: float) -> None:
        """Let some real time pass: a second of it is a second of the world."""
        self.wheel = steer(self.wheel, self._held, seconds)
        before = self.session.phase
        self.session = advance(self.session, seconds)
        if before != RUNNING:  # what is left of a countdown is not played
            self._time = 0.0
            return
        dt = self._scenario.control_step
        self._time = min(self._time + seconds, _MOST_STEPS * dt)
        while self._time >= dt - 1e-9 and not self._round.over:
            self._time -= dt
            self._round.step(self.wheel)
            self._camera.follow(action_of(self._round.scene), dt)
        if self._round.over:
            self._keep()
            self.session = finish(self.session, self._round.points)

    def replay(self) -> Replay | None:
        """Return the best round and the last one, beside each other if of one world.

        ``None``: nothing has been played. A round that was cut short counts as the last.
        """
        if self.session.phase in (RUNNING, PAUSED):
            self._last = self._round.replay()
        best = None if self._best is None else self._best[1]
        if best is None or self._last is None or best is self._last:
            return best or self._last
        if best.world["world"] == self._last.world["world"]:
            return join([best, self._last])
        return best

    def draw(self) -> pygame.Surface:
        """Return a picture of the window."""
        layout, canvas, scene = self._layout, self._canvas, self._round.scene
        phase, p = self.session.phase, layout.point
        canvas.clip(None)
        view = View(self._robot, links=False, sensing=not self._as_target, least_robot=7.0)
        draw_picture(
            canvas,
            layout.picture,
            self._camera,
            scene,
            self._round.history,
            p,
            self._policy.name,
            f"world {self.session.world}",
            view,
        )
        self._draw_bar()
        left, top, width, height = self._camera.viewport
        middle = (left + width / 2, top + height * 0.22)
        big = {COUNTDOWN: f"{max(1, int(np.ceil(self.session.left)))}", PAUSED: "paused"}.get(phase)
        if big is not None:
            canvas.text(big, middle, (80 if phase == COUNTDOWN else 40) * p, INK, anchor=0.5)
        if phase in (READY, OVER):
            self._draw_card(self._card())
        return canvas.finish()

    def _react(self, key: str) -> None:
        session = react(self.session, key)
        if (session.world, session.begun) != self._shown and not session.closed:
            if self._round.scene.step or session.world != self._shown[0]:
                self._round = self._begin(session.world)
                self._camera.reset()
                self._camera.follow(action_of(self._round.scene), 0.0)
            self._shown = (session.world, session.begun)
            self.wheel = Wheel()
        self.session = session

    def _begin(self, world: int) -> Round:
        return Round(self._policy, self._scenario, self._robot, self._seed, world, self._split)

    def _keep(self) -> None:
        """Remember the round that has ended."""
        self._last = self._round.replay()
        if self._best is None or self._round.points > self._best[0]:
            self._best = (self._round.points, self._last)

    def _card(self) -> list[str]:
        """Return the lines of the card between rounds, the first one large."""
        who = "the target" if self._as_target else f"tracker {self._robot}"
        if self.session.phase == OVER:
            best = self.session.best or 0.0
            record = self._round.points >= best and len(self.session.rounds) > 1
            return [
                f"{self._round.points:.0f} points" + (": your best" if record else ""),
                f"best of the session: {best:.0f}",
                "Enter: again    N: next world    Esc: end",
            ]
        goal = "keep the team out of its slots" if self._as_target else "help the team hold its slots"
        return [
            f"You drive {who}",
            f"{goal}, for {self._scenario.duration:g} s",
            "arrow keys or WASD: left, right, faster, slower",
            "Enter: start    N: next world    P: pause    Esc: end",
        ]

    def _draw_card(self, lines: list[str]) -> None:
        canvas, p = self._canvas, self._layout.point
        left, top, width, height = self._camera.viewport
        sizes = [30.0, *[18.0] * (len(lines) - 1)]
        widest = max(canvas.width_of(t, s * p) for t, s in zip(lines, sizes, strict=True))
        p *= min(1.0, (width - 20) / (widest + 40 * p))
        wide, tall = min(width - 10.0, widest + 40 * p), (46 + 28 * (len(lines) - 1) + 24) * p
        x, y = left + (width - wide) / 2, top + height - tall - 12 * p
        canvas.box(x, y, wide, tall, GRID)
        canvas.box(x + 2, y + 2, wide - 4, tall - 4, PAPER)
        at = y + 34 * p
        for k, (text, size) in enumerate(zip(lines, sizes, strict=True)):
            canvas.text(text, (left + width / 2, at), size * p, INK if k < 1 else FAINT_INK, 0.5)
            at += (36 if k == 0 else 28) * p

    def _draw_bar(self) -> None:
        """Draw time left, points, best, and the speed that is asked for."""
        canvas, p = self._canvas, self._layout.point
        left, top, width, height = self._layout.bar
        y, edge = top + height / 2, 14 * p
        canvas.box(*self._layout.bar, PAPER)
        canvas.box(left, top, width, 1, GRID)
        best = self.session.best
        texts = (
            f"{max(self._round.left, 0):.0f} s left",
            f"{self._round.points:.0f} points",
            "best -" if best is None else f"best {best:.0f}",
        )
        for k, text in enumerate(texts):
            x = left + edge + k * (width - 2 * edge) / 4
            canvas.text(text, (x, y), 19 * p, FAINT_INK if k == 2 else INK)
        start = left + edge + 3 * (width - 2 * edge) / 4
        canvas.text("speed", (start, y), 15 * p, FAINT_INK)
        start += 50 * p
        reach = left + width - edge - start
        canvas.box(start, y - 5 * p, reach, 10 * p, GRID)
        canvas.box(start, y - 5 * p, reach * (self.wheel.speed + 1) / 2, 10 * p, TARGET)
