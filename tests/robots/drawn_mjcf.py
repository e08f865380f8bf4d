"""Files of MJCF made by setting words of MuJoCo's own schema, one to four in a file.

Words are set one after the other, with texts of the kinds that they have; one that MuJoCo does not take is drawn again.
"""

from __future__ import annotations

import copy
import random
import re
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

MOST_WORDS, ATTEMPTS, FAILURES = 4, 6, 3
"""Words of a file, texts that are tried for one, and how often none of them may be taken until a word is not drawn again."""

SECTIONS = {"body": 14, "actuator": 5, "equality": 5, "tendon": 3, "default": 3, "option": 2, "compiler": 2, "keyframe": 2, "sensor": 2}
"""How often words of a part of a file are drawn, more than 1: those that change the motion."""

ROBOT = """<mujoco model="r"><compiler/><option gravity="0 1 -9"><flag/></option><size/><statistic/>{before}<default><joint/><geom {geom}/>
<default class="other"><joint damping="0.2"/></default></default>
<asset><mesh name="tetra" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/><material name="red" rgba="1 0 0 1"/></asset>
<worldbody><geom name="floor" type="plane" size="9 9 1" pos="0 0 -3"/><site name="so" pos="0 0 2"/><camera name="view" pos="0 -3 1"/>
<body name="a" pos="0 0 1"><joint name="ja" axis="0 1 0.2" damping="0.1"/><geom name="ga" type="box" size="0.1 0.2 0.3" pos="0.1 0 0"/>
<site name="sa" pos="0.3 0 0"/>{inside}</body>{outside}</worldbody>
<contact/><tendon><fixed name="t"><joint joint="ja" coef="1"/></fixed>{tendon}</tendon><equality/>
<actuator><motor name="m" joint="ja" gear="2"/>{actuator}</actuator>
<sensor><jointpos joint="ja"/><gyro site="sa"/></sensor><keyframe><key name="k"/></keyframe><custom/></mujoco>"""

TREES = (
    {
        "inside": """<body name="b" pos="0.8 0 0"><joint name="jb" type="slide" axis="1 0 0" stiffness="3"/>
<joint name="jz" pos="0 0.1 0" axis="0 0 1"/><geom name="gb" type="sphere" size="0.1"/><site name="sb" pos="0 0.1 0" euler="0 30 0"/></body>
<body name="w" pos="0 0.5 0" euler="0 0 40"><geom name="gw" type="capsule" size="0.05 0.2" mass="0.3"/></body>""",
        "outside": "",
    },
    {
        "inside": """<body name="c" pos="0.8 0 0.1"><joint name="jc" type="ball"/><site name="sc"/>
<inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.2 0.15"/></body>""",
        "outside": "",
    },
    {
        "inside": "",
        "outside": """<body name="d" pos="5 5 5"><freejoint name="jd"/><geom name="gd" type="capsule" size="0.1 0.3" euler="30 0 0"/>
<site name="sd" pos="0 0 0.1"/></body>""",
    },
)
"""A hinge that carries two joints of one body, a ball, or nothing beside a free body."""

PLAIN = {"before": "", "geom": 'contype="0" conaffinity="0"', "tendon": "", "actuator": ""}
FULL = {
    "before": '<option density="1.2" wind="1 0 0"/>',
    "geom": "",
    "tendon": '<spatial name="u" stiffness="4"><site site="so"/><site site="sa"/></spatial>',
    "actuator": '<general name="slow" joint="ja" dyntype="filter" dynprm="0.1"/>',
}
"""Files of which nothing is left out, and those with contacts, a fluid, a tendon and an actuator with a state."""

TOOL = (
    """<mujoco><worldbody><body name="tool" pos="0 0 0.2"><joint name="turn" axis="1 0 0"/><geom size="0.1"/></body></worldbody></mujoco>"""
)
"""A file that the others may attach."""

BASES = [ROBOT.format(**tree, **more) for tree in TREES for more in (PLAIN, FULL)]

