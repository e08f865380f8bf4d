"use strict";
// The page around the editor: buttons, the fields of the part that is chosen, pointer, keyboard, address, texts to copy.

const byId = (id) => document.getElementById(id);

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) if (value !== false && value !== undefined) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// What can be changed of a part: [key, label, kind, unit]; kind: number, tick, choice, or size for a number that may follow from the drawing.
const FIELDS = {
  point: [["x", "x", "number", "m"], ["y", "y", "number", "m"], ["fixed", "fixed to the ground", "tick"], ["traced", "leaves a trace", "tick"]],
  body: [["mass", "mass", "size", "kg"]],
  slider: [["mass", "mass of the block", "number", "kg"], ["turns", "the body may turn on it", "tick"]],
  spring: [["stiffness", "stiffness", "number", "N/m"], ["damping", "damping", "number", "N s/m"], ["free", "free length", "size", "m"]],
  motor: [["mode", "drives by", "choice"], ["value", "value", "number", ""]],
  gear: [["radii.0", "first radius", "number", "m"], ["radii.1", "second radius", "number", "m"]],
};
const MODES = { drive: "constant speed", start: "speed at the start", torque: "torque", measure: "only an angle" };
const UNITS = { drive: "rad/s", start: "rad/s", torque: "N m", measure: "" };
const POSITIVE = ["body.mass", "spring.stiffness", "gear.radii.0"];

const read = (part, key) => key.split(".").reduce((value, k) => value[k], part);

function write(part, key, value) {
  const keys = key.split("."), last = keys.pop();
  keys.reduce((inner, k) => inner[k], part)[last] = value;
}

// What a size is that was not given.
const followed = (editor, kind, part) => kind === "body" ? inertiaOf(editor.drawing, part).mass
  : length(minus(place(editor.drawing, part.end), place(editor.drawing, part.start)));

