"use strict";
// The picture of a drawing on a canvas: where things are on the screen, what is under a place, how it looks.

const NEAR = 12; // px from a point that still hit it
const BODY_COLOURS = 8;

class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.centre = [0.2, 0.15];
    this.scale = 600; // px/m
    this.resize();
  }

  resize() {
    const { width, height } = this.canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    [this.width, this.height] = [width, height];
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  screen([x, y]) {
    return [this.width / 2 + (x - this.centre[0]) * this.scale, this.height / 2 - (y - this.centre[1]) * this.scale];
  }

  world([x, y]) {
    return [this.centre[0] + (x - this.width / 2) / this.scale, this.centre[1] - (y - this.height / 2) / this.scale];
  }

  // The whole drawing in view.
  fit(drawing, margin = 0.4) {
    const places = drawing.points.length ? [...drawing.points.map((p) => [p.x, p.y]), ...wheels(drawing)] : [[-0.1, -0.1], [0.6, 0.5]];
    const [low, high] = [Math.min, Math.max].map((f) => [0, 1].map((axis) => f(...places.map((p) => p[axis]))));
    const size = Math.max(high[0] - low[0], high[1] - low[1], 0.05);
    this.centre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.scale = (1 - margin) * Math.min(this.width / Math.max(high[0] - low[0], size / 2), this.height / Math.max(high[1] - low[1], size / 2));
  }

  zoom(factor, at = [this.width / 2, this.height / 2]) {
    const before = this.world(at);
    this.scale = Math.min(1e6, Math.max(1, this.scale * factor));
    const after = this.world(at);
    this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
  }

  // A length on the grid: 1, 2 or 5 times a power of ten, at least 24 px.
  get step() {
    const least = 24 / this.scale, power = 10 ** Math.floor(Math.log10(least));
    return [1, 2, 5, 10].map((k) => k * power).find((size) => size >= least);
  }

  snapped([x, y]) {
    const step = this.step;
    return [x, y].map((c) => Number((Math.round(c / step) * step).toPrecision(12)));
  }

  // The nearest point to a place on the screen, if it is near.
  pointAt(drawing, [x, y], at) {
    const distances = drawing.points.map((p) => [length(minus(this.screen(at(p)), [x, y])), p]);
    const best = distances.sort((a, b) => a[0] - b[0])[0];
    return best && best[0] <= NEAR ? best[1] : undefined;
  }

  bodyAt(drawing, where, at) {
    return [...drawing.bodies].reverse().find((body) => this.covers(this.shape(drawing, body, at), where));
  }

  springAt(drawing, where, at) {
    return drawing.springs.find((s) => this.covers([s.start, s.end].map((name) => this.screen(at(named(drawing.points, name)))), where));
  }

  // The corners of a body on the screen.
  shape(drawing, body, at) {
    return outline(drawing, body).map((name) => this.screen(at(named(drawing.points, name))));
  }

  covers(corners, [x, y]) {
    const isNear = corners.slice(1).some((b, i) => distanceTo(corners[i], b, [x, y]) <= NEAR - 2);
    const path = new Path2D();
    corners.forEach(([a, b], i) => (i ? path.lineTo(a, b) : path.moveTo(a, b)));
    return isNear || (corners.length > 2 && this.plain(path, x, y));
  }

  plain(path, x, y) {
    const ratio = window.devicePixelRatio || 1;
    return this.context.isPointInPath(path, x * ratio, y * ratio);
  }
}

// The four outermost places of every wheel.
const wheels = (drawing) => drawing.gears.flatMap((gear) => [gear.first, gear.second].flatMap((name, i) => {
  const [x, y] = place(drawing, named(drawing.motors, name).start), r = gear.radii[i];
  return [[x - r, y], [x + r, y], [x, y - r], [x, y + r]];
}));