TEXTS = """
joint@type: free ball slide hinge
geom@type: sphere capsule ellipsoid cylinder box plane mesh
site@type: sphere capsule ellipsoid cylinder box
flexcomp@type: grid box cylinder ellipsoid disc square
texture@type: 2d cube skybox
light@type: spot directional point
builtin: none gradient checker flat
mesh@builtin: sphere hemisphere cone
mesh@inertia: convex exact legacy shell
angle: radian degree
coordinate: local
eulerseq: xyz XYZ zyx ZXZ xYz
conflict: error warning merge
inertiafromgeom limited actuatorfrclimited ctrllimited forcelimited actlimited: true false auto
autolimits alignfree align balanceinertia discardvisual fitaabb fusestatic saveinertial strippath usethread active: true false
actuatorgravcomp fitscale shellinertia castshadow mocap actearly savecompiled savecanonical useexisting uselimit: true false
flatskin rigid: true false
simple fuse passive passthrough selfcollide: true false auto 0 1 none
sleep: auto never allowed init
inheritrange: 0 1
mode: fixed track trackcom targetbody none muscle all
integrator: Euler RK4 implicit implicitfast
cone: pyramidal elliptic
jacobian: dense sparse auto
solver: PGS CG Newton
option@gravity wind magnetic: #3
dyntype: none integrator filter filterexact muscle
gaintype: fixed affine muscle
biastype: none affine muscle
interp: zoh linear cubic
input controller: voltage position velocity none 0 1
projection: perspective orthographic
fluidshape: none ellipsoid
datatype: real positive axis quaternion
needstage: pos vel acc
data: found force torque dist pos normal tangent
reduce: none mindist maxforce netforce
contype conaffinity condim priority group nsample actdim dim num numquads cellcount nuser_actuator nuser_body nuser_cam: %1
nuser_geom nuser_jnt nuser_sensor nuser_site nuser_tendon nuserdata nkey disableactuator actuatorgroupdisable: %1
condim: 1 3 4 6
replicate@count: 2 3
count: 2_2_1 3_1_1 2_2_2
spacing: +3
iterations ls_iterations noslip_iterations ccd_iterations sdf_iterations sdf_initpoints: 1 5 50
memory: 1M
pos axis xyz anchor center diffuse ambient specular dir surfacevel offset refpos: #3
size diaginertia scale: +3
quat refquat: #4
axisangle: #4
euler: #3
xyaxes: #6
zaxis: #3
fromto: #6
fullinertia: 1_1.1_1.2_0.1_0.05_-0.1 0.5_0.6_0.7_0_0_0.01
range ctrlrange forcerange actrange actuatorfrcrange lengthrange posrange velrange ffrange: <2
tolrange: +1
inertiagrouprange: 0_3 0_0 1_5
springlength: <2
stiffness damping: #1 +1 +2 +3
mass density viscosity armature frictionloss gravcomp springyield margin gap kp ki kv dampratio boundmass boundinertia: +1 #1
radius delay timeconst divisor coef ref springref cranklength cutoff noise extent meaninertia meanmass meansize adhesion: +1 #1
solmix kp gain diameter interval impratio timestep: +1 #1
settotalmass: +1
springdamper: +2
polycoef: #1 #2 #5
relpose: 0.1_0_0.2_1_0_0_0 0_0_0_1_0.2_0_0.1
solref solreflimit solreffriction o_solref: 0.05_1 -100_-10 0.02_0.7
solimp solimplimit solimpfriction o_solimp: 0.8_0.9_0.01 0.9_0.95_0.002_0.5_2
friction o_friction: +1 +3
rgba: 1_0_0_1 0_0_0_0
gear: #1 #2 #6
gainprm biasprm dynprm: #1 #2 #3
fluidcoef: +5
user: #1 #3
qpos: #14
qvel: #13
ctrl: #2
time: +1
mpos: #3
act: #1
vertex: 0_0_0_2_0_0_0_1_0_0_0_1
file: none.stl
"""
"""Words, with the element before `@` if that matters, and texts for them: #3 three numbers, +3 positive ones, <2 ascending ones, %1 an
integer, others as they are, with _ for a blank."""

