"""Renderer of a world: frames as arrays, or a window.

The style follows the paper's figures: trackers are grey discs with a line for the heading, and the
target has its own colour. :mod:`posse.rendering.layers` lists the layers of a frame.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.engine.batch import Batch
from posse.rendering import RENDER_MODES
from posse.rendering.camera import Camera
from posse.rendering.canvas import Canvas, Window
from posse.rendering.layers import FOOTER, HEADER, Drawing, draw
from posse.rendering.scene import History, Scene
from posse.rendering.style import DESIGN_SIZE, TRACKER, Colour
from posse.scenarios import Scenario
from posse.scenarios.setting import check_choice

LEAST_SIZE: Final = 200  # px, of width and height


class Renderer:
    """Draws one world of a batch, frame by frame.

    A frame depends only on the states of the episode drawn so far: the same sequence gives the
    same pixels. The view follows the team.

    Args:
        scenario: Scenario of the batches to draw.
        mode: ``"rgb_array"``: frames are returned, no display is needed; ``"human"``: they appear in a window, in real
            time, which the user can pause, step, slow down and close (:class:`posse.rendering.canvas.Window`).
        size: Width and height of a frame, px.
        title: Shown above the frame; default: the scenario's name.
        keys: Keys of the window that are the caller's own, and what they do.
        scale: Text and lines are so many times their usual size.

    Attributes:
        title: May be set between frames.
        camera: The view of the last frame; its ``project`` gives the pixels of points.
        window: The window of the mode "human"; ``None`` once :meth:`close` was called, or the user closed it.

    Raises:
        ValueError: An unknown mode, a size below :data:`LEAST_SIZE`, or a scale that is not from 0.1 to 10.
        RuntimeError: The mode is "human", and no display is available.
    """

    def __init__(
        self,
        scenario: Scenario,
        mode: str = "rgb_array",
        size: tuple[int, int] = (640, 640),
        title: str | None = None,
        keys: Mapping[str, str] | None = None,
        scale: float = 1.0,
    ) -> None:
        check_choice("render_mode", mode, RENDER_MODES)
        given = np.asarray(size)
        if given.shape != (2,) or given.dtype.kind not in "iu" or given.min() < LEAST_SIZE:
            raise ValueError(f"size={size!r} must be (width, height), whole numbers of at least {LEAST_SIZE} px")
        if not 0.1 <= scale <= 10:
            raise ValueError(f"scale={scale!r} must be from 0.1 to 10")
        width, height = int(size[0]), int(size[1])
        self.scenario, self.mode, self.title = scenario, mode, title or scenario.name
        self._canvas = Canvas((width, height))
        self._point = scale * min(width, height) / DESIGN_SIZE
        above, below = round(HEADER * self._point), round(FOOTER * self._point)
        self.camera = Camera((0, above, width, height - above - below), scenario.half_sides)
        self._history = History()
        self.window: Window | None = None
        if mode == "human":
            self.window = Window((width, height), f"posse: {scenario.name}", 1 / scenario.control_step, keys)

    def follow(self, batch: Batch, world: int = 0) -> Scene:
        """Do as :meth:`draw` without drawing: for trails and view of videos that skip steps."""
        if batch.scenario != self.scenario:
            raise ValueError(
                f"a batch of {batch.scenario.name!r} does not fit a renderer of "
                f"{self.scenario.name!r}: their scenarios must be equal in every setting"
            )
        scene = Scene(batch, world)
        self.camera.follow(scene.in_view, self._history.note(scene))
        return scene

    def draw(
        self, batch: Batch, world: int = 0, colours: Sequence[Colour] | None = None
    ) -> npt.NDArray[np.uint8] | None:
        """Draw the current state of a world.

        Args:
            batch: A batch of the renderer's scenario.
            world: Index of the world in the batch.
            colours: Red, green, blue of each tracker, 0 to 255; default: grey.

        Returns:
            A frame (H, W, 3) uint8 in the mode ``"rgb_array"``; ``None`` in the mode ``"human"``,
            once the frame's time is over or, in a paused window, the user steps or goes on.

        Raises:
            ValueError: The batch is of another scenario or has no such world, or another number of colours.
            ResetNeeded: The batch has not been reset.
        """
        if self.mode == "human" and self.window is None:
            return None
        number = self.scenario.num_trackers
        if colours is not None and len(colours) != number:
            raise ValueError(f"{len(colours)} colours do not fit {number} trackers: give one for each")
        scene = self.follow(batch, world)
        if self.window is not None and not self.window.begin():
            return None
        colours = (TRACKER,) * number if colours is None else colours
        draw(Drawing(scene, self._history, self.camera, self._canvas, self._point, self.title, colours))
        if self.window is None:
            return self._canvas.pixels()
        if not self.window.show(self._canvas.finish()):
            self.close()
        return None

    def close(self) -> None:
        """Close the window, if there is one. May be called twice."""
        if self.window is not None:
            self.window.close()
            self.window = None