class Page {
  constructor() {
    for (const name of Object.keys(TOOLS)) byId(`tool-${name}`).addEventListener("click", () => this.editor.pickUp(name));
    const actions = {
      play: (e) => e.play(!e.playing), back: (e) => { e.play(false); e.restart(); }, undo: (e) => e.undo(), fit: (e) => { e.picture.fit(e.drawing); e.paint(); },
      toml: () => this.offer("TOML", tomlOf), python: () => this.offer("Python", pythonOf), remove: (e) => e.removeChosen(),
    };
    for (const [name, action] of Object.entries(actions)) byId(name).addEventListener("click", () => action(this.editor));
    byId("gravity").addEventListener("change", (event) => this.editor.change((d) => (d.gravity = event.target.checked)));
    byId("rate").addEventListener("input", (event) => this.setRate(10 ** Number(event.target.value)));
    const examples = byId("examples");
    for (const name of Object.keys(EXAMPLES)) examples.append(element("option", { value: name }, name));
    examples.addEventListener("change", () => this.openExample(examples.value));
    byId("parts").addEventListener("change", (event) => this.chooseByList(event.target.value));
    byId("copy").addEventListener("click", () => this.copy());
    byId("close").addEventListener("click", () => byId("text").close());
    window.addEventListener("resize", () => { this.editor.picture.resize(); this.editor.paint(); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.editor.paint());
  }

  openExample(name) {
    this.editor.open(EXAMPLES[name]?.() ?? emptyDrawing(), name in EXAMPLES);
    byId("examples").value = "";
  }

  setRate(rate) {
    this.editor.rate = rate;
    byId("rate-shown").textContent = `${Number(rate.toPrecision(2))} ×`;
  }

  chooseByList(value) {
    const [kind, name] = value.split(" ");
    this.editor.choose(kind, kind && named(this.editor.drawing[LISTS[kind]], name));
    this.editor.paint();
  }

  // All that the page says of the editor.
  show(editor) {
    for (const name of Object.keys(TOOLS)) byId(`tool-${name}`).setAttribute("aria-pressed", String(editor.tool === name));
    byId("hint").textContent = TOOLS[editor.tool];
    byId("play").textContent = editor.playing ? "Pause" : "Run";
    byId("play").disabled = !editor.terms;
    byId("undo").disabled = editor.undone.length < 2;
    byId("gravity").checked = editor.drawing.gravity;
    byId("status").textContent = editor.message || describe(editor);
    this.tick(editor);
    this.showParts(editor);
    this.showFields(editor);
    this.keepAddress(editor);
  }

  tick(editor) {
    byId("time").textContent = editor.terms ? `${editor.motion.t.toFixed(2)} s` : "";
    const [kinetic, potential] = editor.motion.energies;
    byId("energy").textContent = editor.terms ? `kinetic ${kinetic.toFixed(3)} J, potential ${potential.toFixed(3)} J` : "";
    const driven = editor.drawing.motors.find((motor) => motor.mode === "drive"), row = editor.terms?.labels.indexOf(`drive of ${driven?.name}`) ?? -1;
    byId("torque").textContent = row < 0 ? "" : `torque of ${driven.name} ${(-editor.motion.multipliers[row]).toFixed(3)} N m`;
  }

  showParts(editor) {
    const list = byId("parts"), chosen = editor.chosen ? `${editor.chosen.kind} ${editor.chosen.name}` : "";
    const options = Object.entries(LISTS).flatMap(([kind, key]) => editor.drawing[key].map((part) => [`${kind} ${part.name}`, partText(kind, part)]));
    list.replaceChildren(element("option", { value: "" }, "choose a part"), ...options.map(([value, text]) => element("option", { value }, text)));
    list.value = chosen;
  }

  showFields(editor) {
    const part = editor.part, place = byId("fields");
    byId("remove").hidden = !part;
    if (place.contains(document.activeElement) && this.shown === JSON.stringify(editor.chosen)) return;
    this.shown = JSON.stringify(editor.chosen);
    place.replaceChildren(...(part ? FIELDS[editor.chosen.kind].map((field) => this.field(editor, part, field)) : []));
  }

  field(editor, part, [key, label, kind, unit]) {
    const chosen = editor.chosen, value = read(part, key);
    const set = (entered) => editor.change((drawing) => {
      const now = named(drawing[LISTS[chosen.kind]], chosen.name);
      if (key === "x" || key === "y") editor.moveTo(now, key === "x" ? [entered, now.y] : [now.x, entered]);
      else write(now, key, entered);
    });
    if (kind === "tick") return this.tick_(label, value, set);
    if (kind === "choice") return this.choice(label, value, (entered) => { set(entered); this.shown = null; document.activeElement.blur(); this.show(editor); });
    const input = element("input", { type: "number", step: "any", value: value ?? "", id: `field-${key}` });
    if (kind === "size") input.placeholder = Number(followed(editor, chosen.kind, part).toPrecision(4));
    input.addEventListener("change", () => this.take(input, kind, `${chosen.kind}.${key}`, set));
    return element("label", {}, label, element("span", {}, input, ` ${unit || UNITS[part.mode] || ""}`));
  }

  // A number that was typed, if the part can have it.
  take(input, kind, what, set) {
    const empty = input.value === "" && kind === "size", entered = empty ? null : Number(input.value);
    const fits = empty || (input.value !== "" && Number.isFinite(entered) && (!POSITIVE.includes(what) || entered > 0));
    input.setAttribute("aria-invalid", String(!fits));
    if (fits) set(entered);
  }

  tick_(label, value, set) {
    const input = element("input", { type: "checkbox" });
    input.checked = value;
    input.addEventListener("change", () => set(input.checked));
    return element("label", { class: "tick" }, input, label);
  }

  choice(label, value, set) {
    const select = element("select", { id: "field-mode" }, ...Object.entries(MODES).map(([mode, text]) => element("option", { value: mode }, text)));
    select.value = value;
    select.addEventListener("change", () => set(select.value));
    return element("label", {}, label, select);
  }

  // -- texts and address

  offer(what, written) {
    byId("text-title").textContent = `The model in ${what}`;
    byId("text-use").textContent = what === "TOML" ? "Save it as drawing.toml, and run: ncgen run drawing.toml" : "Save it as drawing.py, and run: ncgen run drawing.py";
    byId("text-body").value = written(this.editor.drawing);
    byId("copy").textContent = "Copy";
    byId("text").showModal();
    byId("text-body").setSelectionRange(0, 0);
    byId("text-body").scrollTop = 0;
  }

  async copy() {
    const area = byId("text-body");
    area.select();
    try {
      await navigator.clipboard.writeText(area.value);
    } catch {
      document.execCommand("copy"); // where a page from a file may not use the clipboard
    }
    byId("copy").textContent = "Copied";
  }

  keepAddress(editor) {
    const text = JSON.stringify(editor.drawing);
    if (text === this.kept) return;
    this.kept = text;
    history.replaceState(null, "", `#${encodeURIComponent(text)}`);
  }
}

// What is known of the mechanism, in words.
function describe(editor) {
  if (!editor.terms) return editor.drawing.points.length ? "Draw bars or plates between points." : "An empty drawing. Take the bar and click two places.";
  const rows = editor.terms.labels.length, redundant = rows - editor.motion.rank, degrees = editor.degrees;
  const driven = editor.drawing.motors.filter((motor) => motor.mode === "drive").length;
  const count = (n, one, more) => `${n} ${n === 1 ? one : more}`;
  return [count(degrees + driven, "degree of freedom", "degrees of freedom"), ...(driven ? [`${driven} driven`] : []),
    ...(redundant ? [count(redundant, "redundant constraint", "redundant constraints")] : [])].join(", ");
}

function partText(kind, part) {
  const more = { body: () => part.points.join("-"), slider: () => `${part.point} on ${part.start}-${part.end}`, spring: () => `${part.start}-${part.end}`,
    motor: () => `${part.start}-${part.end}`, gear: () => `${part.first}, ${part.second}`, point: () => part.fixed ? "fixed" : "" }[kind]();
  return `${kind} ${part.name}${more ? `: ${more}` : ""}`;
}

// A drawing from the address of the page; null for an address without one.
function drawingFrom(hash) {
  try {
    const given = JSON.parse(decodeURIComponent(hash.slice(1))), clean = emptyDrawing();
    if (!/^\w+$/.test(given.name)) return null;
    clean.name = given.name;
    clean.gravity = Boolean(given.gravity);
    for (const list of Object.values(LISTS)) clean[list] = given[list].map((part) => checkedPart(list, part));
    tidy(clean);
    return clean;
  } catch {
    return null;
  }
}

const PARTS = {
  points: { name: "w", x: "n", y: "n", fixed: "b", traced: "b" }, bodies: { name: "w", points: "ws", mass: "n?" },
  sliders: { name: "w", point: "w", start: "w", end: "w", mass: "n", turns: "b" },
  springs: { name: "w", start: "w", end: "w", stiffness: "n", damping: "n", free: "n?" },
  motors: { name: "w", start: "w", end: "w", mode: "w", value: "n" }, gears: { name: "w", first: "w", second: "w", radii: "ns" },
};

function checkedPart(list, part) {
  const isWord = (x) => typeof x === "string" && /^[A-Za-z]\w{0,30}$/.test(x);
  const checks = { w: isWord, n: Number.isFinite, b: (x) => typeof x === "boolean", ws: (x) => x.every(isWord), "n?": (x) => x === null || Number.isFinite(x),
    ns: (x) => x.length === 2 && x.every(Number.isFinite) };
  return Object.fromEntries(Object.entries(PARTS[list]).map(([key, kind]) => {
    if (!checks[kind](part[key])) throw new Error(`${list}: ${key}`);
    return [key, part[key]];
  }));
}