COMPANIONS = {
    "body": '<body><geom size="0.1"/></body>',
    "inertial": '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
    "geom": '<geom size="0.1 0.2 0.15"/>',
    "joint": "<joint/>",
    "frame": "<frame/>",
    "replicate": '<replicate count="2" offset="0 0.3 0"><site/></replicate>',
    "flexcomp": '<flexcomp name="rope" type="grid" count="3 1 1" spacing=".1 .1 .1" dim="1" pos="0 0 3"/>',
    "pair": '<pair geom1="ga" geom2="floor"/>',
    "exclude": '<exclude body1="a" body2="world"/>',
    "tendon/spatial": '<spatial><site site="sa"/><site site="so"/></spatial>',
    "tendon/fixed": '<fixed><joint joint="ja" coef="-1"/></fixed>',
    "fixed/joint": '<joint joint="ja" coef="0.5"/>',
    "spatial/site": '<site site="so"/>',
    "spatial/geom": '<geom geom="ga"/>',
    "spatial/pulley": '<pulley divisor="2"/>',
    "connect": '<connect body1="a" body2="world" anchor="0 0 0"/>',
    "weld": '<weld body1="a" body2="world" active="false"/>',
    "equality/joint": '<joint joint1="ja"/>',
    "equality/tendon": '<tendon tendon1="t"/>',
    "asset/model": '<model name="x" file="tool.xml"/>',
    "attach": '<attach model="x" body="tool" prefix="x"/>',
    "texture": '<texture name="tex" type="2d" builtin="flat" width="4" height="4"/>',
    "hfield": '<hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/>',
    "numeric": '<numeric name="n" data="1"/>',
    "adhesion": '<adhesion body="a" ctrlrange="0 1"/>',
    "muscle": '<muscle joint="ja" lengthrange="0.1 1"/>',
    "damper": '<damper joint="ja" kv="2" ctrlrange="0 1"/>',
    "dcmotor": '<dcmotor joint="ja" motorconst="0.5" resistance="2"/>',
    "bone": '<bone body="a" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0" vertweight="1"/>',
    "camprojection": '<camprojection site="sa" camera="view"/>',
    "insidesite": '<insidesite site="so" objtype="site" objname="sa"/>',
    "user": '<user dim="2"/>',
    "distance": '<distance geom1="ga" geom2="floor"/>',
    "key": "<key/>",
}  # fmt: skip
"""What a new element begins with; of actuators and sensors by what they are about."""

NAMED = {
    "joint": "joint joint1 joint2 jointinparent", "body": "body body1 body2 target subtree1 subtree2",
    "site": "site site1 site2 refsite cranksite slidersite sidesite objname refname", "geom": "geom geom1 geom2",
    "fixed": "tendon tendon1 tendon2",
    "motor": "actuator", "mesh": "mesh", "material": "material", "camera": "camera", "default": "class childclass",
}  # fmt: skip
"""{element: words that name one}."""

RELATED = {
    "delay": {"nsample": "4"}, "interval": {"nsample": "4"}, "interp": {"nsample": "4"}, "actrange": {"dyntype": "integrator"},
    "dynprm": {"dyntype": "filter"}, "gainprm": {"gaintype": "affine"}, "biasprm": {"biastype": "affine"},
    "springdamper": {"armature": "0.2"},
    "timeconst": {"kp": "2"}, "cranksite": {"slidersite": "so", "cranklength": "3"}, "slidersite": {"cranksite": "sa", "cranklength": "3"},
    "refsite": {"site": "sa", "gear": "1 0 0 0.2 0 0"}, "site1": {"site2": "so"}, "site2": {"site1": "sa"}, "refname": {"reftype": "site"},
    "fluidcoef": {"fluidshape": "ellipsoid"}, "forcerange": {"forcelimited": "true"}, "ctrlrange": {"ctrllimited": "true"},
    "actuatorfrcrange": {"actuatorfrclimited": "true"}, "range": {"limited": "true"}, "fromto": {"size": "0.1"},
}  # fmt: skip
"""Words that another one says nothing without; set half of the times along with it."""

