"use strict";
// A drawing as a model file in TOML, and as a model in Python; both run in ncgen with the motion of the page.

const quoted = (text) => JSON.stringify(text);
const listed = (values) => `[${values.join(", ")}]`;
const number = (x) => Number.isInteger(x) ? `${x}.0` : `${x}`.includes("e") && !`${x}`.includes(".") ? `${x}`.replace("e", ".0e") : `${x}`;
const numbers = (values) => listed(values.map(number));
const segmentText = (start, end) => ({ toml: quoted(`${end} - ${start}`), python: `${end} - ${start}` });

// What a drawing says in ncgen's words, as calls [word, {argument: value}]; a value is text that both read alike, true,
// pairs of names and numbers, or text of each: {toml, python}.
function callsOf(drawing) {
  const calls = [];
  for (const p of drawing.points)
    calls.push(["point", { name: quoted(p.name), position: numbers([p.x, p.y]), ...(p.fixed ? { fixed: true } : {}) }]);
  if (drawing.motors.length) {
    calls.push(["vector", { name: quoted("x_axis"), direction: numbers([1, 0, 0]), fixed: true }]);
    calls.push(["vector", { name: quoted("z_axis"), direction: numbers([0, 0, 1]), fixed: true }]);
  }
  for (const body of drawing.bodies) calls.push(["body", bodyCall(drawing, body)]);
  for (const slider of drawing.sliders) calls.push(...sliderCalls(drawing, slider));
  for (const motor of drawing.motors) calls.push(...motorCalls(drawing, motor));
  for (const gear of drawing.gears)
    calls.push(["gear", { first: quoted(gear.first), second: quoted(gear.second), radius_first: number(gear.radii[0]), radius_second: number(gear.radii[1]) }]);
  for (const spring of drawing.springs) calls.push(["spring", springCall(spring)]);
  if (drawing.gravity) calls.push(["gravity", { field: numbers([0, -GRAVITY, 0]) }]);
  for (const body of drawing.bodies) calls.push(["line", { points: listed(outline(drawing, body).map(quoted)) }]);
  const moving = drawing.motors.filter((motor) => ["start", "drive"].includes(motor.mode)); // the others with the least kinetic energy
  const starts = moving.map((motor) => [motor.name, motor.value]);
  calls.push(["simulation", { duration: "5.0", ...(starts.length ? { qd0: starts } : {}) }]);
  return calls;
}

// The points of a body in the order in which it is drawn: a plate closes.
function outline(drawing, body) {
  if (body.points.length === 2) return body.points;
  const at = new Map(body.points.map((name) => [`${place(drawing, name)}`, name]));
  const around = hull(body.points.map((name) => place(drawing, name))).map((p) => at.get(`${p}`));
  return around.length > 2 ? [...around, around[0]] : around;
}

function bodyCall(drawing, body) {
  const { mass, com, inertia, rod } = inertiaOf(drawing, body);
  const own = { name: quoted(body.name), points: listed(body.points.map(quoted)), mass: number(mass) };
  return rod ? { ...own, inertia: quoted("rod") } : { ...own, com: numbers([...com, 0]), inertia: number(inertia) };
}

function sliderCalls(drawing, slider) {
  const rail = { start: quoted(slider.start), axis: segmentText(slider.start, slider.end) };
  const carrier = drawing.bodies.find((b) => b.points.includes(slider.start) && b.points.includes(slider.end));
  const a = quoted(carrier?.name ?? "ground"), body = slider.turns ? undefined : bodyOf(drawing, slider), calls = [];
  if (slider.mass > 0)
    calls.push(["body", { name: quoted(slider.name), points: listed([quoted(slider.point)]), mass: number(slider.mass) }]);
  if (body) calls.push(["slider", { a, b: quoted(body.name), start: rail.start, end: quoted(slider.point), axis: rail.axis }]);
  else calls.push(["point_on_line", { a, point: quoted(slider.point), ...rail }]);
  return calls;
}

function motorCalls(drawing, motor) {
  const end = segmentText(motor.start, motor.end);
  const calls = [["angle", { name: quoted(motor.name), start: quoted("x_axis"), end, axis: quoted("z_axis") }]];
  if (motor.mode === "drive") {
    const [start, speed] = [number(angleOf(drawing, motor)), number(motor.value)];
    calls.push(["drive", { coordinate: quoted(motor.name), law: { toml: quoted(`${start} + ${speed}*t`), python: `${start} + ${speed} * m.time` } }]);
  }
  if (motor.mode === "torque") calls.push(["torque", { coordinate: quoted(motor.name), expression: number(motor.value) }]);
  return calls;
}

const springCall = (spring) => ({
  start: quoted(spring.start), end: quoted(spring.end), stiffness: number(spring.stiffness), damping: number(spring.damping),
  ...(spring.free === null ? {} : { free_length: number(spring.free) }),
});

const SINGLE = ["gravity", "simulation"]; // tables that a file has once

const pairs = (value, sign) => `{ ${value.map(([name, v]) => `${quoted(name)}${sign} ${number(v)}`).join(", ")} }`;

function tomlOf(drawing) {
  const lines = [`name = ${quoted(drawing.name)}`];
  for (const [word, values] of callsOf(drawing)) {
    lines.push("", SINGLE.includes(word) ? `[${word}]` : `[[${word}]]`);
    for (const [key, value] of Object.entries(values)) lines.push(`${key} = ${Array.isArray(value) ? pairs(value, " =") : value.toml ?? value}`);
  }
  return lines.join("\n") + "\n";
}

const MADE = ["point", "vector"]; // what later lines speak of as variables

function pythonOf(drawing) {
  const lines = ["from ncgen import Model", "", "", "def build() -> Model:", `    m = Model(${quoted(drawing.name)})`];
  for (const [word, values] of callsOf(drawing)) {
    const text = (value) => Array.isArray(value) ? pairs(value, ":") : value === true ? "True" : value.python ?? value;
    const given = word === "line" ? values.points.slice(1, -1) : Object.entries(values).map(([key, value]) => `${key}=${text(value)}`).join(", ");
    lines.push(`    ${MADE.includes(word) ? `${JSON.parse(values.name)} = ` : ""}m.${word}(${given})`);
  }
  return [...lines, "    return m"].join("\n") + "\n";
}
