"""Films the first start of docs/recipes/robotarium.py in the Robotarium's simulator: docs/media/robotarium.gif.

    .venv-recipes/bin/python docs/drawing/robotarium.py [policy]

Its own drawing needs an older matplotlib.
"""

import runpy
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import rps.robotarium
from PIL import Image

DOCS = Path(__file__).parents[1]
EVERY, LAST, TRAIL = 18, 1080, 12
"""Steps of the simulator between two frames and of the film; frames that a track lasts."""
TEAM, TARGET, INK = "#2a6f97", "#c8553d", "#444444"


class FilmedRobotarium(rps.robotarium.Robotarium):
    """A Robotarium that notes its poses; after :data:`LAST` steps it writes the film and ends the program."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.played: list[np.ndarray[Any, Any]] = []

    def step(self) -> None:
        """Advance by one step."""
        self.played.append(self.poses.copy())
        super().step()
        if len(self.played) == LAST:
            self.write()
            raise SystemExit

    def write(self) -> None:
        """Draw and write the film."""
        poses = np.array(self.played[::EVERY])
        figure, axes = plt.subplots(figsize=(7.2, 4.6), dpi=100, layout="constrained")
        frames = []
        for now in range(len(poses)):
            axes.clear()
            axes.set(xlim=(-1.62, 1.62), ylim=(-1.02, 1.02), aspect="equal", xticks=(), yticks=())
            axes.set_title(f"{now * EVERY * self.time_step:.0f} s", loc="left", color=INK)
            for robot, (x, y, heading) in enumerate(poses[now].T):
                colour = TARGET if robot == self.number_of_robots - 1 else TEAM
                axes.plot(*poses[max(0, now - TRAIL) : now + 1, :2, robot].T, color=colour, alpha=0.4)
                axes.add_patch(plt.Circle((x, y), self.robot_radius, color=colour))
                nose = self.robot_radius * np.array((np.cos(heading), np.sin(heading)))
                axes.plot((x, x + nose[0]), (y, y + nose[1]), color="white", linewidth=2)
            figure.canvas.draw()
            frames.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(32))
        path = DOCS / "media" / "robotarium.gif"
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=100, loop=0)
        print(path.relative_to(DOCS.parent), f"{path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    mpl.use("agg")
    rps.robotarium.Robotarium = FilmedRobotarium
    runpy.run_path(str(DOCS / "recipes" / "robotarium.py"))
    sys.exit("the recipe ended before the film")
