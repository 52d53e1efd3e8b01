"""The viewer: policies, tapes, camera and state together. It needs no window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pygame

from posse import Scenario, ScenarioError
from posse.rendering.camera import Camera
from posse.rendering.canvas import Canvas
from posse.rendering.content.history import History
from posse.rendering.content.view import View
from posse.rendering.key import legend_of
from posse.rendering.picture import action_of, draw_picture, viewport_of
from posse_baselines import Policy, PolicyError, Target, against, load
from posse_training.viewer.drawing import draw_help, draw_message, draw_panel, draw_timeline, rows_of
from posse_training.viewer.keys import command_of
from posse_training.viewer.layout import Layout, lay_out
from posse_training.viewer.panel import Line, lines_of, title_of
from posse_training.viewer.pointer import Pointer
from posse_training.viewer.state import SPEEDS, Command, Limits, State, advance, react
from posse_training.viewer.tape import Moment, Tape

_MOST_STEPS: Final = 60
"""Control steps played in a tick: no click waits long for an answer."""
_CLOSE_UP: Final = 8.0  # m along the shorter side, where the camera follows one robot
_SMALL_TEAM: Final = 12
_FINE: Final = 500_000  # px; larger windows are drawn less finely, which is faster
_FAR_APART: Final = 20  # steps; beyond it, trails and camera begin anew


class Viewer:
    """Shows one world at a time.

    Args:
        policies: To switch between: names, files, ``package.module:Class``, or policies. The first
            is shown.
        scenario: What to play.
        target: Moves the scenario's target, where that is an agent.
        seed: Seed of the worlds.
        world: Index of the first world.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        size: Of the window, px.
        show: Shows a picture at once. It is called before a policy or a world is loaded, which may
            take some seconds.

    Attributes:
        state: What is shown.
        message: Shown over the picture until the next key; empty: none.

    Raises:
        PolicyError: The first policy is unknown or does not fit the scenario.
        ScenarioError: A seed, world or split that there is not.
    """

    def __init__(
        self,
        policies: Sequence[str | Policy],
        scenario: Scenario,
        target: Target | None = None,
        *,
        seed: int = 7,
        world: int = 0,
        split: str = "test",
        size: tuple[int, int] = (1280, 720),
        show: Callable[[pygame.Surface], None] | None = None,
    ) -> None:
        self.state = State(world=world)
        self.message = ""
        self._policies = list(policies)
        self._scenario, self._target = scenario, target
        self._seed, self._split = seed, split
        self._show = show
        self._tapes: dict[int, Tape] = {}
        self._tape = self._load(0, world)
        self._tapes[0] = self._tape
        self._pointer = Pointer()
        self._history = History()
        self._noted: tuple[int, int] = (0, -1)  # the tape, and the step up to which it is noted
        self._framed: object = None  # what the automatic camera was made for
        self.resize(size)

    # --- what is asked for ------------------------------------------------------------------------

    @property
    def limits(self) -> Limits:
        """What the state can refer to."""
        dt = self._scenario.control_step
        return Limits(self._scenario.num_trackers + 1, len(self._policies), self._tape.end, max(1, round(1 / dt)))

    def resize(self, size: tuple[int, int]) -> None:
        """Fit the viewer to a window of a size (width, height), px."""
        self._size = size
        self._drawn: tuple[object, pygame.Surface] | None = None
        width, height = self.layout.size
        self._canvas = Canvas((width, height), 3 if width * height <= _FINE else 2)
        self._place_camera()

    def handle(self, event: pygame.event.Event) -> None:
        """React to an event of pygame."""
        for command in self._commands(event):
            self.do(command)

    def do(self, command: Command) -> None:
        """React to a command. What cannot be done is said, and changes nothing."""
        self.message = ""
        state = react(self.state, command, self.limits)
        if state.world != self.state.world or state.policy != self.state.policy:
            try:
                self._switch(state)
            except (PolicyError, ScenarioError) as error:
                self.message = str(error)
                return
        self.state = state
        self._tape.play(int(state.step), _MOST_STEPS)
        most = max(0, len(self._lines()) - rows_of(self.layout)) if state.scroll else 0
        self.state = replace(state, scroll=min(state.scroll, most))
        self._place_camera()

    def tick(self, seconds: float) -> None:
        """Let some real time pass."""
        tape = self._tape
        behind = tape.last < int(self.state.step) and not tape.over
        if not behind:
            self.state = advance(self.state, seconds, self.limits, self._scenario.control_step)
        tape.play(int(self.state.step), _MOST_STEPS)
        step = self.state.step
        if tape.over:
            step = min(step, float(tape.last))
        elif not behind and step >= tape.last + 1:  # faster than can be played
            step = float(tape.last)
        self.state = replace(self.state, step=max(step, float(tape.first)))
        self._place_camera()

    # --- what is shown ----------------------------------------------------------------------------

    @property
    def closed(self) -> bool:
        """Whether the user has closed the viewer."""
        return self.state.closed

    @property
    def layout(self) -> Layout:
        """Where everything lies."""
        return lay_out(self._size, self.state.panel and self.state.selected is not None)

    @property
    def camera(self) -> Camera:
        """The view of the world."""
        return self._camera

    @property
    def tape(self) -> Tape:
        """The episode that is shown."""
        return self._tape

    @property
    def moment(self) -> Moment:
        """What is shown of it: the present step, or the latest played before it."""
        return self._tape.moment(min(int(self.state.step + 1e-6), self._tape.last))

    @property
    def view(self) -> View:
        """The choices that the picture is drawn with."""
        state, small = self.state, self._scenario.num_trackers <= _SMALL_TEAM
        return View(
            state.selected, state.links, state.sensing, state.trails, numbers=True, least_robot=7.0 if small else 5.5
        )

    def draw(self) -> pygame.Surface:
        """Return a picture of the window; valid until the next call."""
        state = replace(self.state, step=float(int(self.state.step)))
        shown = (state, self._noted, self._tape.last, self.message)
        if self._drawn is None or self._drawn[0] != shown:  # else nothing has changed
            self._drawn = (shown, self._draw())
        return self._drawn[1]

    def _draw(self) -> pygame.Surface:
        layout, canvas, state = self.layout, self._canvas, self.state
        canvas.clip(None)
        scene = self.moment.scene
        if state.help:
            draw_help(canvas, layout, legend_of(scene))
            return canvas.finish()
        draw_picture(
            canvas,
            layout.picture,
            self._camera,
            scene,
            self._history,
            layout.point,
            self._tape.name,
            self._remark(),
            self.view,
        )
        if state.selected is not None:
            title = title_of(state.selected, self._scenario.num_trackers)
            draw_panel(canvas, layout, title, self._lines(), state.scroll)
        tape = self._tape
        draw_timeline(
            canvas,
            layout,
            playing=not (state.paused or self._ended),
            step=scene.step,
            first=tape.first,
            played=tape.last,
            end=tape.end,
            control_step=self._scenario.control_step,
            contacts=tape.contacts,
        )
        if self.message:
            draw_message(canvas, layout, self.message)
        return canvas.finish()

    # --- parts ------------------------------------------------------------------------------------

    def _commands(self, event: pygame.event.Event) -> list[Command]:
        layout, end = self.layout, self._tape.end
        if event.type == pygame.QUIT:
            return [Command("quit")]
        if event.type == pygame.VIDEORESIZE:
            self.resize((event.w, event.h))
        if event.type == pygame.KEYDOWN:
            shift = bool(getattr(event, "mod", 0) & pygame.KMOD_SHIFT)
            found = command_of(event.key, shift)
            if found is None and getattr(event, "unicode", "") in ("?", "+", "[", "]"):
                found = command_of(*_TYPED[event.unicode])
            return [] if found is None else [found]
        if event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            return self._pointer.press(event.pos, layout, end)
        if event.type == pygame.MOUSEMOTION:
            return self._pointer.move(event.pos, layout, self._camera, end)
        if event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            return self._pointer.release(event.pos, layout, self._camera, self.moment.scene)
        if event.type == pygame.MOUSEWHEEL:
            return self._pointer.wheel(event.y, layout, self._camera)
        return []

    def _load(self, policy: int, world: int) -> Tape:
        given = self._policies[policy]
        chosen = load(given) if isinstance(given, str) else given
        return Tape(against(chosen, self._target), self._scenario, self._seed, world, self._split)

    def _switch(self, state: State) -> None:
        """Show another policy or world: nothing is changed if that is not possible."""
        tapes = self._tapes if state.world == self.state.world else {}
        if state.policy not in tapes:
            self._announce(state)
            tapes = {**tapes, state.policy: self._load(state.policy, state.world)}
        self._tapes, self._tape = tapes, tapes[state.policy]

    def _announce(self, state: State) -> None:
        """Show what is about to be loaded."""
        if self._show is not None:
            given = self._policies[state.policy]
            name = given if isinstance(given, str) else given.name
            self.message = f"Loading {name}, world {state.world} ..."
            self._show(self.draw())
            self.message = ""

    def _lines(self) -> list[Line]:
        if self.state.selected is None:
            return []
        return lines_of(self.moment, self._tape.layout, self.state.selected)

    @property
    def _ended(self) -> bool:
        return self._tape.over and int(self.state.step) >= self._tape.last

    def _remark(self) -> str:
        state = self.state
        told = [f"world {state.world}", f"{SPEEDS[state.speed]:g}× speed"]
        if int(state.step) > self._tape.last:
            told.append(f"playing up to {state.step * self._scenario.control_step:.1f} s")
        elif self._ended:
            told.append("the end")
        elif state.paused:
            told.append("paused")
        return " · ".join([*told, "H: help"])

    def _place_camera(self) -> None:
        """Bring trails and camera to the present moment."""
        state, tape, step = self.state, self._tape, self.moment.scene.step
        of, before = self._noted
        since = step - before
        if of != id(tape) or not 0 <= since <= _FAR_APART:
            self._history = tape.history(step)
        else:
            for k in range(before + 1, step + 1):
                self._history.note(tape.moment(k).scene)
        self._noted = (id(tape), step)
        viewport = viewport_of(self.layout.picture, self.layout.point)
        framed = (viewport, state.whole, state.world)
        if framed != self._framed or abs(since) > _FAR_APART:
            self._auto = Camera(viewport, self._scenario.arena, state.whole)
            self._camera = Camera(viewport, self._scenario.arena)
            self._framed = framed
        scene = self.moment.scene
        self._auto.follow(action_of(scene), abs(since) * self._scenario.control_step)
        centre, scale = self._auto.centre, self._auto.scale
        if state.follow and state.selected is not None:
            n = len(scene.position)
            centre = scene.target if state.selected >= n else scene.position[state.selected]
            scale = min(viewport[2:]) / _CLOSE_UP
        self._camera.look(centre + np.array(state.offset), scale * state.zoom)


_TYPED: Final = {
    "?": (pygame.K_h, False),
    "+": (pygame.K_PLUS, False),
    "[": (pygame.K_LEFTBRACKET, False),
    "]": (pygame.K_RIGHTBRACKET, False),
}
"""Characters that lie on other keys on some keyboards."""
