"use strict";
// Pointer, touch and keyboard on the canvas.

const KEYS = { v: "move", p: "pivot", b: "bar", l: "plate", s: "slider", m: "motor", k: "spring", g: "gear", x: "delete" };
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const STILL = 4; // px that a click may move

class Hands {
  constructor(editor) {
    this.editor = editor;
    this.held = new Map();
    const canvas = editor.picture.canvas;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.held.delete(event.pointerId));
    canvas.addEventListener("pointerleave", () => this.point(null));
    canvas.addEventListener("dblclick", () => editor.end());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    document.addEventListener("keydown", (event) => this.key(event));
  }

  place(event) {
    const box = this.editor.picture.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  point(where) {
    this.editor.pointer = where;
    if (!this.editor.playing) this.editor.paint();
  }

  down(event) {
    const { editor } = this, where = this.place(event);
    editor.picture.canvas.setPointerCapture(event.pointerId);
    editor.picture.canvas.focus({ preventScroll: true });
    const hit = editor.tool === "move" ? editor.picture.pointAt(editor.drawing, where, (p) => editor.at(p)) : undefined;
    this.held.set(event.pointerId, { from: where, last: where, moved: false, point: hit?.name });
  }

  move(event) {
    const { editor } = this, where = this.place(event), held = this.held.get(event.pointerId);
    if (!held) return event.pointerType === "mouse" && editor.tool !== "move" ? this.point(editor.picture.snapped(editor.picture.world(where))) : undefined;
    held.moved ||= length(minus(where, held.from)) > STILL;
    if (this.held.size === 2) this.pinch(event.pointerId, where);
    else if (held.moved && held.point) this.drag(held.point, where);
    else if (held.moved) this.pan(minus(where, held.last));
    held.last = where;
  }

  drag(name, where) {
    const { editor } = this;
    if (editor.playing) editor.play(false);
    editor.change((drawing) => editor.moveTo(named(drawing.points, name), editor.picture.snapped(editor.picture.world(where))), true);
  }

  pan([dx, dy]) {
    const { picture } = this.editor;
    picture.centre = [picture.centre[0] - dx / picture.scale, picture.centre[1] + dy / picture.scale];
    this.editor.paint();
  }

  pinch(id, where) {
    const other = [...this.held].find(([key]) => key !== id)[1].last, before = this.held.get(id).last;
    this.editor.picture.zoom(length(minus(where, other)) / (length(minus(before, other)) || 1), other);
    this.editor.paint();
  }

  up(event) {
    const { editor } = this, held = this.held.get(event.pointerId);
    const alone = this.held.size === 1;
    this.held.delete(event.pointerId);
    if (!held || !alone) return;
    if (!held.moved) editor.click(editor.picture.world(held.from));
    else if (held.point) editor.change(() => undefined);
  }

  wheel(event) {
    event.preventDefault();
    this.editor.picture.zoom(Math.exp(-event.deltaY / 500), this.place(event));
    this.editor.paint();
  }

  // Keys of the whole page, but for those that a field or a button takes itself.
  key(event) {
    const { editor } = this, on = document.activeElement, canvas = editor.picture.canvas;
    if (byId("text").open || (on !== canvas && on !== document.body && ["INPUT", "SELECT", "TEXTAREA"].includes(on.tagName))) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if ((event.ctrlKey || event.metaKey) && key === "z") editor.undo();
    else if (event.ctrlKey || event.metaKey || event.altKey) return;
    else if (KEYS[key]) editor.pickUp(KEYS[key]);
    else if (key === "Escape") editor.end();
    else if (key === "Delete" || key === "Backspace") editor.removeChosen();
    else if (key === "+" || key === "-") { editor.picture.zoom(key === "+" ? 1.25 : 0.8); editor.paint(); }
    else if (on === canvas || on === document.body) return this.canvasKey(event, key);
    else return;
    event.preventDefault();
  }

  // Arrows move what is chosen, or the cross with a tool in hand, which Enter clicks.
  canvasKey(event, key) {
    const { editor } = this;
    if (key === " ") editor.play(!editor.playing);
    else if (key === "0") { editor.play(false); editor.restart(); }
    else if (ARROWS[key]) this.arrow(ARROWS[key], event.shiftKey ? 5 : 1);
    else if (key === "Enter") editor.pointer ? editor.click(editor.pointer) : editor.end();
    else return;
    event.preventDefault();
  }

  arrow([dx, dy], count) {
    const { editor } = this, step = editor.picture.step * count;
    if (editor.tool === "move" && editor.chosen?.kind === "point")
      return editor.change(() => editor.moveTo(editor.part, editor.picture.snapped([editor.part.x + dx * step, editor.part.y + dy * step])));
    const [x, y] = editor.pointer ?? editor.picture.snapped(editor.picture.centre);
    this.point(editor.picture.snapped([x + dx * step, y + dy * step]));
    const near = editor.picture.pointAt(editor.drawing, editor.picture.screen(editor.pointer), (p) => editor.at(p));
    byId("hint").textContent = `${editor.pointer.map((c) => `${c} m`).join(", ")}${near ? `: point ${near.name}` : ""}`;
  }
}
