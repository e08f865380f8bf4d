"""Which joints make a tree, where a file says joints and no tree: some are turned where that needs it, others close loops."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ncgen.exchange.robots.robot import Joint


@dataclass
class _Forest:
    """above: {link: the joint that carries it}; member: {link: a name of its part}; parts: {name: its links}"""

    above: dict[str, Joint] = field(default_factory=dict)
    member: dict[str, str] = field(default_factory=dict)
    parts: dict[str, list[str]] = field(default_factory=dict)

    def take(self, joint: Joint) -> None:
        """Have a joint whose child nothing carries, and whose links no joints connect yet."""
        self.above[joint.child] = joint
        kept, gone = self.member[joint.parent], self.member[joint.child]
        for link in self.parts[gone]:
            self.member[link] = kept
        self.parts[kept] += self.parts.pop(gone)

    def way_up(self, link: str) -> list[Joint]:
        """Joints from a link to what carries all."""
        way = []
        while link in self.above:
            way.append(self.above[link])
            link = way[-1].parent
        return way

    def hang_by(self, link: str) -> None:
        """Have nothing carry a link: all joints above it are turned."""
        way = self.way_up(link)
        for joint in way:
            del self.above[joint.child]
        for joint in way:
            self.above[joint.parent] = joint.turned()


def spanned(links: Iterable[str], joints: Sequence[Joint], fixed: str) -> tuple[list[Joint], list[Joint]]:
    """The joints that make a tree of every connected part, in their order, and the others, which close loops.

    joints: with placements in the world; fixed: the link that no joint may carry
    The first joint of every link carries it. Where a part would hang on nothing, joints of it are turned, as few as can be.
    """
    forest = _Forest(member={link: link for link in links})
    forest.parts = {link: [link] for link in forest.member}
    waiting = []
    for joint in joints:
        apart = forest.member[joint.parent] != forest.member[joint.child]
        if apart and joint.child not in forest.above and joint.child != fixed:
            forest.take(joint)
        else:
            waiting.append(joint)
    closing = []
    for joint in waiting:
        if forest.member[joint.parent] == forest.member[joint.child]:
            closing.append(joint)
        else:
            forest.take(_hung(forest, joint, fixed))
    order = {joint.name: number for number, joint in enumerate(joints)}
    return sorted(forest.above.values(), key=lambda joint: order[joint.name]), closing


def _hung(forest: _Forest, joint: Joint, fixed: str) -> Joint:
    """A joint between two parts, itself or turned, whose child nothing carries any more."""
    ways = []
    for each in (joint.turned(), joint):
        if forest.member.get(fixed) != forest.member[each.child]:
            ways.append((len(forest.way_up(each.child)) + (each is not joint), each))
    _, best = min(ways, key=lambda way: way[0])
    forest.hang_by(best.child)
    return best
