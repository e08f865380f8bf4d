"use strict";
// From a drawing to the table of its mechanism, which the generic kernels read, and to the start of its motion.
//
// A drawing: points {name, x, y, fixed}; bodies {name, points, mass}, mass null for one by size; sliders {name, point, start, end, mass,
// turns}, a point on the line of two others; springs {name, start, end, stiffness, damping, free}; motors {name, start, end, mode, value},
// the angle of a segment with a drive (rad/s), a start (rad/s), a torque (N m) or nothing; gears {name, first, second, radii}.

const GRAVITY = 9.81;
const BAR_DENSITY = 1; // kg/m
const PLATE_DENSITY = 10; // kg/m²

const minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
const length = (a) => Math.hypot(a[0], a[1]);
const across = (a, b) => a[0] * b[1] - a[1] * b[0];
const along = (a, b) => a[0] * b[0] + a[1] * b[1];
const named = (list, name) => list.find((each) => each.name === name);
const place = (drawing, name) => { const p = named(drawing.points, name); return [p.x, p.y]; };

{% include "html/hull.js.jinja" %}

// Mass (kg), centre of mass (m) and moment of inertia about it (kg m²) of a plate, the convex hull of its points.
function plateInertia(corners, mass) {
  let area = 0, x = 0, y = 0, polar = 0;
  const o = corners[0];
  for (let i = 1; i + 1 < corners.length; ++i) {
    const [a, b] = [minus(corners[i], o), minus(corners[i + 1], o)];
    const part = across(a, b) / 2;
    area += part;
    x += part * (a[0] + b[0]) / 3;
    y += part * (a[1] + b[1]) / 3;
    polar += part * (along(a, a) + along(b, b) + along(a, b)) / 6;
  }
  const centre = [x / area, y / area];
  const own = mass ?? PLATE_DENSITY * area;
  return { mass: own, com: [o[0] + centre[0], o[1] + centre[1]], inertia: own * (polar / area - along(centre, centre)), rod: false };
}

// The same of any body: of a bar, a rod from end to end; of a plate without area, a rod between its farthest points.
function inertiaOf(drawing, body) {
  const places = body.points.map((name) => place(drawing, name));
  const corners = hull(places);
  if (corners.length > 2) return plateInertia(corners, body.mass);
  const [a, b] = corners, size = length(minus(b, a)), mass = body.mass ?? BAR_DENSITY * size;
  return { mass, com: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], inertia: mass * size * size / 12, rod: places.length === 2 };
}

// Terms are collected here: rows with their numbers, masses and forces.
class Terms {
  constructor(drawing, types) {
    this.drawing = drawing;
    this.types = types;
    this.names = [];
    this.start = [];
    this.lengths = [];
    this.rows = [];
    this.others = [];
    this.labels = [];
    for (const p of drawing.points) if (!p.fixed) {
      this.add(`${p.name}.x`, p.x, true);
      this.add(`${p.name}.y`, p.y, true);
    }
    for (const motor of drawing.motors) this.add(motor.name, angleOf(drawing, motor), false);
    this.index = new Map(this.names.map((name, i) => [name, i]));
  }

  add(name, value, isLength) {
    this.names.push(name);
    this.start.push(value);
    this.lengths.push(isLength);
  }

  // A linear form of pairs (weight, [point, axis] or angle): its constant and its coordinates.
  form(...pairs) {
    let constant = 0;
    const terms = [];
    for (const [weight, what] of pairs) {
      const name = Array.isArray(what) ? `${what[0]}.${"xy"[what[1]]}` : what;
      if (typeof what === "number") constant += weight * what;
      else if (this.index.has(name)) terms.push([weight, this.index.get(name)]);
      else constant += weight * place(this.drawing, what[0])[what[1]];
    }
    return [constant, terms];
  }

  // The three scalars of the vector from a point to another.
  segment(start, end) {
    return [0, 1].map((axis) => this.form([1, [end, axis]], [-1, [start, axis]])).concat([[0, []]]);
  }

  term(list, type, row, forms, data) {
    const flat = forms.flatMap(([constant, pairs]) => [constant, pairs.length, ...pairs.flat()]);
    list.push([this.types.indexOf(type), row, ...flat, ...data]);
  }

  // One constraint equation: terms (type, forms, data) whose sum stays zero.
  row(label, ...terms) {
    for (const [type, forms, data] of terms) this.term(this.rows, type, this.labels.length, forms, data);
    this.labels.push(label);
  }

