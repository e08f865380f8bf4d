"""Models of an SDF file as scopes: nested ones, and those of other files, which are found on this machine alone; nothing is fetched."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from ncgen.errors import shown
from ncgen.exchange.robots.looks import folders_named
from ncgen.exchange.robots.markup import Markup, read_markup
from ncgen.exchange.robots.sdf_scopes import NAMED_TAGS, Scope, flag, pose_of, relative_of, truth
from ncgen.files import is_file

MOST_FILES = 1000
"""Files that a model includes."""

DEEPEST_FILES = 20
"""Files that include each other."""

FIRST, LATER = (1, 2), (1, 4)
"""The first version that is read, and the one that it is read as."""

CONTENTS = ("model", "actor", "light")
"""What an included file holds one of."""


@dataclass
class Document:
    """world: the scope around all models; gravity's element; roots: those of all files that were read."""

    scope: Scope
    world: Markup
    roots: list[Markup] = field(default_factory=list)


def document_of(root: Markup, path: Path) -> Document:
    """What a file holds, and what it includes. Raises ModelError with file and line."""
    worlds = root.all("world")
    if len(worlds) > 1:
        worlds[1].refuse(f"{len(worlds)} worlds; a file that is read has one")
    world = worlds[0] if worlds else root
    scope = Scope(element=world, file=path, version=version_of(root))
    document = Document(scope, world, [root])
    builder = _Builder(document, _prefixed(world))
    builder.fill(scope, world, scope, 0)
    if world is not root:
        builder.fill(scope, root, scope, 0)
    if not scope.models:
        root.refuse("it has no <model>; a robot's file has one")
    return document


def version_of(root: Markup) -> tuple[int, ...]:
    """Of a file's format."""
    text = root.attributes.get("version") or "1.7"
    version = tuple(int(number) for number in text.split(".") if number.isdigit())
    if version < FIRST:
        root.refuse(f"SDF {text} is not read; convert it to 1.4 or later (gz sdf -p)")
    return max(version, LATER)


def _prefixed(world: Markup) -> bool:
    """Whether the names of the one model that moves stand for themselves: they do where the others rest."""
    models = [each for each in world.children if each.tag in ("model", "include")]
    return len([each for each in models if not flag(each, "static")]) > 1


@dataclass
class _Builder:
    document: Document
    prefixed: bool

    def fill(self, scope: Scope, element: Markup, owner: Scope, depth: int) -> None:
        """What stands in an element becomes a scope's. owner: the scope of what it mentions."""
        for each in element.children:
            if each.tag in NAMED_TAGS:
                scope.add(each, owner)
                if owner is not scope:
                    owner.add(each, owner)
            elif each.tag == "model":
                self._nest(scope, owner, each, owner, None, depth)
            elif each.tag == "include":
                self._include(scope, owner, each, depth)

    def _nest(self, scope: Scope, owner: Scope, model: Markup, read: Scope, include: Markup | None, depth: int) -> None:
        """A model within a scope. read: has the file and version; include: the element that says so where it is another file's."""
        name = _text(include, "name") or model.name()
        posed = include.first("pose") if include else None
        pose = posed if posed is not None else model.first("pose")
        is_static = flag(include, "static")
        is_static = owner.static or bool(flag(model, "static") if is_static is None else is_static)
        merged = include is not None and truth(include.attributes.get("merge") or "false", include)
        is_alone = scope.parent is None and not is_static and not self.prefixed
        inner = Scope(
            element=model,
            file=read.file,
            version=read.version,
            parent=owner,
            name=name,
            prefix=scope.prefix if merged else "" if is_alone else f"{scope.prefix}{name}::",
            pose=pose_of(pose),
            relative_to=relative_of(pose),
            placement_frame=_text(include, "placement_frame") or model.attributes.get("placement_frame") or "",
            canonical=model.attributes.get("canonical_link") or "",
            static=is_static,
            merged=merged,
            waiting=owner.waiting,
        )
        if merged:
            self.fill(scope, model, inner, depth)
            return
        if name in scope.models:
            model.refuse(f"there are two models {shown(name)}; rename one")
        scope.models[name] = inner
        if owner is not scope:
            owner.models[name] = inner
        self.fill(inner, model, inner, depth)
        if inner.canonical and inner.find(inner.canonical) is None:
            model.refuse(f"canonical_link: model {shown(name)} has no link {shown(inner.canonical)}; name one of its links")

    def _include(self, scope: Scope, owner: Scope, include: Markup, depth: int) -> None:
        """The model of another file."""
        uri = include.only("uri").text.strip()
        file = file_of(uri, owner.file)
        if file is None:
            include.refuse(
                f"<include>: there is no file of {shown(uri)} on this machine, and nothing is fetched; "
                "name the folder that it is in by GZ_SIM_RESOURCE_PATH"
            )
        if depth >= DEEPEST_FILES or len(self.document.roots) > MOST_FILES:
            include.refuse(
                f"more than {DEEPEST_FILES if depth >= DEEPEST_FILES else MOST_FILES} files include each other; a robot needs fewer"
            )
        root = read_markup(file)
        if root.tag != "sdf":
            include.refuse(f"{shown(uri)} begins with <{root.tag}>; an included file begins with <sdf>")
        held = [each for each in root.children if each.tag in CONTENTS]
        if len(held) != 1:
            root.refuse(f"{len(held)} models, actors and lights; an included file holds one")
        self.document.roots.append(root)
        if held[0].tag == "model":
            self._nest(scope, owner, held[0], Scope(element=root, file=file, version=version_of(root)), include, depth + 1)


def _text(inside: Markup | None, tag: str) -> str:
    element = inside.first(tag) if inside is not None else None
    return element.text.strip() if element is not None else ""


def file_of(uri: str, mentioned_in: Path) -> Path | None:
    """The SDF file of an address, model://, package:// and file://, or a path from the file that mentions it; None where there is none."""
    kind, mark, rest = uri.partition("://")
    if "\0" in uri or (mark and kind not in ("model", "package", "file")):
        return None
    candidates: Iterable[Path]
    if kind in ("model", "package") and mark:
        package, _, inside = rest.partition("/")
        candidates = (folder / inside for folder in folders_named(package, mentioned_in.resolve().parent))
    else:
        candidates = [mentioned_in.resolve().parent / (rest if mark else uri)]
    for candidate in candidates:
        if is_file(candidate):
            return candidate
        if is_file(candidate / "model.config"):
            return _described(candidate)
    return None


def _described(folder: Path) -> Path | None:
    """The file of the highest version that a model's description names."""
    named = [
        (tuple(int(number) for number in (each.attributes.get("version") or "0").split(".") if number.isdigit()), each.text.strip())
        for each in read_markup(folder / "model.config").all("sdf")
    ]
    files = (folder / name for _, name in sorted(named, reverse=True) if "\0" not in name)
    return next((path for path in files if is_file(path)), None)
