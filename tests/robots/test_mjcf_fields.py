"""Everything in MJCF is modelled, refused, or listed: the tables name all fields, options and flags of the MuJoCo that is installed."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.robots import mjcf_fields
from ncgen.exchange.robots.mjcf_fields import meaning, touching, unlisted

mujoco = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

ROBOT = """<mujoco>{before}<worldbody>{world}<body name="a"><joint name="q" axis="0 1 0" {q}/>
<inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/>{a}</body></worldbody>{after}</mujoco>"""


def loaded(path, **said):
    path.write_text(ROBOT.format(**{name: said.get(name, "") for name in ("before", "world", "q", "a", "after")}))
    return ncgen.load(path)


def held(owner):
    """Names of what an object of MuJoCo holds, but its functions."""
    return [name for name in dir(owner) if not name.startswith("_") and not callable(getattr(owner, name))]


def test_every_field_has_one_meaning():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    patterns = mjcf_fields._patterns()
    for table, names in (("fields", held(model)), ("options", held(model.opt))):
        assert len(names) > 25
        for name in names:
            found = [what for what, pattern in patterns[table].items() if pattern.fullmatch(name)]
            assert len(found) == 1, f"{name}: {found}"


def test_every_flag_has_a_meaning():
    for table, enum, prefix in (("disabled", mujoco.mjtDisableBit, "mjDSBL_"), ("enabled", mujoco.mjtEnableBit, "mjENBL_")):
        flags = {name.removeprefix(prefix): int(value) for name, value in enum.__members__.items() if name.startswith(prefix)}
        assert len(flags) >= 8 and all(meaning(name, table) for name in flags), flags
        known = mjcf_fields.KNOWN_BITS[table == "enabled"]
        assert sum(flags.values()) == known


def test_numbers_are_mujocos():
    bits = mujoco.mjtDisableBit
    for name, flag in (
        ("NO_CONSTRAINTS", bits.mjDSBL_CONSTRAINT), ("NO_EQUALITIES", bits.mjDSBL_EQUALITY), ("NO_FRICTION", bits.mjDSBL_FRICTIONLOSS),
        ("NO_LIMITS", bits.mjDSBL_LIMIT), ("NO_CONTACTS", bits.mjDSBL_CONTACT), ("NO_SPRINGS", bits.mjDSBL_SPRING),
        ("NO_DAMPERS", bits.mjDSBL_DAMPER), ("NO_GRAVITY", bits.mjDSBL_GRAVITY), ("NO_ACTUATION", bits.mjDSBL_ACTUATION),
        ("KEEP_PARENTS", bits.mjDSBL_FILTERPARENT),
    ):  # fmt: skip
        assert getattr(mjcf_fields, name) == int(flag)
    assert mjcf_fields.OVER_JOINT == int(mujoco.mjtWrap.mjWRAP_JOINT)


def test_fields_of_a_later_mujoco_are_listed(monkeypatch):
    """A field that no table names, where it holds anything."""
    model = mujoco.MjModel.from_xml_string(ROBOT.format(before="", world="", q='damping="1"', a="", after=""))
    assert list(unlisted(model)) == []
    shorter = {what: names.replace("dof_damping ", "").replace("jnt_stiffness ", "") for what, names in mjcf_fields.FIELDS.items()}
    monkeypatch.setattr(mjcf_fields, "FIELDS", shorter)
    mjcf_fields._patterns.cache_clear()
    try:
        assert list(unlisted(model)) == ["fields dof_damping of MuJoCo, not known here"]
    finally:
        mjcf_fields._patterns.cache_clear()


FLEX = """<flexcomp name="rope" type="grid" count="3 1 1" spacing=".1 .1 .1" dim="1" pos="0 0 2"><edge equality="true"/></flexcomp>"""
SPATIAL = '<tendon><spatial name="t"><site site="s"/><site site="o"/></spatial></tendon>'

LISTED = {
    "collision shapes (2)": {"world": '<geom size="1"/>', "a": '<geom size="1" mass="0"/>'},
    "contact pairs (1)": {
        "world": '<geom name="g" size="1" contype="0" conaffinity="0"/>',
        "a": '<geom name="h" size="1" mass="0" contype="0" conaffinity="0"/>',
        "after": '<contact><pair geom1="g" geom2="h"/></contact>',
    },
    "excluded contacts (1)": {"after": '<contact><exclude body1="a" body2="world"/></contact>'},
    "flexible bodies (1)": {"world": FLEX},
    "tendons (1)": {"world": '<site name="o" pos="1 0 0"/>', "a": '<site name="s"/>', "after": SPATIAL},
    "springs that yield (1)": {"q": 'stiffness="1" springyield="0.1"'},
    "sensors (1)": {"after": '<sensor><jointpos joint="q"/></sensor>'},
    "actuators (1)": {"after": '<actuator><motor joint="q"/></actuator>'},
    "forces of a fluid (1)": {"before": '<option density="1.2"/>'},
    "bodies moved by motion capture, which rest here (1)": {"world": '<body name="m" mocap="true"/>'},
    "limits of joints (1)": {"q": 'range="-1 1" limited="true"'},
    "friction of joints (1)": {"q": 'frictionloss="1"'},
    "armature of free bodies and of balls between moving ones (2)": {
        "a": '<body><joint type="ball" armature="0.1"/><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body>'
        '<body><joint name="b" type="ball"/><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body>',
        "after": '<actuator><motor joint="b" armature="0.1"/></actuator>',
    },
    "motors of joints whose forces are bounded away from 0 (1)": {
        "q": 'actuatorfrcrange="0.2 1"',
        "after": '<actuator><motor joint="q"/></actuator>',
    },
    "dampers and armatures of actuators over tendons (2)": {
        "after": '<tendon><fixed name="t"><joint joint="q" coef="2"/></fixed></tendon><actuator><motor tendon="t" damping="1"/>'
        '<motor tendon="t" armature="1"/><motor tendon="t"/></actuator>',
    },
    "compensation of weight by motors that have limits, or are switched off (1)": {
        "q": 'actuatorgravcomp="true" actuatorfrcrange="-1 1"',
        "a": '<body gravcomp="1"><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body>',
    },
}
"""{what is listed: the parts of a file that say it}."""


@pytest.mark.parametrize("words", LISTED)
def test_what_is_left_out_is_listed(words, tmp_path):
    assert words in loaded(tmp_path / "r.xml", **LISTED[words]).left_out


@pytest.mark.parametrize("flag, words", [("contact", "collision shapes (2)"), ("limit", "limits of joints (1)"),
    ("frictionloss", "friction of joints (1)"), ("actuation", "actuators (1)"), ("constraint", "limits of joints (1)")])  # fmt: skip
def test_what_is_switched_off_is_not_listed(flag, words, tmp_path):
    before = f'<option><flag {flag}="disable"/></option>'
    assert loaded(tmp_path / "r.xml", **{**LISTED[words], "before": before}).left_out == ()


def test_shapes_that_never_touch_are_not_listed(tmp_path):
    """By MuJoCo's own broad phase: masks, bodies that are one, and neighbours."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        masks = [f'contype="{rng.integers(4)}" conaffinity="{rng.integers(4)}"' for _ in range(4)]
        world, *others = (f'<geom size="9" mass="0" {mask}/>' for mask in masks)
        joint = '<joint axis="0 1 0"/>' if rng.integers(2) else ""
        inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        bodies = (
            f'<body><joint axis="1 0 0"/>{inertial}{others[0]}<body>{joint}{inertial}{others[1]}'
            f'<body pos="0.1 0 0"><joint axis="1 1 0"/>{inertial}{others[2]}</body></body></body>'
        )
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{world}{bodies}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert touching(model) == len({int(g) for contact in data.contact for g in contact.geom})