  // A linear constraint equation: a form that stays zero.
  linear(label, pairs, scale = 1) {
    const none = Array(6).fill([0, []]);
    this.row(label, ["slide", [...none, this.form(...pairs)], [scale]]);
  }

  force(type, forms, data) {
    this.term(this.others, type, -1, forms, data);
  }

  table() {
    const head = [this.names.length, this.labels.length, this.rows.length + this.others.length, this.rows.length];
    return [head, ...this.rows, ...this.others].flat();
  }
}

const angleOf = (drawing, motor) => {
  const [x, y] = minus(place(drawing, motor.end), place(drawing, motor.start));
  return Math.atan2(y, x);
};

// The two points of a body that tell where it is: the farthest from each other.
function basisOf(drawing, body) {
  let best = [body.points[0], body.points[1]], farthest = -1;
  body.points.forEach((a, i) => body.points.slice(i + 1).forEach((b) => {
    const distance = length(minus(place(drawing, b), place(drawing, a)));
    if (distance > farthest) [best, farthest] = [[a, b], distance];
  }));
  return best;
}

// Where a place is in the frame of a basis: shares of the segment and of the segment turned by a right angle.
function shares(drawing, [a, b], where) {
  const e = minus(place(drawing, b), place(drawing, a)), d = minus(where, place(drawing, a)), size = along(e, e);
  return [along(e, d) / size, across(e, d) / size];
}

// The components of such a place as pairs of a linear form.
const carried = ([a, b], [s, h], axis) => axis === 0
  ? [[1 - s, [a, 0]], [s, [b, 0]], [h, [a, 1]], [-h, [b, 1]]]
  : [[1 - s, [a, 1]], [s, [b, 1]], [-h, [a, 0]], [h, [b, 0]]];

function addBody(terms, drawing, body) {
  const basis = basisOf(drawing, body), [a, b] = basis, size = length(minus(place(drawing, b), place(drawing, a)));
  if (!(named(drawing.points, a).fixed && named(drawing.points, b).fixed))
    terms.row(`${body.name}: ${a}-${b}`, ["distance", terms.segment(a, b), [size, 0.5 / size]]);
  for (const p of body.points) if (!basis.includes(p)) {
    const where = shares(drawing, basis, place(drawing, p));
    for (const axis of [0, 1])
      terms.linear(`${body.name}: ${p}.${"xy"[axis]}`, [[1, [p, axis]], ...carried(basis, where, axis).map(([w, c]) => [-w, c])]);
  }
  addInertia(terms, drawing, basis, size, inertiaOf(drawing, body));
}

// Kinetic energy and weight of a rigid body over the coordinates of its basis.
function addInertia(terms, drawing, basis, size, { mass, com, inertia }) {
  const [a, b] = basis, [s, h] = shares(drawing, basis, com), arm = minus(com, place(drawing, a));
  const turning = (inertia + mass * along(arm, arm)) / (size * size);
  const pair = (p, q, value) => addMass(terms, p, q, value);
  for (const axis of [0, 1]) {
    pair([a, axis], [a, axis], mass - 2 * mass * s + turning);
    pair([a, axis], [b, axis], mass * s - turning);
    pair([b, axis], [b, axis], turning);
  }
  pair([a, 0], [b, 1], -mass * h);
  pair([a, 1], [b, 0], mass * h);
  if (drawing.gravity) terms.force("weight", [terms.form(...carried(basis, [s, h], 1))], [-mass * GRAVITY]);
}

function addMass(terms, p, q, value) {
  const [first, second] = [terms.form([1, p]), terms.form([1, q])];
  if (!value || !first[1].length || !second[1].length) return;
  if (p[0] === q[0] && p[1] === q[1]) terms.force("mass-diagonal", [first], [value]);
  else terms.force("mass-pair", [first, second], [value]);
}

function addSlider(terms, drawing, slider) {
  const rail = terms.segment(slider.start, slider.end), size = length(minus(place(drawing, slider.end), place(drawing, slider.start)));
  const arm = terms.segment(slider.start, slider.point), none = Array(3).fill([0, []]);
  terms.row(`${slider.point} on ${slider.start}-${slider.end}`, ["affine-z", [...none, ...rail, ...arm], [1, 1 / size]]);
  const body = slider.turns ? undefined : bodyOf(drawing, slider);
  if (body) addNoTurning(terms, drawing, slider, rail, size, basisOf(drawing, body));
  if (slider.mass > 0) {
    for (const axis of [0, 1]) addMass(terms, [slider.point, axis], [slider.point, axis], slider.mass);
    if (drawing.gravity) terms.force("weight", [terms.form([1, [slider.point, 1]])], [-slider.mass * GRAVITY]);
  }
}

