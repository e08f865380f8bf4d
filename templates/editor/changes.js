"use strict";
// What can be done to a drawing: every function changes it and returns the part that it made.

const emptyDrawing = () => ({ name: "drawing", gravity: true, points: [], bodies: [], sliders: [], springs: [], motors: [], gears: [] });

const LISTS = { point: "points", body: "bodies", slider: "sliders", spring: "springs", motor: "motors", gear: "gears" };

const allNames = (drawing) => new Set(Object.values(LISTS).flatMap((list) => drawing[list].map((each) => each.name)));

function freeName(drawing, word) {
  const taken = allNames(drawing);
  for (let k = 1; ; ++k) if (!taken.has(`${word}${k}`)) return `${word}${k}`;
}

function pointName(drawing) {
  const taken = allNames(drawing);
  for (let k = 0; ; ++k) {
    const name = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"[k % 26] + (k < 26 ? "" : Math.floor(k / 26));
    if (!taken.has(name)) return name;
  }
}

function put(list, part) {
  list.push(part);
  return part;
}

const addPoint = (drawing, [x, y], fixed = false) => put(drawing.points, { name: pointName(drawing), x, y, fixed, traced: false });

const sameMembers = (a, b) => a.length === b.length && a.every((x) => b.includes(x));

function addBodyOf(drawing, points) {
  const there = drawing.bodies.find((body) => sameMembers(body.points, points));
  return there ?? put(drawing.bodies, { name: freeName(drawing, points.length > 2 ? "plate" : "bar"), points, mass: null });
}

// The point comes to lie on the rail.
function addSliderOf(drawing, point, start, end) {
  const p = named(drawing.points, point), a = place(drawing, start), e = minus(place(drawing, end), a);
  const share = along(e, minus([p.x, p.y], a)) / along(e, e);
  [p.x, p.y] = [a[0] + share * e[0], a[1] + share * e[1]];
  p.fixed = false;
  return put(drawing.sliders, { name: freeName(drawing, "slide"), point, start, end, mass: 0.2, turns: true });
}

const addSpringOf = (drawing, start, end) => put(drawing.springs, { name: freeName(drawing, "spring"), start, end, stiffness: 100, damping: 0, free: null });

// The angle of a body: from its pivot, or the point nearest to a place, to the point farthest from there.
function motorOf(drawing, body, mode, near) {
  const points = body.points.map((name) => named(drawing.points, name));
  const there = drawing.motors.find((motor) => body.points.includes(motor.start) && body.points.includes(motor.end));
  if (there) return there;
  const nearest = (list, where) => list.reduce((a, b) => length(minus([a.x, a.y], where)) <= length(minus([b.x, b.y], where)) ? a : b);
  const start = points.find((p) => p.fixed) ?? nearest(points, near ?? [points[0].x, points[0].y]);
  const rest = points.filter((p) => p !== start).map((p) => [length(minus([p.x, p.y], [start.x, start.y])), p]);
  const end = rest.reduce((a, b) => a[0] >= b[0] ? a : b)[1];
  return put(drawing.motors, { name: freeName(drawing, "psi"), start: start.name, end: end.name, mode, value: mode === "drive" ? 3 : 0 });
}

// Two bodies that turn about their pivots as wheels do that touch between these.
function addGearOf(drawing, first, second) {
  const [a, b] = [first, second].map((body) => motorOf(drawing, body, "measure"));
  const distance = length(minus(place(drawing, a.start), place(drawing, b.start)));
  const radius = distance > 0 ? distance / 2 : 0.1;
  return put(drawing.gears, { name: freeName(drawing, "gear"), first: a.name, second: b.name, radii: [radius, radius] });
}

function remove(drawing, { kind, name }) {
  const list = LISTS[kind];
  drawing[list] = drawing[list].filter((each) => each.name !== name);
  tidy(drawing);
}

// Without what speaks of parts that are gone, and without points that nothing holds.
function tidy(drawing) {
  const is = (name) => named(drawing.points, name) !== undefined;
  for (const body of drawing.bodies) body.points = body.points.filter(is);
  drawing.bodies = drawing.bodies.filter((body) => body.points.length > 1);
  drawing.sliders = drawing.sliders.filter((s) => is(s.point) && is(s.start) && is(s.end));
  drawing.springs = drawing.springs.filter((s) => is(s.start) && is(s.end));
  const together = (motor) => drawing.bodies.some((body) => body.points.includes(motor.start) && body.points.includes(motor.end));
  drawing.motors = drawing.motors.filter(together);
  drawing.gears = drawing.gears.filter((gear) => named(drawing.motors, gear.first) && named(drawing.motors, gear.second));
  const held = new Set(drawing.bodies.flatMap((body) => body.points));
  for (const s of drawing.sliders) for (const name of s.mass > 0 ? [s.point] : []) held.add(name);
  for (const p of drawing.points) if (!p.fixed && !held.has(p.name) && isRail(drawing, p.name)) p.fixed = true;
  drawing.points = drawing.points.filter((p) => p.fixed || held.has(p.name));
  if (drawing.springs.some((s) => !is(s.start) || !is(s.end)) || drawing.sliders.some((s) => !is(s.point))) tidy(drawing);
}

const isRail = (drawing, name) => drawing.sliders.some((s) => s.start === name || s.end === name);
