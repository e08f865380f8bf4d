"use strict";
// The editor: what pointer and keyboard do with the tool in hand, the motion, and what the page says of it.

const TOOLS = {
  move: "Drag points; drag the ground to move the view. Click a part to change it.",
  pivot: "Click to place a fixed pivot, or to fix and free a point.",
  bar: "Click from point to point: each two become a bar. Enter or Escape ends the chain.",
  plate: "Click the corners of a plate; click the first one again, or press Enter, to end it.",
  slider: "Click a point, then two points of its rail.",
  motor: "Click a body to drive it.",
  spring: "Click two points.",
  gear: "Click two bodies that turn together as wheels.",
  delete: "Click what is to go.",
};
const LONGEST_TRACE = 4000;
const UNDO = 200;
const SHORTEST = 1 / 20; // s: what a picture advances at most
const SMOOTH = 1 / 100; // s between the places of a trace
const MOST_PIECES = 8; // of what a picture advances, so that no picture waits for a trace

class Editor {
  constructor(picture, motion, types, page) {
    Object.assign(this, { picture, motion, types, page });
    this.tool = "move";
    this.chosen = null;
    this.chain = [];
    this.playing = false;
    this.terms = null;
    this.traces = new Map();
    this.pointer = null;
    this.undone = [];
    this.rate = 1;
    this.drawing = emptyDrawing();
  }

  // -- the drawing

  open(drawing, playing = false) {
    this.drawing = drawing;
    this.chosen = null;
    this.chain = [];
    this.undone = [JSON.stringify(drawing)];
    this.picture.fit(drawing);
    this.restart();
    this.play(playing && this.terms !== null);
  }

  // A change of the drawing: remembered, and the motion begins anew.
  change(edit, keeps = false) {
    edit(this.drawing);
    tidy(this.drawing);
    if (this.chosen && !named(this.drawing[LISTS[this.chosen.kind]], this.chosen.name)) this.chosen = null;
    const text = JSON.stringify(this.drawing);
    if (!keeps && text !== this.undone.at(-1)) this.undone = [...this.undone, text].slice(-UNDO);
    this.restart();
  }

  undo() {
    if (this.undone.length < 2) return;
    this.undone.pop();
    this.drawing = JSON.parse(this.undone.at(-1));
    this.chosen = null;
    this.chain = [];
    this.restart();
  }

  get part() {
    return this.chosen && named(this.drawing[LISTS[this.chosen.kind]], this.chosen.name);
  }

  choose(kind, part) {
    this.chosen = part ? { kind, name: part.name } : null;
    this.page.show(this);
  }

  // -- the motion

  restart() {
    this.traces = new Map();
    this.terms = null;
    this.message = "";
    if (this.drawing.bodies.length || this.drawing.sliders.some((s) => s.mass > 0)) {
      try {
        this.terms = begin(this.motion, this.drawing, this.types);
      } catch (error) {
        this.message = `It cannot begin to move here: ${error.message}.`;
      }
    }
    if (!this.terms) this.playing = false;
    this.page.show(this);
    this.paint();
  }

  play(playing) {
    if (playing && !this.terms) return;
    if (playing) this.pickUp("move");
    this.playing = playing;
    this.last = null;
    this.page.show(this);
    if (playing) requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (!this.playing) return;
    if (this.last !== null) this.advance(Math.min((now - this.last) / 1000, SHORTEST) * this.rate);
    this.last = now;
    this.paint();
    this.page.tick(this);
    requestAnimationFrame((next) => this.frame(next));
  }

  advance(dt) {
    const pieces = Math.min(MOST_PIECES, Math.ceil(dt / SMOOTH));
    for (let k = 0; k < pieces && this.terms; ++k) if (!this.step(dt / pieces)) return;
  }

  step(dt) {
    try {
      this.motion.goOn(this.motion.t + dt);
    } catch (error) {
      this.playing = false;
      this.message = `It stops at ${this.motion.t.toFixed(2)} s: ${error.message}.`;
      this.page.show(this);
      return false;
    }
    for (const p of this.drawing.points) if (p.traced) {
      const trace = this.traces.get(p.name) ?? [];
      trace.push(this.at(p));
      this.traces.set(p.name, trace.slice(-LONGEST_TRACE));
    }
    return true;
  }

  // Where a point is now.
  at(p) {
    const i = this.terms?.index.get(`${p.name}.x`);
    return i === undefined ? [p.x, p.y] : [this.motion.q[i], this.motion.q[i + 1]];
  }

  get degrees() {
    return this.terms ? this.terms.names.length - this.motion.rank : 0;
  }

  paint() {
    paint(this.picture, { drawing: this.drawing, at: (p) => this.at(p), chosen: this.chosen, marks: this.chain, traces: this.traces, pointer: this.pointer });
  }

  // -- tools

