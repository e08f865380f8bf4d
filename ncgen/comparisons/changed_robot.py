"""A copy of a robot's file with one number changed, to measure what a change costs a user."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from ncgen.exchange.robots import SUFFIXES

FACTOR = 1.01
MIN_NUMBER = 1e-6
"""Masses (kg) and lengths (m) above this are changed: smaller ones stand for none."""

NumberLocation: TypeAlias = tuple[xml.Element, str | None]
"""Where a number stands: an element, and its attribute or None for its text."""


def changed_copy(file: Path, folder: Path) -> Path | None:
    """The copy in a folder of its own below `folder`; None where there is nothing to change or the motion needs files next to this one.

    Of URDF and SDF the middle mass is changed, of MJCF the middle mass of a body, or the first size of one. Meshes of URDF and SDF are
    pictures, without which a robot moves the same; MuJoCo computes inertias from those of MJCF.
    """
    if file.suffix.lower() not in SUFFIXES:
        return None
    tree = xml.parse(file)
    root = tree.getroot()
    location = _chosen_number(root)
    if location is None or _needs_files(root):
        return None
    element, attribute = location
    old = _first_word(location)
    new = repr(FACTOR * float(old))
    if attribute is None:
        element.text = new
    else:
        element.set(attribute, element.attrib[attribute].replace(old, new, 1))
    copy = folder / "changed" / file.name
    copy.parent.mkdir()
    tree.write(copy, encoding="utf-8", xml_declaration=True)
    return copy


def _needs_files(root: xml.Element) -> bool:
    """Whether elements name files with more of the robot, xacro's among them."""
    return any(
        each.tag.endswith("include") or (root.tag == "mujoco" and any(key.startswith("file") for key in each.attrib))
        for each in root.iter()
    )  # fmt: skip


def _chosen_number(root: xml.Element) -> NumberLocation | None:
    """The number that is changed."""
    if root.tag == "mujoco":
        bodies = [each for body in root.findall("worldbody/body") for each in body.iter() if each.tag in ("geom", "inertial")]
        masses, sizes = (_numbers((each, key) for each in bodies) for key in ("mass", "size"))
    else:
        masses, sizes = _numbers((each, "value" if root.tag == "robot" else None) for each in root.iter("mass")), []
    return masses[len(masses) // 2] if masses else sizes[0] if sizes else None


def _numbers(locations: Iterable[NumberLocation]) -> list[NumberLocation]:
    """Those where a number above MIN_NUMBER stands: no parameter of xacro."""
    large_enough = []
    for location in locations:
        try:
            if float(_first_word(location)) > MIN_NUMBER:
                large_enough.append(location)
        except ValueError:
            continue
    return large_enough


def _first_word(location: NumberLocation) -> str:
    """What stands there, of several sizes the first."""
    element, attribute = location
    text = element.text if attribute is None else element.get(attribute)
    return next(iter((text or "").split()), "")
