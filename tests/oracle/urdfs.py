"""Robots of any make as URDF text, with what is true of them by construction. Nothing is imported from skillframe."""

import math
import random
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

COORDINATES = {"revolute": (1, 1), "prismatic": (1, 1), "continuous": (2, 1), "fixed": (0, 0), "floating": (7, 6)}
ODD_NAMES = ("säge", "tool 0", "link/1", "a.b", "L-1", "über", "1", "joint", "<x>", "&amp", "it's", "a,b", "x=y")
MESHES = ("package://nobody/meshes/a.stl", "package://x/meshes/l.dae", "meshes/none.obj", "file:///nowhere/x.stl")
JUNK = ("", "<transmission name='t'><type>x</type></transmission>", "<gazebo reference='l'/>", "<!-- Grüße -->")


@dataclass
class Robot:
    """One random robot.

    Attributes:
        text: URDF; nq, nv, mass: what its joints and inertias add up to; codes: of warnings that it must raise.
        massless: no link has an inertia; tips: last link of every arm.
    """

    seed: int
    nq: int = 0
    nv: int = 0
    mass: float = 0.0
    codes: set = field(default_factory=set)

    def __post_init__(self):
        self.random = random.Random(self.seed)
        self.scale = 10.0 ** self.random.uniform(-1.0, 0.7)
        self.massless = self.random.random() < 0.15
        self.template = self.random.random() < 0.15
        self.meshes = self.random.random() < 0.4
        self.strange = self.random.random() < 0.25
        self.without_effort = self.random.random() < 0.25
        arms = 2 if self.random.random() < 0.25 else 1
        self.names: list[str] = []
        self.names.append(self._name("link_"))
        self.tips = [self.names[0]] * arms
        self.leader: dict[int, tuple[str, str]] = {}
        self.parts = [self._link(self.names[0], moves=False)]
        floats = self.random.random() < 0.1
        for i in range(1, self.random.randint(2, 9) + 1):
            kinds = ("floating",) if floats and i == 1 else ("revolute", "prismatic", "continuous", "fixed")
            self._grow(i % arms, self.random.choices(kinds, (6, 2, 2, 1)[: len(kinds)])[0])
        if self.random.random() < 0.5:
            self.random.shuffle(self.parts)

    @property
    def text(self):
        inside = "\n".join([self.random.choice(JUNK), *self.parts])
        return f'<?xml version="1.0" encoding="utf-8"?>\n<robot name="{self.seed} ä">\n{inside}\n</robot>\n'

    def _name(self, stem):
        """A name that no link or joint has yet."""
        odd = self.strange and self.random.random() < 0.4
        return f"{self.random.choice(ODD_NAMES) if odd else ''}{stem}{len(self.names)}"

    def _link(self, name, moves=True):
        size, inside = self.scale * self.random.uniform(0.15, 0.5), ""
        if self.template and not self.massless:
            self.mass += 1.0
            inside = _inertial(1.0, [0.05 * self.scale**2] * 3, 0.0)
        elif not self.massless and (moves or self.random.random() < 0.5):
            mass = self.random.uniform(0.5, 5.0) * self.scale**3
            a, b, c = (size * self.random.uniform(0.3, 1.0) for _ in range(3))
            self.mass += mass
            inside = _inertial(mass, [mass / 12 * (p * p + q * q) for p, q in ((b, c), (a, c), (a, b))], size / 2)
        if self.meshes:
            self.codes.add("missing_mesh")
            shape = f'<geometry><mesh filename="{self.random.choice(MESHES)}" scale="0.001 0.001 0.001"/></geometry>'
            inside += f"<visual>{shape}</visual><collision>{shape}</collision>"
        elif self.random.random() < 0.5:
            inside += f'<collision><geometry><box size="{size} {size / 3} {size / 3}"/></geometry></collision>'
        return f"<link name={quoteattr(name)}>{inside}</link>"

    def _grow(self, arm, kind):
        """One more link at the end of an arm."""
        parent, child, name = self.tips[arm], self._name("link_"), self._name("j_")
        self.names.append(child)
        self.tips[arm] = child
        follows = self.leader.get(arm, ("", ""))[1] == kind and self.random.random() < 0.25
        inside = self._limit(kind) + self._mimic(arm, name, kind, follows)
        if follows:
            self.codes.add("mimic")
        else:
            self.nq, self.nv = self.nq + COORDINATES[kind][0], self.nv + COORDINATES[kind][1]
        if kind == "continuous":
            self.codes.add("continuous")
        axis = [self.random.gauss(0.0, 1.0) for _ in range(3)]
        inside += f'<axis xyz="{" ".join(repr(v / math.hypot(*axis)) for v in axis)}"/>' if self._limited(kind) else ""
        place = f"{self.scale * self.random.uniform(-0.05, 0.05)} 0 {self.scale * self.random.uniform(0.1, 0.5)}"
        turn = f"{self.random.uniform(-3, 3)} 0 {self.random.uniform(-3, 3)}"
        ends = f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>"
        self.parts.append(self._link(child))
        self.parts.append(
            f'<joint name={quoteattr(name)} type="{kind}"><origin xyz="{place}" rpy="{turn}"/>{ends}{inside}</joint>'
        )

    def _limited(self, kind):
        return kind not in ("fixed", "floating")

    def _limit(self, kind):
        if kind not in ("revolute", "prismatic"):
            return ""
        if self.without_effort:
            self.codes.add("no_effort_limits")
        effort = "" if self.without_effort else f'effort="{self.random.uniform(10, 300)}"'
        return (
            f'<limit lower="{self.random.uniform(-3, 0)}" upper="{self.random.uniform(0.1, 3)}" {effort} velocity="2"/>'
        )

    def _mimic(self, arm, name, kind, follows):
        """A follower's leader is a joint nearer to the base in the same arm, so that any library can let it follow."""
        if follows:
            return f'<mimic joint={quoteattr(self.leader[arm][0])} multiplier="{self.random.choice([1, -1, 0.5])}"/>'
        if kind in ("revolute", "prismatic"):
            self.leader[arm] = (name, kind)
        return ""


def _inertial(mass, moments, height):
    xx, yy, zz = moments
    return (
        f'<inertial><origin xyz="0 0 {height}" rpy="0.7 0.2 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