TARGETS = {
    "actuator": ['joint="ja"', 'joint="{joint}"', 'tendon="t"', 'site="sa"'],
    "sensor": ['site="sa"', 'joint="{joint}"', 'tendon="t"', 'actuator="m"', 'objtype="site" objname="sa"', 'body="a"', ""],
}

REPEATED = re.compile(r"actuator|sensor|tendon|equality|contact|body|keyframe|asset|frame|replicate")
"""Parents of elements that a file may have several of."""


def words_of_mjcf() -> list[tuple[list[str], str]]:
    """(tags from the root on, attribute) of MuJoCo's schema, which is printed as a tree of elements with their attributes."""
    import mujoco

    found, stack = [], list[tuple[int, str]]()
    for line in mujoco.mj_printSchema(False, False).splitlines():
        match = re.match(r"(\s*)([\w()]+) \(([!?*R]+)\)\s*(.*)", line)
        if match:
            depth = len(match[1])
            stack = [each for each in stack if each[0] < depth] + [(depth, match[2].replace("(world)", ""))]
        names = match[4] if match else line
        found += [([tag for _, tag in stack[1:]], name) for name in names.split() if name.isidentifier()]
    poses = ("pos", "quat", "euler", "axisangle", "childclass")
    found += [(["body", "frame"], name) for name in poses] + [(["body", "replicate"], name) for name in ("count", "offset", "euler")]
    return [(tags, name) for tags, name in found if tags and tags[0] not in ("visual", "extension") and "plugin" not in tags]


def _names(tree: ET.Element, name: str) -> list[str]:
    """Names that a word may have as its text."""
    key = lambda each: each.get("class" if each.tag == "default" else "name", "main")  # noqa: E731
    return [key(each) for tag, words in NAMED.items() if name in words.split() for each in tree.iter(tag)] + ["world"] * ("body" in name)


def _texts() -> dict[str, list[str]]:
    found = dict[str, list[str]]()
    for line in TEXTS.strip().splitlines():
        names, _, texts = line.partition(": ")
        for name in names.split():
            found.setdefault(name, texts.split())
    return found