RICH = """<mujoco><option density="1.2" wind="1 0 0"/><worldbody><geom name="floor" type="plane" size="2 2 0.1"/>
<site name="o" pos="1 0 0"/><body name="a" pos="0 0 0.5">
<joint name="q" axis="0 1 0" stiffness="1" damping="0.1" range="-1 1" limited="true" frictionloss="0.1"/><geom name="g" size="0.1"/>
<site name="s" pos="0.1 0 0"/><body name="b" pos="0.3 0 0" gravcomp="0.5"><joint name="ball" type="ball"/>
<geom type="box" size="0.1 0.05 0.02"/></body></body>
<body name="f" pos="0 1 1"><freejoint/><geom type="capsule" size="0.05 0.1"/></body></worldbody>
<tendon><fixed name="t"><joint joint="q" coef="2"/></fixed>
<spatial name="p" stiffness="3"><site site="o"/><site site="s"/></spatial></tendon>
<equality><joint joint1="q" active="false"/></equality>
<actuator><motor name="m" joint="q"/><position name="n" tendon="t" kp="2"/><general joint="q" dyntype="filter" dynprm="0.1"/></actuator>
<sensor><gyro site="s"/></sensor><keyframe><key/></keyframe></mujoco>"""


WORDS = {"tendon_": "tendons", "geom_fluid": "forces of a fluid", "wind": "forces of a fluid", "density": "forces of a fluid",
         "viscosity": "forces of a fluid", "actuator_": "actuators"}  # fmt: skip
"""{how fields begin: the words for them, which the file above has}."""


def test_what_is_called_without_effect_has_none():
    """Numbers of each field that is not modelled: where others change MuJoCo's accelerations, they change what is listed, too.

    Contacts, limits and friction are off in both, as what is listed says.
    """
    rng, flags = np.random.default_rng(6), mujoco.mjtDisableBit
    base = mujoco.MjModel.from_xml_string(RICH)
    qvel, changed = rng.normal(size=base.nv), set()

    def accelerations(model):
        model.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS
        data = mujoco.MjData(model)
        data.qvel, data.ctrl = qvel, 0.3
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    listed, expected, tried = mjcf_fields.left_out(base), accelerations(mujoco.MjModel.from_xml_string(RICH)), 0
    for table, names in (("fields", held(base)), ("options", held(base.opt))):
        for name in names:
            model = mujoco.MjModel.from_xml_string(RICH)
            values = getattr(model if table == "fields" else model.opt, name)
            kind = meaning(name, table)
            if kind in ("modelled", "derived") or not isinstance(values, np.ndarray) or values.dtype.kind != "f" or not values.size:
                continue
            values[:] = rng.uniform(0.5, 1.5, values.shape)
            tried += 1
            if not np.allclose(accelerations(model), expected, rtol=0, atol=1e-12):
                assert kind == "listed", f"{name} changes accelerations"
                changed.add(name)
                words = next((words for begins, words in WORDS.items() if name.startswith(begins)), None)
                assert words in listed or mjcf_fields.left_out(model) != listed, f"{name} is not listed"
    assert tried > 45 and {"tendon_damping", "geom_fluid", "wind"} <= changed
