"""What a viewer of a frame has chosen to see."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class View:
    """Choices that change a picture and not the world.

    Attributes:
        selected: Number of the tracker that is looked at closely; N: the target; ``None``: nobody.
        links: Whether radio links are drawn.
        sensing: Whether the area in sight and the sonar are drawn.
        trails: Whether trails are drawn.
        numbers: Whether trackers bear their numbers, where they are drawn large enough.
        least_robot: Least radius of a drawn robot, points.
    """

    selected: int | None = None
    links: bool = True
    sensing: bool = True
    trails: bool = True
    numbers: bool = False
    least_robot: float = 5.0
