"""Renderer of a world: frames as arrays, or a window.

The style follows the paper's figures: trackers are grey discs with a line for the heading, and the
target has its own colour. :mod:`posse.rendering.picture` lists the layers of a frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from posse.rendering.camera import Camera
from posse.rendering.content.history import History
from posse.rendering.content.scene import Scene, read_scene
from posse.rendering.picture import action_of, draw_picture, viewport_of
from posse.rendering.style import DESIGN_SIZE
from posse.scenarios import Scenario

if TYPE_CHECKING:
    from posse.engine.batch import Batch
    from posse.rendering.window import Window

RENDER_MODES: Final = ("human", "rgb_array")
LEAST_SIZE: Final = 200
"""Least width and height of a frame, px."""


class Renderer:
    """Draws one world of a batch, frame by frame.

    A frame shows the current state and the trails; on the open plane the view follows the team. It
    depends only on this and the earlier states drawn in the episode: the same sequence gives the
    same pixels.

    Args:
        scenario: Scenario of the batches to draw.
        mode: ``"rgb_array"``: frames are returned, no display is needed; ``"human"``: they appear
            in a window, in real time.
        size: Width and height of a frame, px.
        title: Shown above the frame after the scenario's name; default: only the name.

    Raises:
        ValueError: An unknown mode, or a size below :data:`LEAST_SIZE`.
    """

    def __init__(
        self, scenario: Scenario, mode: str = "rgb_array", size: tuple[int, int] = (640, 640), title: str | None = None
    ) -> None:
        if mode not in RENDER_MODES:
            raise ValueError(f"unknown render mode {mode!r}; modes are: {', '.join(RENDER_MODES)}")
        given = np.asarray(size)
        if given.shape != (2,) or given.dtype.kind not in "iu" or given.min() < LEAST_SIZE:
            raise ValueError(f"size={size!r} must be (width, height), whole numbers of at least {LEAST_SIZE} px")
        # Imported here, so that importing posse does not import pygame.
        from posse.rendering.canvas import Canvas

        self.scenario = scenario
        self.mode = mode
        self.size = (int(size[0]), int(size[1]))
        self.title = title
        self._point = min(self.size) / DESIGN_SIZE
        self._box = (0, 0, *self.size)
        self._canvas = Canvas(self.size)
        self._camera = Camera(viewport_of(self._box, self._point), scenario.arena)
        self._history = History()
        self._window: Window | None = None
        self._closed = False

    @property
    def closed(self) -> bool:
        """Whether :meth:`close` was called, or the user closed the window."""
        return self._closed

    def follow(self, batch: Batch, world: int = 0) -> None:
        """Record the current state without drawing it.

        For videos that skip steps: trails and view are the same as if all steps were drawn.

        Raises:
            ValueError: The batch is of another scenario, or has no such world.
            ResetNeeded: The batch has not been reset.
        """
        self._note(self._read(batch, world, None))

    def draw(
        self, batch: Batch, world: int = 0, annotations: Mapping[str, npt.ArrayLike] | None = None
    ) -> npt.NDArray[np.uint8] | None:
        """Draw the current state of a world.

        Args:
            batch: A batch of the renderer's scenario.
            world: Index of the world in the batch.
            annotations: Internal values of a policy, each (E, N) integers: ``"task"``, the number
                in :data:`posse.rendering.style.TASKS`, colours the trackers; ``"leader"``, the
                number of the leader of each tracker, marks those that lead themselves.

        Returns:
            A frame (H, W, 3) uint8 in the mode ``"rgb_array"``; ``None`` in the mode ``"human"``,
            which draws nothing after the user has closed the window.

        Raises:
            ValueError: The batch is of another scenario, has no such world, or annotations do not
                fit; or the renderer was closed and the mode is ``"rgb_array"``.
            ResetNeeded: The batch has not been reset.
        """
        if self._closed:
            if self.mode == "human":
                return None
            raise ValueError("this renderer was closed: make a new one")
        scene = self._read(batch, world, annotations)
        self._note(scene)
        self._compose(scene)
        frame = self._canvas.finish()
        if self.mode == "rgb_array":
            from posse.rendering.canvas import pixels

            return pixels(frame)
        if self._window is None:
            from posse.rendering.window import Window

            name = f"posse: {self.scenario.name}"
            self._window = Window(self.size, name, 1 / self.scenario.control_step)
        if not self._window.show(frame):
            self.close()
        return None

    def project(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the pixels (..., 2), right and down, of points (..., 2) m in the last frame."""
        return self._camera.project(np.asarray(points, np.float64))

    def close(self) -> None:
        """Close the window, if there is one. May be called twice."""
        self._closed = True
        if self._window is not None:
            self._window.close()
            self._window = None

    def _read(self, batch: Batch, world: int, annotations: Mapping[str, npt.ArrayLike] | None) -> Scene:
        if batch.scenario != self.scenario:
            raise ValueError(
                f"a batch of {batch.scenario.name!r} does not fit a renderer of "
                f"{self.scenario.name!r}: their scenarios must be equal in every setting"
            )
        return read_scene(batch, world, annotations)

    def _note(self, scene: Scene) -> None:
        time = self._history.note(scene)
        if time is None:
            self._camera.reset()
        self._camera.follow(action_of(scene), time or 0.0)

    def _compose(self, scene: Scene) -> None:
        draw_picture(self._canvas, self._box, self._camera, scene, self._history, self._point, self.title)
