"""What every field, option and flag of MuJoCo's compiled model means here, so that nothing of a file is passed over in silence.

A field is modelled, only looks, belongs to MuJoCo's own method, is derived from others, is data without an effect on motion, or is listed:
counted in `model.left_out` where it is not at its default. A test walks the fields of the MuJoCo that is installed; those of a later one,
which stand in no table here, are listed by name where they hold anything.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

import numpy as np

from ncgen.exchange.robots.mjcf_compiled import Compiled
from ncgen.exchange.robots.motors import AWAY_FROM_ZERO

FIELDS = {
    "modelled": """
        opt qpos0 qpos_spring body_parentid body_weldid body_jntnum body_jntadr body_pos body_quat body_ipos body_iquat body_mass
        body_inertia jnt_type jnt_qposadr jnt_dofadr jnt_bodyid jnt_actuatorid jnt_limited jnt_pos jnt_axis jnt_stiffness jnt_stiffnesspoly
        jnt_range site_bodyid site_pos site_quat body_gravcomp
        dof_jntid dof_frictionloss dof_armature dof_damping dof_dampingpoly
        eq_type eq_obj1id eq_obj2id eq_objtype eq_active0 eq_data tendon_type tendon_adr tendon_num wrap_type wrap_objid wrap_prm
        actuator_trntype actuator_trnid actuator_gear actuator_outadr actuator_damping actuator_dampingpoly actuator_armature
        actuator_gaintype actuator_biastype actuator_gainprm actuator_biasprm actuator_ctrladr actuator_ctrllimited actuator_ctrlrange
        actuator_forcelimited actuator_forcerange jnt_actfrclimited jnt_actfrcrange key_ctrl
        sensor_type sensor_objtype sensor_objid sensor_cutoff key_time key_qpos key_qvel""",
    "looks": """
        geom_type geom_bodyid geom_dataid geom_matid geom_group geom_castshadow geom_size geom_pos geom_quat geom_rgba
        site_type site_dataid site_matid site_group site_size site_rgba jnt_group actuator_group tendon_matid tendon_group tendon_width
        tendon_rgba cam_* light_* mat_* tex_* skin_* vis mesh_*""",
    "method": """
        jnt_solref jnt_solimp jnt_margin dof_solref dof_solimp tree_sleep_policy tendon_solref_* tendon_solimp_* tendon_margin""",
    "derived": """
        n# nuser_* nnames_map name_* names names_map paths signature stat bvh_* oct_* B_* M_* D_* mapM2M mapM2D mapD2M efm* flg_*
        body_rootid body_dofnum body_dofadr body_treeid body_geomnum body_geomadr body_simple body_sameframe body_subtreemass
        body_invweight0
        body_margin body_contype body_conaffinity body_bvhadr body_bvhnum dof_bodyid dof_parentid dof_treeid dof_Madr dof_simplenum
        dof_invweight0 dof_M0 dof_length jnt_plasticadr tree_bodyadr tree_bodynum tree_dofadr tree_dofnum geom_sameframe geom_aabb
        geom_rbound site_sameframe tendon_actuatorid tendon_plasticadr tendon_treenum tendon_treeid tendon_length0 tendon_invweight0 ten_J_*
        actuator_acc0 actuator_length0 actuator_lengthrange""",
    "data": "body_user jnt_user geom_user site_user tendon_user actuator_user numeric_* text_* tuple_*",
    "listed": """
        body_mocapid body_plugin jnt_springyield jnt_actgravcomp
        geom_contype geom_conaffinity geom_condim geom_priority geom_plugin geom_solmix geom_solref geom_solimp geom_friction geom_margin
        geom_gap geom_surfacevel geom_adhesion geom_fluid flex_* flexedge_* hfield_* pair_* exclude_signature
        eq_solref eq_solimp tendon_limited tendon_actfrclimited tendon_range tendon_actfrcrange tendon_stiffness tendon_stiffnesspoly
        tendon_damping tendon_dampingpoly tendon_armature tendon_frictionloss tendon_lengthspring tendon_springyield
        actuator_dyntype actuator_ctrlnum actuator_ctrlspec actuator_outnum actuator_act* actuator_cranklength actuator_dynprm
        actuator_history* actuator_delay actuator_plugin
        sensor_(?!type|objtype|objid|cutoff)* plugin plugin_* key_act key_mpos key_mquat key_plastic""",
}
"""{meaning: names of fields; * stands for anything, # for letters and digits}."""

OPTIONS = {
    "modelled": "gravity magnetic disableflags",
    "method": """
        timestep impratio tolerance ls_tolerance noslip_tolerance ccd_tolerance sleep_tolerance integrator cone jacobian solver iterations
        ls_iterations noslip_iterations ccd_iterations sdf_initpoints sdf_iterations""",
    "listed": "wind density viscosity o_margin o_solref o_solimp o_friction enableflags disableactuator",
}
"""The same of MuJoCo's options: wind acts only with a fluid, what begins with o_ on contacts."""

NO_CONSTRAINTS, NO_EQUALITIES, NO_FRICTION, NO_LIMITS, NO_CONTACTS, NO_SPRINGS, NO_DAMPERS, NO_GRAVITY, NO_CLAMPS, NO_ACTUATION = (
    1 << bit for bit in (0, 1, 2, 3, 4, 5, 6, 7, 8, 11)
)
"""MuJoCo's flags for what is switched off."""

NO_SENSORS = 1 << 13
"""MuJoCo's flag for sensors that are switched off."""

KEEP_PARENTS = 1 << 10
"""MuJoCo's flag for contacts of a body with the one that carries it, which are else none."""

DISABLED = {
    "modelled": "CONSTRAINT EQUALITY FRICTIONLOSS LIMIT CONTACT SPRING DAMPER GRAVITY CLAMPCTRL ACTUATION SENSOR",
    "listed": "FILTERPARENT",
    "method": "WARMSTART REFSAFE MIDPHASE EULERDAMP AUTORESET NATIVECCD ISLAND MULTICCD",
}
"""MuJoCo's names of flags that switch off (mjDSBL_…): the one that is listed belongs to contacts, which are."""

ENABLED = {"listed": "OVERRIDE IPC SPECULATIVE", "method": "ENERGY FWDINV INVDISCRETE SLEEP DIAGEXACT"}
"""The same of flags that switch on (mjENBL_…): those that are listed belong to contacts and flexible bodies."""

KNOWN_BITS = (1 << 20) - 1, (1 << 8) - 1
"""All flags that the tables name: of those that switch off, and of those that switch on."""

BALL, SCALAR = 1, 2
"""MuJoCo's number of balls, and that from which on its joints, sliders and hinges, have one coordinate."""

OVER_JOINT = 1
"""MuJoCo's number of what a fixed tendon, one without points, goes over."""

AT_JOINT = 0, 1
"""MuJoCo's numbers of transmissions of actuators to a joint."""

OVER_TENDON = 3
"""MuJoCo's number of transmissions to a tendon."""

NAMED_GROUPS = 31
"""Groups of actuators that a file can switch off."""

SOLREF, SOLIMP = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
"""How stiff MuJoCo's equalities are unless a file says more."""

GROUPS = 2000
"""Kinds of collision shapes up to which it is looked at which may touch; of more of them all are counted."""


def off(model: Compiled, *flags: int) -> bool:
    """Whether one of these flags is set."""
    return any(model.opt.disableflags & flag for flag in flags)


def without_constraints(model: Compiled, flag: int) -> bool:
    """Whether a kind of MuJoCo's constraints is switched off, or all of them are."""
    return off(model, flag, NO_CONSTRAINTS)


def meaning(name: str, table: str) -> str | None:
    """What a table (fields, options, disabled, enabled) says of a name; None where it does not name it."""
    return next((words for words, pattern in _patterns()[table].items() if pattern.fullmatch(name)), None)


@cache
def _patterns() -> dict[str, dict[str, re.Pattern[str]]]:
    """{table: {meaning: a pattern of its names}}."""

    def pattern(names: str) -> re.Pattern[str]:
        return re.compile("|".join(names.split()).replace("*", r"\w*").replace("#", "[A-Za-z0-9]*"))

    tables = {"fields": FIELDS, "options": OPTIONS, "disabled": DISABLED, "enabled": ENABLED}
    return {table: {meaning: pattern(names) for meaning, names in meanings.items()} for table, meanings in tables.items()}


def unlisted(model: Compiled) -> Iterator[str]:
    """Fields, options and flags of a MuJoCo that is newer than the tables, where they hold anything."""
    for owner, table in ((model, "fields"), (model.opt, "options")):
        for name in dir(owner):
            if name.startswith("_") or meaning(name, table):
                continue
            value = getattr(owner, name)
            if not callable(value) and np.any(np.asarray(value) != 0):
                yield f"{table} {name} of MuJoCo, not known here"
    for flags, known in zip((model.opt.disableflags, model.opt.enableflags), KNOWN_BITS, strict=True):
        if flags & ~known:
            yield f"flags {flags & ~known:#x} of MuJoCo, not known here"


def left_out(model: Compiled) -> dict[str, int]:
    """{words: how many} of what a file says and the model of it does not, but for shapes."""
    m = model
    limits, friction = not without_constraints(m, NO_LIMITS), not without_constraints(m, NO_FRICTION)
    passive = not (off(m, NO_SPRINGS) and off(m, NO_DAMPERS))
    counts = {
        "actuators": 0 if off(m, NO_ACTUATION) else sum(_acts(m, k) for k in range(m.nactuator)),
        AWAY_FROM_ZERO: 0 if off(m, NO_ACTUATION) or not m.nactuator else int(np.sum(m.jnt_actfrclimited & _away(m.jnt_actfrcrange))),
        "dampers and armatures of actuators over tendons": _over_tendons(m),
        "tendons": _acting_tendons(m),
        "sensors": m.nsensor,
        "limits of joints": int(np.sum(m.jnt_limited)) if limits else 0,
        "compensation of weight by motors that have limits, or are switched off": _by_motors(m),
        "forces of a fluid": int(passive and (m.opt.density > 0 or m.opt.viscosity > 0)),
        "friction of joints": int(np.sum(np.asarray(m.dof_frictionloss) != 0)) if friction else 0,
        "armature of free bodies and of balls between moving ones": len(_rotors_of_several(m)),
        "springs that yield": int(np.sum(np.asarray(m.jnt_springyield) != 0)),
        "softness of equalities, which are rigid here": _soft(m),
        "collision shapes": 0 if without_constraints(m, NO_CONTACTS) else touching(m),
        "contact pairs": 0 if without_constraints(m, NO_CONTACTS) else m.npair,
        "excluded contacts": 0 if without_constraints(m, NO_CONTACTS) else m.nexclude,
        "flexible bodies": m.nflex,
        "plugins": m.nplugin,
        "bodies moved by motion capture, which rest here": m.nmocap,
        "activations in keyframes": int(np.sum(np.any(np.asarray(m.key_act) != 0, axis=1))) if m.nkey and m.na else 0,
    }
    omitted = {words: int(count) for words, count in counts.items() if count}
    return omitted | dict.fromkeys(unlisted(m), 1)


def is_disabled(m: Compiled, k: int) -> bool:
    """Whether the file switches off the group of an actuator."""
    group = int(m.actuator_group[k])
    return 0 <= group < NAMED_GROUPS and bool(int(m.opt.disableactuator) & (1 << group))


def _rotors_of_several(m: Compiled) -> set[int]:
    """Joints with several degrees of freedom that have armature, or whose actuators bring them some."""
    joints_with_armature = {int(j) for j, armature in zip(m.dof_jntid, m.dof_armature, strict=True) if armature}
    driven = (k for k in range(m.nactuator) if m.actuator_armature[k] and m.actuator_trntype[k] in AT_JOINT)
    joints = joints_with_armature | {int(m.actuator_trnid[k][0]) for k in driven}
    return {j for j in joints if m.jnt_type[j] < SCALAR and not is_ball_in_world(m, j)}


def is_ball_in_world(m: Compiled, joint: int) -> bool:
    """Whether a joint is a ball, its body has no other, and hangs on what rests: its armature is then moments of inertia of the body."""
    body = int(m.jnt_bodyid[joint])
    return bool(m.jnt_type[joint] == BALL and m.body_jntnum[body] == 1 and m.body_weldid[m.body_parentid[body]] == 0)


def _acts(m: Compiled, k: int) -> bool:
    """Whether an actuator may have a force: one that is switched off has that within its bounds that is next to 0."""
    return not is_disabled(m, k) or bool(m.actuator_forcelimited[k] and _away(m.actuator_forcerange)[k])


def _away(ranges: np.ndarray) -> np.ndarray:
    """Which ranges, rows of lower and upper, do not hold 0."""
    lower, upper = np.reshape(ranges, (-1, 2)).T
    return (lower > 0) | (upper < 0)


def _over_tendons(m: Compiled) -> int:
    """Actuators over tendons that bring them damping or armature."""
    brings = np.array([np.any([m.actuator_armature[k], m.actuator_damping[k], *m.actuator_dampingpoly[k]]) for k in range(m.nactuator)])
    return int(np.sum(brings & (np.asarray(m.actuator_trntype) == OVER_TENDON))) if m.nactuator else 0


def _acting_tendons(m: Compiled) -> int:
    """Tendons that are more than a sum of coordinates in an equality: through points, or with forces, limits or inertia."""
    if not m.ntendon:
        return 0
    names = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "armature", "frictionloss", "limited")
    values = [np.asarray(getattr(m, f"tendon_{name}"), dtype=float).reshape(m.ntendon, -1) for name in names]
    spatial = [m.tendon_num[i] and m.wrap_type[m.tendon_adr[i]] != OVER_JOINT for i in range(m.ntendon)]
    return int(np.sum(np.any(np.hstack(values) != 0, axis=1) | np.array(spatial, dtype=bool)))


