"""Figures as part of a web page: SVG whose colours follow the page's light or dark.

A page's Content-Security-Policy forbids styles in attributes, so that each becomes a class.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from posse_training.reports.pictures.palette import DARK

_SVG: Final = "http://www.w3.org/2000/svg"
_HREF: Final = "{http://www.w3.org/1999/xlink}href"
_COLOUR: Final = re.compile(r"#[0-9a-f]{6}\b")
_LONG: Final = re.compile(r"-?\d+\.\d{3,}")
_COORDINATES: Final = ("d", "x", "y", "transform", "points")


class Sheet:
    """The styles of several figures, as classes."""

    def __init__(self) -> None:
        self._classes: dict[str, str] = {}

    def name(self, style: str) -> str:
        """Return the class of a style."""
        return self._classes.setdefault(style, f"s{len(self._classes)}")

    def css(self) -> str:
        """Return the style sheet, light and dark."""
        light = "".join(f"{_variable(colour)}:{colour};" for colour in DARK)
        dark = "".join(f"{_variable(colour)}:{other};" for colour, other in DARK.items())
        lines = [
            f":root{{{light}}}",
            f"@media (prefers-color-scheme: dark){{:root{{{dark}}}}}",
            ":where(.figure svg *){stroke-linejoin:round;stroke-linecap:butt}",
        ]
        lines += [
            f".{name}{{{_COLOUR.sub(lambda found: f'var({_variable(found[0])})', style)}}}"
            for style, name in self._classes.items()
        ]
        return "\n".join(lines)


def inline(path: Path, sheet: Sheet) -> str:
    """Return a figure's SVG file as an element of a page; its styles go to the sheet.

    Text in it stays text: it is parsed and written again, never pasted.
    """
    root = ET.parse(path).getroot()
    for name in ("width", "height", "version"):
        root.attrib.pop(name, None)
    for parent in root.iter():
        for child in list(parent):
            if child.tag in (f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"):
                parent.remove(child)
    for element in root.iter():
        style = element.attrib.pop("style", None)
        if style is not None:
            element.set("class", sheet.name(style))
        for name in _COORDINATES:
            if name in element.attrib:
                element.set(name, _LONG.sub(_short, element.attrib[name]))
        _rename(element, path.stem)
    root.set("role", "img")
    root.set("aria-labelledby", f"{path.stem}-caption")
    ET.register_namespace("", _SVG)
    return ET.tostring(root, encoding="unicode")


def _rename(element: ET.Element, figure: str) -> None:
    """Make an element's identifier one of its figure, since a page holds several figures."""
    if "id" in element.attrib:
        element.set("id", f"{figure}-{element.attrib['id']}")
    address = element.attrib.pop(_HREF, "")
    if address:
        element.set("href", f"#{figure}-{address.removeprefix('#')}")
    clip = element.attrib.get("clip-path", "")
    if clip.startswith("url(#"):
        element.set("clip-path", f"url(#{figure}-{clip.removeprefix('url(#')}")


def _short(found: re.Match[str]) -> str:
    return f"{float(found[0]):.2f}".rstrip("0").rstrip(".")


def _variable(colour: str) -> str:
    return f"--c{colour.removeprefix('#')}"