  pickUp(tool) {
    this.tool = tool;
    this.chain = [];
    tidy(this.drawing);
    if (tool !== "move" && (this.playing || this.motion.t > 0)) {
      this.playing = false;
      this.restart();
    }
    this.page.show(this);
    this.paint();
  }

  // A click at a place of the world, with the tool in hand.
  click(where) {
    const screen = this.picture.screen(where), at = (p) => this.at(p);
    const hit = this.picture.pointAt(this.drawing, screen, at), body = this.picture.bodyAt(this.drawing, screen, at);
    const place = hit ? null : this.picture.snapped(where);
    this[`with_${this.tool}`]({ hit, body, place, screen, where });
    this.page.show(this);
    this.paint();
  }

  with_move({ hit, body, screen }) {
    const spring = this.picture.springAt(this.drawing, screen, (p) => this.at(p));
    if (hit) this.choose("point", hit);
    else if (spring) this.choose("spring", spring);
    else this.choose("body", body);
  }

  with_pivot({ hit, place }) {
    this.change((drawing) => {
      if (hit) hit.fixed = !hit.fixed;
      else this.choose("point", addPoint(drawing, place, true));
    });
  }

  // The point that was hit, or a new one that stays at hand until something holds it.
  pointFor({ hit, place }, fixed = false) {
    return (hit ?? addPoint(this.drawing, place, fixed)).name;
  }

  with_bar(click) {
    const next = this.pointFor(click), last = this.chain.at(-1);
    if (next === last) return this.end();
    this.chain = [next];
    if (last) this.change((drawing) => this.choose("body", addBodyOf(drawing, [last, next])));
  }

  with_plate(click) {
    const next = this.pointFor(click);
    if (next === this.chain[0] || this.chain.includes(next)) return this.end();
    this.chain.push(next);
  }

  with_slider(click) {
    const next = this.pointFor(click, this.chain.length > 0);
    if (this.chain.includes(next)) return;
    this.chain.push(next);
    if (this.chain.length < 3) return;
    const [point, start, end] = this.chain;
    this.chain = [];
    this.change((drawing) => this.choose("slider", addSliderOf(drawing, point, start, end)));
  }

  with_spring(click) {
    const next = this.pointFor(click, true);
    if (this.chain.includes(next)) return;
    this.chain.push(next);
    if (this.chain.length < 2) return;
    const [start, end] = this.chain;
    this.chain = [];
    this.change((drawing) => this.choose("spring", addSpringOf(drawing, start, end)));
  }

  with_motor({ hit, body, where }) {
    const target = body ?? (hit && this.drawing.bodies.find((b) => b.points.includes(hit.name)));
    if (!target) return;
    this.change((drawing) => {
      const motor = motorOf(drawing, target, "drive", where);
      if (motor.mode === "measure") Object.assign(motor, { mode: "drive", value: 3 });
      this.choose("motor", motor);
    });
    this.play(true);
  }

  with_gear({ hit, body }) {
    const target = body ?? (hit && this.drawing.bodies.find((b) => b.points.includes(hit.name)));
    if (!target || this.chain.includes(target.name)) return;
    this.chain.push(target.name);
    if (this.chain.length < 2) return;
    const bodies = this.chain.map((name) => named(this.drawing.bodies, name));
    this.chain = [];
    this.change((drawing) => this.choose("gear", addGearOf(drawing, ...bodies)));
  }

  with_delete({ hit, body, screen }) {
    const spring = this.picture.springAt(this.drawing, screen, (p) => this.at(p));
    const gone = hit ? ["point", hit] : spring ? ["spring", spring] : body && ["body", body];
    if (gone) this.change((drawing) => remove(drawing, { kind: gone[0], name: gone[1].name }));
  }

  // The end of a chain: a plate of the points that were clicked.
  end() {
    const corners = this.chain;
    this.chain = [];
    if (this.tool === "plate" && corners.length > 1) this.change((drawing) => this.choose("body", addBodyOf(drawing, corners)));
    else this.change(() => undefined);
  }

  removeChosen() {
    if (this.chosen) this.change((drawing) => remove(drawing, this.chosen));
  }

  // A point goes to a place; where it lies on a rail, along that.
  moveTo(point, where) {
    const slider = this.drawing.sliders.find((s) => s.point === point.name);
    [point.x, point.y] = where;
    for (const s of this.drawing.sliders) if (s === slider || [s.start, s.end].includes(point.name)) this.ontoRail(s);
  }

  ontoRail(slider) {
    const p = named(this.drawing.points, slider.point), a = place(this.drawing, slider.start), e = minus(place(this.drawing, slider.end), a);
    const share = along(e, minus([p.x, p.y], a)) / (along(e, e) || 1);
    [p.x, p.y] = [a[0] + share * e[0], a[1] + share * e[1]];
  }
}