def _by_motors(m: Compiled) -> int:
    """Joints at which weights are compensated by an actuator's force that is bounded, or by none."""
    if not np.any(m.body_gravcomp):
        return 0
    bounded = np.asarray(m.jnt_actfrclimited, dtype=bool) | off(m, NO_ACTUATION)
    return int(np.sum(np.asarray(m.jnt_actgravcomp, dtype=bool) & bounded))


def _soft(m: Compiled) -> int:
    """Equalities whose stiffness a file says."""
    if without_constraints(m, NO_EQUALITIES) or not m.neq:
        return 0
    soft = np.any(np.asarray(m.eq_solref) != SOLREF, axis=1) | np.any(np.asarray(m.eq_solimp) != SOLIMP, axis=1)
    return int(np.sum(soft & np.asarray(m.eq_active0, dtype=bool)))


def touching(m: Compiled) -> int:
    """Geoms that may touch one of another body, by MuJoCo's masks and its rule of neighbours; bodies that are joined rigidly are one."""
    if not m.ngeom:
        return 0
    body = np.asarray(m.body_weldid)[m.geom_bodyid]
    kinds, which = np.unique(np.stack([m.geom_contype, m.geom_conaffinity, body], axis=1), axis=0, return_inverse=True)
    if len(kinds) > GROUPS:
        return int(np.sum((np.asarray(m.geom_contype) | np.asarray(m.geom_conaffinity)) != 0))
    contact_types, affinities, bodies = kinds.T
    meet = (((contact_types[:, None] & affinities) | (affinities[:, None] & contact_types)) != 0) & (bodies[:, None] != bodies)
    if not off(m, KEEP_PARENTS):
        parents = np.asarray(m.body_weldid)[np.asarray(m.body_parentid)[bodies]]
        neighbours = ((bodies[:, None] == parents) | (parents[:, None] == bodies)) & (bodies[:, None] != 0) & (bodies != 0)
        meet &= ~neighbours
    return int(np.sum(meet.any(axis=1)[which.reshape(-1)]))
