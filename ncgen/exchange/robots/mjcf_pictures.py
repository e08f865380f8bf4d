"""MJCF without the pictures that keep MuJoCo from reading it: meshes, textures and skins that are not there, shapes whose numbers cannot be
read.

MuJoCo refuses the whole file for each of them. Where a body has its <inertial>, its dynamics need no shape, so a shape that cannot be read
becomes a small sphere without mass that is not seen. Where the inertia is that of the shapes the file stays as it is, and is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import replace
from pathlib import Path

from ncgen.exchange.robots.markup import Attributes, Markup, read_markup

PLACEHOLDER_SPHERE = {"type": "sphere", "size": "0.001", "mass": "0", "group": "5"}
"""What a shape becomes: group 5 is not seen in MuJoCo's viewer."""

REMOVED_ATTRIBUTES = ("mesh", "hfield", "material", "rgba", "fitscale", "fromto", "fluidshape", "fluidcoef", "density", "shellinertia")
"""What such a sphere of a shape does not have."""

NUMBERS = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "fromto", "size", "rgba", "scale", "refpos", "refquat")
"""Attributes of pictures that hold numbers."""

PLACEHOLDERS = {"texture": {"builtin": "flat", "width": "1", "height": "1"}, "hfield": {"nrow": "2", "ncol": "2"}}
"""What stands for a file that is not there."""


class Readable:
    """A file of MJCF, included ones in it, with what can be left out of it left out."""

    def __init__(self, root: Markup, where: Callable[[str], Path | None]) -> None:
        """where: the file of a name in `root`, None where there is no such file"""
        self.where = where
        self.missing: list[str] = []
        self.root = self._whole(root, 0)
        compilers = [each.attributes for each in self.root.walk() if each.tag == "compiler"]
        self.from_shapes = any(dict.get(each, "inertiafromgeom") == "true" for each in compilers)
        self.meshes = {name for each in self.root.walk() if each.tag == "asset" for name in self._unreadable_meshes(each)}

    def text(self) -> str | None:
        """The file's text; None where nothing can be left out, or the dynamics need it."""
        if self.from_shapes:
            return None
        try:
            root = self._without(self.root, has_inertia=False)
        except LookupError:
            return None
        return _text(root) if self.missing else None

    def _whole(self, element: Markup, depth: int) -> Markup:
        """The element with what it includes; names of files are those of this machine."""
        rewritten, attributes = copy(element), Attributes(element.attributes)
        for key, name in element.attributes.items():
            if key.startswith("file") and element.tag != "include" and (file := self.where(name)):
                attributes[key] = str(file)
        children = list[Markup]()
        for child in element.children:
            file = self.where(dict.get(child.attributes, "file", "")) if child.tag == "include" and depth < 100 else None
            children += self._whole(read_markup(file), depth + 1).children if file else [self._whole(child, depth)]
        return replace(rewritten, attributes=attributes, children=children)

    def _unreadable_meshes(self, asset: Markup) -> Iterator[str]:
        for each in asset.all("mesh"):
            file = dict.get(each.attributes, "file")
            if _is_unreadable(each) or (file is not None and self.where(file) is None):
                self.missing.append(file or dict.get(each.attributes, "name", "mesh"))
                yield dict.get(each.attributes, "name") or Path(file or "").stem

    def _without(self, element: Markup, has_inertia: bool) -> Markup:
        """The element as it can be read. Raises LookupError where inertia is that of a shape that cannot."""
        children = list[Markup]()
        for child in element.children:
            file, is_asset = dict.get(child.attributes, "file"), element.tag == "asset"
            if child.tag == "geom" and element.tag != "default" and self._is_unreadable_shape(child):
                if not has_inertia and element.tag != "worldbody":
                    raise LookupError(child.place)
                children.append(_small(child))
            elif child.tag == "mesh" and is_asset and self._is_left_out(child):
                continue
            elif child.tag == "skin" and file and self.where(file) is None:
                self.missing.append(file)
            elif child.tag in PLACEHOLDERS and is_asset and file and self.where(file) is None:
                self.missing.append(file)
                kept = {key: text for key, text in child.attributes.items() if key != "file"}
                children.append(replace(child, attributes=Attributes(kept | PLACEHOLDERS[child.tag])))
            else:
                children.append(self._without(child, child.first("inertial") is not None))
        return replace(element, children=children)

    def _is_unreadable_shape(self, geom: Markup) -> bool:
        """Whether its mesh is left out, which is counted already, or its numbers cannot be read."""
        if dict.get(geom.attributes, "mesh") in self.meshes:
            return True
        if not _is_unreadable(geom):
            return False
        self.missing.append(dict.get(geom.attributes, "name", "geom"))
        return True

    def _is_left_out(self, mesh: Markup) -> bool:
        return (dict.get(mesh.attributes, "name") or Path(dict.get(mesh.attributes, "file", "")).stem) in self.meshes


def _small(geom: Markup) -> Markup:
    kept = {
        key: text for key, text in geom.attributes.items() if key not in REMOVED_ATTRIBUTES and not (key in NUMBERS and _is_no_number(text))
    }
    return replace(geom, attributes=Attributes(kept | PLACEHOLDER_SPHERE))


def _is_unreadable(element: Markup) -> bool:
    return any(_is_no_number(text) for key, text in element.attributes.items() if key in NUMBERS)


def _is_no_number(text: str) -> bool:
    try:
        return not [float(word) for word in text.split()]
    except ValueError:
        return True


def _text(element: Markup) -> str:
    from xml.sax.saxutils import escape, quoteattr  # which imports all that speaks HTTP

    attributes = "".join(f" {key}={quoteattr(text)}" for key, text in element.attributes.items())
    return f"<{element.tag}{attributes}>{escape(element.raw)}{''.join(map(_text, element.children))}</{element.tag}>"