class Draws:
    """Files that MuJoCo takes, drawn at random."""

    def __init__(self, seed: int, counts: Counter[str], path: Path) -> None:
        """path: where files are written to, the last one among them"""
        import mujoco

        mujoco.set_mju_user_warning(lambda text: None)
        (path.parent / "tool.xml").write_text(TOOL, encoding="utf-8")
        self.mujoco, self.rng, self.counts, self.path = mujoco, random.Random(seed), counts, path
        self.words, self.texts = words_of_mjcf(), _texts()
        self.bases = [ET.fromstring(base) for base in BASES]
        self.inside: dict[tuple[str, ...], list[str]] = {}
        for tags, name in self.words:
            self.inside.setdefault(tuple(tags), []).append(name)
        self.sections: dict[str, list[tuple[str, ...]]] = {}
        for each in self.inside:
            self.sections.setdefault(each[0], []).append(each)
        self.failures = Counter[str]()

    def file(self) -> tuple[int, ET.Element, list[str]]:
        """The number of the file that it is made from, a file, and its words, one to four."""
        while True:
            which = self.rng.randrange(len(self.bases))
            tree, said = copy.deepcopy(self.bases[which]), list[str]()
            wanted, element, tags = self.rng.randint(1, MOST_WORDS), None, list[str]()
            for _ in range(3 * MOST_WORDS):
                if element is None or self.rng.random() < 0.5:
                    (section,) = self.rng.choices([*self.sections], [SECTIONS.get(section, 1) for section in self.sections])
                    tags, element = list(self.rng.choice(self.sections[section])), None
                name = self.rng.choice(self.inside[tuple(tags)])
                word = f"{'/'.join(tags)}@{name}"
                done = self._set(tree, element, tags, name) if self.failures[word] < FAILURES else None
                self.failures[word] += done is None and element is None
                if done is None:
                    continue
                tree, element, text = done
                said.append(f"{word}={text}")
                if len(said) == wanted:
                    break
            if said:
                return which, tree, said

    def _set(self, tree: ET.Element, element: int | None, tags: list[str], name: str) -> tuple[ET.Element, int, str] | None:
        """The file with one word more, that MuJoCo takes, the number of the element that has it, and its text.

        element: number of the one that is to have it, None for one of these tags, or a new one
        """
        seed = self.rng.random()
        for _ in range(ATTEMPTS):
            new, rng = copy.deepcopy(tree), random.Random(seed)
            every = list(new.iter())
            own = self._element(new, tags, rng if self.rng.random() < 0.5 else self.rng) if element is None else every[element]
            if own is None or (element is not None and name in own.keys()):
                return None
            text = self._text(new, tags[-1], name)
            own.set(name, text)
            if self.rng.random() < 0.5:
                for other, value in RELATED.get(name, {}).items():
                    if other in self.inside[tuple(tags)] and other not in own.keys():
                        own.set(other, value)
            if self.takes(new):
                return new, list(new.iter()).index(own), text
        return None

    def takes(self, tree: ET.Element) -> bool:
        """Whether MuJoCo reads a file."""
        self.counts["compiled by MuJoCo"] += 1
        try:
            self.path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
            self.mujoco.MjModel.from_xml_path(str(self.path))
        except (ValueError, RuntimeError, self.mujoco.FatalError):
            self.counts["refused by MuJoCo and drawn again"] += 1
            return False
        return True

    def _element(self, tree: ET.Element, tags: list[str], rng: random.Random) -> ET.Element | None:
        """One of the file's elements with such tags, or a new one."""
        where = f".//{'/'.join(tags)}" if tags[0] == "body" else "./" + "/".join(tags)
        places = tree.findall(where)
        if places and not (len(tags) > 1 and REPEATED.fullmatch(tags[-2]) and rng.random() < 0.5):
            return rng.choice(places)
        parent = tree if len(tags) == 1 else self._element(tree, tags[:-1], rng)
        if tags == ["body"]:
            parent = rng.choice([*tree.findall(".//body"), tree.find("worldbody")])
        assert parent is not None
        if tags[-1] == "attach" and tree.find("asset/model") is None:
            tree.append(ET.fromstring(f"<asset>{COMPANIONS['asset/model']}</asset>"))
        own = self._new(tree, tags, rng)
        parent.append(own)
        return own

    def _new(self, tree: ET.Element, tags: list[str], rng: random.Random) -> ET.Element:
        key = "/".join(tags[-2:])
        text = COMPANIONS.get(key) or COMPANIONS.get(tags[-1], "") if tags[0] not in ("default", "actuator") else ""
        if (
            tags[0] in ("actuator", "sensor", "equality")
            and not text
            or tags[-1] in ("adhesion", "muscle", "damper", "dcmotor")
            and tags[0] == "actuator"
        ):
            text = COMPANIONS.get(tags[-1]) or f"<{tags[-1]} {rng.choice(TARGETS.get(tags[0], ['']))}/>"
            text = text.format(joint=rng.choice(_names(tree, "joint")))
        return ET.fromstring(text or f"<{tags[-1]}/>")

    def _text(self, tree: ET.Element, tag: str, name: str) -> str:
        rng = self.rng
        if tag == "flag":
            return rng.choice(["disable", "enable"])
        text = rng.choice(
            _names(tree, name) or self.texts.get(f"{tag}@{name}") or self.texts.get(name) or ["#1", "+1", "+2", "#3", "+4", "%1", "other"]
        )
        if text[0] not in "#+<%" or len(text) < 2 or not text[1:].isdecimal():
            return text.replace("_", " ")
        count = int(text[1:])
        if text[0] == "%":
            return " ".join(str(rng.randint(0, 4)) for _ in range(count))
        numbers = [round(rng.uniform(-1.5 if text[0] in "#<" else 0.05, 1.5), 3) for _ in range(count)]
        return " ".join(map(str, sorted(numbers) if text[0] == "<" else numbers))