// The body that a slider guides: one that has its point and not its rail.
const bodyOf = (drawing, slider) => drawing.bodies.find((b) => b.points.includes(slider.point) && !b.points.includes(slider.start));

// The angle from the rail to a segment of the body stays what it is: |a| |b| sin(now - then) = 0.
function addNoTurning(terms, drawing, slider, rail, size, [a, b]) {
  const e = minus(place(drawing, b), place(drawing, a)), r = minus(place(drawing, slider.end), place(drawing, slider.start));
  const scale = 1 / (size * length(e)) ** 2, own = terms.segment(a, b), none = Array(3).fill([0, []]);
  terms.row(`no turning on ${slider.name}`,
    ["affine-z", [...none, ...rail, ...own], [1, along(r, e) * scale]],
    ["dot", [...rail, ...own], [0, 1, across(r, e) * scale]]);
}

function addMotor(terms, drawing, motor) {
  const size = length(minus(place(drawing, motor.end), place(drawing, motor.start))), x = [[1, []], [0, []], [0, []]], z = [[0, []], [0, []], [1, []]];
  const forms = [...x, ...terms.segment(motor.start, motor.end), ...z, terms.form([1, motor.name])];
  terms.row(`angle ${motor.name}`, ["angle-smooth-perpendicular", forms, [1, size, 1, 1 / size]]);
  if (motor.mode === "drive") addDrive(terms, drawing, motor);
  if (motor.mode === "torque") terms.force("push", [terms.form([1, motor.name])], [motor.value]);
}

const addDrive = (terms, drawing, motor) =>
  terms.row(`drive of ${motor.name}`, ["drive", [terms.form([1, motor.name])], [angleOf(drawing, motor), motor.value, 0, 0, 0, 1]]);

function addGear(terms, drawing, gear) {
  const [first, second] = [gear.first, gear.second].map((name) => named(drawing.motors, name)), [r, s] = gear.radii;
  const balance = r * angleOf(drawing, first) + s * angleOf(drawing, second);
  terms.linear(`gear ${gear.first}-${gear.second}`, [[r, gear.first], [s, gear.second], [-1, balance]], 1 / Math.abs(r));
}

function addSpring(terms, drawing, spring) {
  const free = spring.free ?? length(minus(place(drawing, spring.end), place(drawing, spring.start)));
  const segment = terms.segment(spring.start, spring.end);
  if (free === 0 && !spring.damping) terms.force("spring-to-nothing", segment, [spring.stiffness, 0]);
  else terms.force("spring", segment, [spring.stiffness, spring.damping, free]);
}

// All terms of a drawing. starting: motors that give a speed at the start drive it, to find the velocities that go with it.
function termsOf(drawing, types, starting = false) {
  const terms = new Terms(drawing, types);
  for (const body of drawing.bodies) addBody(terms, drawing, body);
  for (const slider of drawing.sliders) addSlider(terms, drawing, slider);
  for (const motor of drawing.motors) addMotor(terms, drawing, motor);
  if (starting) for (const motor of drawing.motors) if (motor.mode === "start") addDrive(terms, drawing, motor);
  for (const gear of drawing.gears) addGear(terms, drawing, gear);
  for (const spring of drawing.springs) addSpring(terms, drawing, spring);
  return terms;
}

// Natural sizes of the coordinates: the extent of the drawing for lengths, 1 for angles.
function sizesOf(drawing, terms) {
  const spread = (axis) => { const all = drawing.points.map((p) => p[axis]); return Math.max(...all) - Math.min(...all); };
  const extent = Math.max(spread("x"), spread("y")) || 1;
  return terms.lengths.map((isLength) => isLength ? extent : 1);
}

// Lets a motion begin with a drawing; returns its terms. Throws an Error that says why it cannot. Motors have their speeds at the start,
// all else moves with the least kinetic energy.
function begin(motion, drawing, types, ...tolerances) {
  const terms = termsOf(drawing, types), sizes = sizesOf(drawing, terms), still = terms.start.map(() => 0);
  let qd = still;
  if (drawing.motors.some((motor) => motor.mode === "start" && motor.value)) {
    motion.begin(termsOf(drawing, types, true).table(), terms.start, still, sizes, 0, ...tolerances);
    qd = Array.from(motion.qd.slice(0, still.length));
  }
  motion.begin(terms.table(), terms.start, qd, sizes, 0, ...tolerances);
  return terms;
}
