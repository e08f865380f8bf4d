"""What an SDF file says of a link: mass, also where it follows from its shapes, and looks."""

from __future__ import annotations

import numpy as np

from ncgen.errors import shown
from ncgen.exchange.robots.looks import Shape, Unseen, colour_of, mesh, mesh_path, shape
from ncgen.exchange.robots.markup import Markup
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Mass
from ncgen.exchange.robots.sdf_scopes import Entry, pose_of, relative_of, truth
from ncgen.exchange.robots.uniform import enclosed, uniform

ENTRIES = {"ixx": 1.0, "iyy": 1.0, "izz": 1.0, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
"""Of a tensor of inertia, with the format's defaults (kg m²)."""

KILOGRAM = 1.0
"""Mass of a link that says none (kg)."""

DEFAULT_DENSITY = 1000.0
"""Density of a shape that says none (kg/m³)."""

SIZES = {
    "box": (("size", 3),), "sphere": (("radius", 1),), "ellipsoid": (("radii", 3),), "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)), "cone": (("radius", 1), ("length", 1)),
}  # fmt: skip
"""{kind of geometry: its elements and how many numbers they have}."""


def mass_of(entry: Entry) -> Mass | None:
    """A link's mass in its frame: 1 kg and 1 kg m² about all axes for what it does not say; None where nothing of it is more than 0."""
    inertial = entry.element.first("inertial")
    if inertial is None:
        return Mass.of(KILOGRAM, ENTRIES.values(), Placement())
    mass_element = inertial.first("mass")
    mass = mass_element.content(1)[0] if mass_element is not None else KILOGRAM
    if mass < 0:
        inertial.refuse(f"the mass is {mass:g} kg; give a positive number")
    if truth(inertial.attributes.get("auto") or "false", inertial):
        return _of_shapes(entry, inertial, mass if mass_element is not None else None)
    inertia, pose = inertial.first("inertia"), inertial.first("pose")
    if relative_of(pose):
        inertial.refuse("the pose of an <inertial> is relative to its link, and to nothing else; leave out relative_to")
    return Mass.of(mass, (number_of(inertia, *each) for each in ENTRIES.items()), pose_of(pose))


def _of_shapes(entry: Entry, inertial: Markup, mass: float | None) -> Mass:
    """Of a link whose collision shapes are solid. mass: scales all, if it is given (kg)"""
    name, shapes = entry.element.name(), entry.element.all("collision")
    if not shapes:
        inertial.refuse(f"link {name}: its inertia is that of its collision shapes, and it has none; give it a <collision>")
    usual = number_of(inertial, "density", DEFAULT_DENSITY)
    total: Mass | None = None
    for each in shapes:
        shape_mass = _of_shape(each, number_of(each, "density", usual), entry).seen_from(_placed(each, entry))
        total = shape_mass if total is None else total.plus(shape_mass)
    assert total is not None, "no shape of several"
    if not total.mass > 0:
        inertial.refuse(f"link {name}: its collision shapes have no mass; give them a size and a density")
    return total if mass is None else Mass(mass, total.com, total.tensor * (mass / total.mass))


def _of_shape(collision: Markup, density: float, entry: Entry) -> Mass:
    inside = collision.only("geometry").children[0] if collision.only("geometry").children else None
    kind = inside.tag if inside else "none"
    shape_mass = None
    if inside is not None and kind == "mesh":
        shape_mass = _of_mesh(inside, density, entry)
    elif inside is not None and kind in SIZES:
        shape_mass = uniform(kind, sizes_of(inside), density)
    if shape_mass is None:
        collision.refuse(
            f"link {entry.element.name()}: nothing is known of the inertia of a shape of kind {kind}; write the <inertial> out"
        )
    return shape_mass


def _of_mesh(inside: Markup, density: float, entry: Entry) -> Mass:
    """Of what a mesh encloses."""
    from ncgen.view.meshes import Unreadable, whole
    from ncgen.view.triangles import Mesh

    uri, scale = inside.only("uri").text, inside.first("scale")
    if inside.first("submesh") is not None:
        inside.refuse(f"link {entry.element.name()}: the inertia of a part of mesh {shown(uri)} is not computed; write the <inertial> out")
    path = mesh_path(uri, entry.scope.file)
    try:
        if path is None:
            raise Unreadable("there is no such file here, and nothing is fetched")
        surface = whole(path)
    except Unreadable as error:
        inside.refuse(f"link {entry.element.name()}: its inertia is that of mesh {shown(uri)}: {error}")
    factors = np.array(scale.content(3) if scale is not None else (1.0, 1.0, 1.0))
    triangles = surface.triangles if factors.prod() > 0 else surface.triangles[:, ::-1]
    enclosed_mass = enclosed(Mesh(surface.vertices * factors, triangles), density)
    if enclosed_mass is None:
        inside.refuse(f"link {entry.element.name()}: mesh {shown(uri)} encloses no volume, or is inside out; write the <inertial> out")
    return enclosed_mass


def sizes_of(inside: Markup) -> list[float]:
    """The numbers of a geometry, whose elements must be there."""
    return [number for tag, count in SIZES[inside.tag] for number in inside.only(tag).content(count)]


def _placed(each: Markup, entry: Entry) -> Placement:
    """A visual or collision in its link's frame."""
    pose = each.first("pose")
    base = relative_of(pose)
    if not base:
        return pose_of(pose)
    scope, link = entry.scope, entry.element
    return scope.place(link.name(), link).inverse() @ scope.place(base, each) @ pose_of(pose)


def look_of(visual: Markup, entry: Entry) -> Shape | Unseen:
    """What is seen of a link, in its frame."""
    geometry, material = visual.first("geometry"), visual.first("material")
    inside = geometry.children[0] if geometry and geometry.children else None
    diffuse = material.first("diffuse") if material else None
    colour = colour_of(diffuse.content(len(diffuse.text.split()))) if diffuse and len(diffuse.text.split()) in (3, 4) else None
    placement = _placed(visual, entry)
    if inside is None:
        return Unseen("none")
    if inside.tag == "mesh":
        scale = inside.first("scale")
        return mesh(inside.only("uri").text, scale.content(3) if scale else (1.0, 1.0, 1.0), placement, colour, entry.scope.file)
    return shape(inside.tag, sizes_of(inside), placement, colour) if inside.tag in SIZES and inside.tag != "cone" else Unseen(inside.tag)


def number_of(inside: Markup | None, tag: str, default: float = 0.0) -> float:
    """The number of an element inside another one, or the default."""
    element = inside.first(tag) if inside is not None else None
    return default if element is None else element.content(1)[0]
