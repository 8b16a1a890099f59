"""The shapes and joints of a model's robot, for the eye only: what moves how comes from the simulation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Union
from xml.etree import ElementTree

from btr._inputs import wrong
from btr._studio import meshes
from btr.model import Model

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Shape:
    """A primitive or a mesh, fixed to its link."""

    kind: Literal["box", "sphere", "cylinder", "mesh"]
    """What it is."""
    size_m: Vector
    """A box's edges; a sphere's radius, first; a cylinder's radius and length along z, first and second."""
    xyz_m: Vector = ZERO
    """Its centre in the link's frame."""
    rpy_rad: Vector = ZERO
    """Its roll, pitch and yaw in the link's frame."""
    mesh: Union[meshes.Mesh, None] = None
    """A mesh's vertices and faces; None for a primitive."""


@dataclass(frozen=True)
class Rod:
    """A straight rod between two points of a link without shapes."""

    begin_m: Vector
    """One end, in the link's frame."""
    end_m: Vector
    """The other end, in the link's frame."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another one."""

    leader: str
    """The joint that it follows."""
    ratio: float
    """Its position per position of the leader."""
    offset: float
    """Its position where the leader is at 0."""


@dataclass
class Link:
    """A link and the joint that carries it."""

    name: str
    """Name of the link."""
    shapes: list[Shape] = field(default_factory=list)
    """Its shapes, in its frame."""
    centre_m: Vector = ZERO
    """Its centre of mass, in its frame."""
    parent: Union[str, None] = None
    """The link that carries it; None for the root."""
    joint: str = ""
    """Name of its joint; empty for the root."""
    kind: str = "fixed"
    """Kind of the joint, as in URDF."""
    xyz_m: Vector = ZERO
    """Origin of the joint in the parent's frame."""
    rpy_rad: Vector = ZERO
    """Roll, pitch and yaw of the joint in the parent's frame."""
    axis: Vector = (1.0, 0.0, 0.0)
    """The joint's axis, of length 1, in the link's frame."""
    mimic: Union[Mimic, None] = None
    """What the joint follows; None if it moves by itself."""


@dataclass(frozen=True)
class Robot:
    """The links, each after its parent."""

    links: list[Link]

    @property
    def reach_m(self) -> float:
        """How far the robot reaches at most from its root, roughly."""
        reach: dict[Union[str, None], float] = {None: 0.0}
        for link in self.links:
            reach[link.name] = reach[link.parent] + math.hypot(*link.xyz_m)
        tips = [reach[link.name] + 2 * math.hypot(*link.centre_m) for link in self.links]
        return max([*tips, 0.05])

    def rods(self, link: Link) -> Iterator[Rod]:
        """Rods for a link without shapes: to each joint that it carries, or through its centre of mass."""
        ends = [child.xyz_m for child in self.links if child.parent == link.name]
        x, y, z = link.centre_m
        for end in ends or [(2 * x, 2 * y, 2 * z)]:
            if math.hypot(*end) > 1e-6:
                yield Rod(ZERO, end)


def robot_of(model: Model) -> Robot:
    """The robot of a model. Raises `BtrError` if its description cannot be had."""
    return parsed(model.urdf, meshes.folder_of(model))


def parsed(urdf: str, folder: Union[Path, None] = None) -> Robot:
    """The robot of a URDF's text, with meshes if its folder is given. Raises `BtrError` if it is no tree of links."""
    try:
        root = ElementTree.fromstring(urdf)
        links = {name: _link(name, element, folder) for element in root.iter("link") if (name := element.get("name"))}
        for element in root.findall("joint"):
            _carry(links, element)
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise wrong(f"the robot's URDF cannot be drawn: {error}", "check it with another viewer") from error
    return Robot(_parents_first(links))


def _link(name: str, element: ElementTree.Element, folder: Union[Path, None]) -> Link:
    centre, _ = _origin(element.find("inertial"))
    for tag in ("visual", "collision"):
        drawn = [_shape(part, folder) for part in element.findall(tag)]
        shapes = [shape for shape in drawn if shape is not None]
        if shapes:
            return Link(name, shapes, centre)
    return Link(name, [], centre)


def _shape(element: ElementTree.Element, folder: Union[Path, None]) -> Union[Shape, None]:
    """A shape; None for a mesh that cannot be had."""
    xyz, rpy = _origin(element)
    geometry = element.find("geometry")
    for form in geometry if geometry is not None else ():
        if form.tag == "box":
            return Shape("box", _vector(form.get("size")), xyz, rpy)
        if form.tag == "sphere":
            return Shape("sphere", (float(form.attrib["radius"]), 0.0, 0.0), xyz, rpy)
        if form.tag in ("cylinder", "capsule"):
            return Shape("cylinder", (float(form.attrib["radius"]), float(form.attrib["length"]), 0.0), xyz, rpy)
        path = meshes.found(form.get("filename", ""), folder) if form.tag == "mesh" and folder is not None else None
        mesh = None if path is None else meshes.read(path, _vector(form.get("scale", "1 1 1")))
        if mesh is not None:
            return Shape("mesh", ZERO, xyz, rpy, mesh)
    return None


def _carry(links: dict[str, Link], element: ElementTree.Element) -> None:
    """Puts what a joint says into the link that it carries."""
    ends = {tag: found.attrib["link"] for tag in ("parent", "child") if (found := element.find(tag)) is not None}
    link = links[ends["child"]]
    link.parent = links[ends["parent"]].name
    link.joint, link.kind = element.get("name", ""), element.get("type", "fixed")
    link.xyz_m, link.rpy_rad = _origin(element)
    axis, mimic = element.find("axis"), element.find("mimic")
    if axis is not None:
        x, y, z = _vector(axis.get("xyz", "1 0 0"))
        length = math.hypot(x, y, z) or 1.0
        link.axis = (x / length, y / length, z / length)
    if mimic is not None:
        ratio, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
        link.mimic = Mimic(mimic.attrib["joint"], ratio, offset)


def _parents_first(links: dict[str, Link]) -> list[Link]:
    placed: dict[Union[str, None], Link] = {}
    waiting = list(links.values())
    while waiting:
        ready = [link for link in waiting if link.parent is None or link.parent in placed]
        if not ready:
            raise wrong("the robot's URDF cannot be drawn: its links form a circle", "check it with another viewer")
        placed.update({link.name: link for link in ready})
        waiting = [link for link in waiting if link.name not in placed]
    return list(placed.values())


def _origin(element: Union[ElementTree.Element, None]) -> tuple[Vector, Vector]:
    origin = None if element is None else element.find("origin")
    if origin is None:
        return ZERO, ZERO
    return _vector(origin.get("xyz", "0 0 0")), _vector(origin.get("rpy", "0 0 0"))


def _vector(text: Union[str, None]) -> Vector:
    x, y, z = (float(number) for number in (text or "").split())
    return x, y, z
