"""A copy of a robot's file with one number changed, to measure what a change costs a user."""

from __future__ import annotations

import os
import xml.etree.ElementTree as xml
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from ncgen.exchange.robots import SUFFIXES
from ncgen.exchange.robots.markup import read_markup
from ncgen.exchange.robots.mjcf_compiled import family, named_files

FACTOR = 1.01
MIN_NUMBER = 1e-6
"""Masses (kg) and lengths (m) above this are changed: smaller ones stand for none."""

NumberLocation: TypeAlias = tuple[xml.Element, str | None]
"""Where a number stands: an element, and its attribute or None for its text."""


def changed_copy(file: Path, folder: Path) -> Path | None:
    """The copy in a folder of its own below `folder`; None where there is nothing to change, or files are needed that are not known.

    Of URDF and SDF the middle mass is changed, of MJCF the middle mass of a body, or the first size or position of one, in the file itself
    or in the first of those that it includes. What else MJCF is made of is linked next to the copy, as it lies next to the file. Meshes of
    URDF and SDF are pictures, without which a robot moves the same.
    """
    if file.suffix.lower() not in SUFFIXES:
        return None
    root = xml.parse(file).getroot()
    if root.tag != "mujoco" and any(each.tag.endswith("include") for each in root.iter()):
        return None
    original = file.resolve()
    others = _others_of_mjcf(original) if root.tag == "mujoco" else []
    if others is None:
        return None
    for each in (original, *(other for other in others if other.suffix.lower() == ".xml")):
        tree = xml.parse(each)
        location = _chosen_number(tree.getroot())
        if location is not None:
            break
    else:
        return None
    _change(location)
    home = os.path.commonpath([path.parent for path in (original, *others)])
    copies = {path: folder / "changed" / path.relative_to(home) for path in (original, *others)}
    for path, copy in copies.items():
        copy.parent.mkdir(parents=True, exist_ok=True)
        if path == each:
            tree.write(copy, encoding="utf-8", xml_declaration=True)
        else:
            copy.symlink_to(path)
    return copies[original]


def _others_of_mjcf(file: Path) -> list[Path] | None:
    """All that a model is made of besides its file; None where it names a file that is not among them."""
    members = family(read_markup(file), file)
    known = {Path(each) for each in members.files} | {file}
    named = {Path(name).name for root in members.roots for _, name in named_files(root)}
    return sorted(known - {file}) if named <= {each.name for each in known} else None


def _change(location: NumberLocation) -> None:
    """Make the number there FACTOR times what it is."""
    element, attribute = location
    old = _first_word(location)
    new = repr(FACTOR * float(old))
    if attribute is None:
        element.text = new
    else:
        element.set(attribute, element.attrib[attribute].replace(old, new, 1))


def _chosen_number(root: xml.Element) -> NumberLocation | None:
    """The number that is changed."""
    if root.tag in ("mujoco", "mujocoinclude"):
        inside = dict.fromkeys(each for body in root.iter("body") for each in body.iter() if each.tag in ("geom", "inertial", "body"))
        masses, *others = (_numbers((each, key) for each in inside) for key in ("mass", "size", "pos"))
    else:
        masses, others = _numbers((each, "value" if root.tag == "robot" else None) for each in root.iter("mass")), []
    return masses[len(masses) // 2] if masses else next((numbers[0] for numbers in others if numbers), None)


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