function distanceTo(a, b, p) {
  const e = minus(b, a), share = Math.max(0, Math.min(1, along(e, minus(p, a)) / (along(e, e) || 1)));
  return length(minus(p, [a[0] + share * e[0], a[1] + share * e[1]]));
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Draws what is there: at(point) is where a point is now; chosen, marks and traces may be empty.
function paint(picture, { drawing, at, chosen, marks, traces, pointer }) {
  const { context, width, height } = picture, ink = colour("ink");
  context.clearRect(0, 0, width, height);
  paintGrid(picture);
  const now = (name) => picture.screen(at(named(drawing.points, name)));
  for (const s of drawing.sliders) paintRail(context, now(s.start), now(s.end), now(s.point), chosen?.name === s.name);
  for (const g of drawing.gears) paintGear(picture, drawing, g, now, chosen?.name === g.name);
  drawing.bodies.forEach((body, i) => paintBody(context, picture.shape(drawing, body, at), colour(`body${i % BODY_COLOURS}`), chosen?.name === body.name));
  for (const s of drawing.springs) paintSpring(context, now(s.start), now(s.end), chosen?.name === s.name);
  for (const m of drawing.motors) paintMotor(context, now(m.start), now(m.end), m, chosen?.name === m.name);
  for (const trace of traces.values()) paintLine(context, trace.map((p) => picture.screen(p)), colour("trace"), 1.5);
  for (const p of drawing.points) paintPoint(context, now(p.name), p, { ink, chosen: chosen?.name === p.name, marked: marks.includes(p.name) });
  if (pointer) paintPointer(context, picture.screen(pointer), ink);
}

function paintGrid(whole) {
  const { context, width, height } = whole;
  const size = whole.step, [left, top] = whole.world([0, 0]), [right, bottom] = whole.world([width, height]);
  context.strokeStyle = colour("grid");
  context.lineWidth = 1;
  context.beginPath();
  for (let x = Math.ceil(left / size) * size; x < right; x += size) {
    const [sx] = whole.screen([x, 0]);
    context.moveTo(sx, 0);
    context.lineTo(sx, height);
  }
  for (let y = Math.ceil(bottom / size) * size; y < top; y += size) {
    const [, sy] = whole.screen([0, y]);
    context.moveTo(0, sy);
    context.lineTo(width, sy);
  }
  context.stroke();
}

function paintLine(context, places, style, width) {
  context.beginPath();
  places.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.strokeStyle = style;
  context.lineWidth = width;
  context.lineJoin = context.lineCap = "round";
  context.stroke();
}

function paintBody(context, corners, fill, chosen) {
  if (chosen) paintLine(context, corners, colour("trace"), 20);
  paintLine(context, corners, fill, 13);
  if (corners.length < 3) return;
  context.fillStyle = fill;
  context.fill();
}

function paintPoint(context, [x, y], point, { ink, chosen, marked }) {
  if (point.fixed) paintGround(context, [x, y], ink);
  context.beginPath();
  context.arc(x, y, chosen || marked ? 7.5 : 5, 0, 2 * Math.PI);
  context.fillStyle = chosen || marked ? colour("trace") : colour("paper");
  context.fill();
  context.strokeStyle = ink;
  context.lineWidth = 2;
  context.stroke();
  context.fillStyle = ink;
  context.font = "13px system-ui, sans-serif";
  context.fillText(point.name, x + 9, y - 9);
}

function paintGround(context, [x, y], ink) {
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x - 10, y + 15);
  context.lineTo(x + 10, y + 15);
  context.closePath();
  context.fillStyle = colour("steel");
  context.fill();
  paintLine(context, [[x - 15, y + 16], [x + 15, y + 16]], ink, 2);
}

function paintRail(context, a, b, p, chosen) {
  const [dx, dy] = minus(b, a), size = Math.hypot(dx, dy) || 1, [ux, uy] = [dx / size, dy / size];
  const beyond = [Math.min(0, along(minus(p, a), [ux, uy]) - 30), Math.max(size, along(minus(p, a), [ux, uy]) + 30)];
  const ends = beyond.map((s) => [a[0] + s * ux, a[1] + s * uy]);
  paintLine(context, ends, chosen ? colour("trace") : colour("steel"), chosen ? 6 : 4);
  context.save();
  context.translate(...p);
  context.rotate(Math.atan2(uy, ux));
  context.fillStyle = colour("steel");
  context.fillRect(-16, -10, 32, 20);
  context.strokeStyle = colour("ink");
  context.lineWidth = 1.5;
  context.strokeRect(-16, -10, 32, 20);
  context.restore();
}

function paintSpring(context, a, b, chosen) {
  const e = minus(b, a), size = length(e) || 1, n = [-e[1] / size, e[0] / size], coils = 12, places = [a];
  for (let k = 1; k < 2 * coils; ++k) {
    const s = 0.1 + 0.8 * k / (2 * coils), h = k % 2 ? 7 : -7;
    places.push([a[0] + s * e[0] + h * n[0], a[1] + s * e[1] + h * n[1]]);
  }
  paintLine(context, [...places, b], chosen ? colour("trace") : colour("ink"), chosen ? 3 : 1.5);
}

// An arc with an arrow, where something drives; a thin one where an angle is measured.
function paintMotor(context, start, end, motor, chosen) {
  const angle = Math.atan2(end[1] - start[1], end[0] - start[0]), active = motor.mode !== "measure", way = motor.value < 0 ? 1 : -1;
  const [from, to] = way < 0 ? [angle - 1.5, angle] : [angle, angle + 1.5], tip = way < 0 ? from : to, radius = 24;
  context.beginPath();
  context.arc(...start, radius, from, to);
  context.strokeStyle = chosen ? colour("trace") : active ? colour("vector") : colour("soft");
  context.lineWidth = chosen || active ? 3 : 1;
  context.stroke();
  if (!active) return;
  const head = [start[0] + radius * Math.cos(tip), start[1] + radius * Math.sin(tip)], along_ = tip + way * Math.PI / 2;
  const wing = (turn) => [head[0] - 9 * Math.cos(along_ + turn), head[1] - 9 * Math.sin(along_ + turn)];
  paintLine(context, [wing(0.5), head, wing(-0.5)], context.strokeStyle, 3);
}

function paintGear(picture, drawing, gear, now, chosen) {
  const motors = [gear.first, gear.second].map((name) => named(drawing.motors, name));
  motors.forEach((motor, i) => {
    picture.context.beginPath();
    picture.context.arc(...now(motor.start), Math.abs(gear.radii[i]) * picture.scale, 0, 2 * Math.PI);
    picture.context.setLineDash([5, 3]);
    picture.context.strokeStyle = chosen ? colour("trace") : colour("soft");
    picture.context.lineWidth = chosen ? 4 : 2.5;
    picture.context.stroke();
    picture.context.setLineDash([]);
  });
}

function paintPointer(context, [x, y], ink) {
  paintLine(context, [[x - 9, y], [x + 9, y]], ink, 1);
  paintLine(context, [[x, y - 9], [x, y + 9]], ink, 1);
}
