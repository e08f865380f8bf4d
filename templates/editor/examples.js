"use strict";
// Mechanisms to begin with.

const bars = (drawing, names) => names.forEach((pair) => addBodyOf(drawing, pair.split("")));

function drawn(points, fixed, parts) {
  const drawing = emptyDrawing();
  for (const [x, y] of points) addPoint(drawing, [x, y]);
  for (const name of fixed) named(drawing.points, name).fixed = true;
  parts(drawing);
  return drawing;
}

const EXAMPLES = {
  "Four-bar": () => drawn([[0, 0], [0.1, 0], [0.35, 0.3], [0.4, 0], [0.3, 0.45]], "AD", (d) => {
    bars(d, ["AB", "BCE", "CD"]);
    motorOf(d, d.bodies[0], "drive");
    named(d.points, "E").traced = true;
  }),
  "Slider-crank": () => drawn([[0, 0], [0, 0.1], [0.35, 0], [0.6, 0]], "AD", (d) => {
    bars(d, ["AB", "BC"]);
    addSliderOf(d, "C", "A", "D");
    motorOf(d, d.bodies[0], "drive");
  }),
  "Watt six-bar": () => drawn([[0, 0], [0.1, 0], [0.35, 0.3], [0.4, 0], [0.25, 0.5], [0.6, 0.25], [0.6, 0.5]], "AD", (d) => {
    bars(d, ["AB", "BCE", "CDF", "EG", "FG"]);
    motorOf(d, d.bodies[0], "drive");
    named(d.points, "G").traced = true;
  }),
  "Two gears": () => drawn([[0, 0], [0.1, 0.1], [0.3, 0], [0.3, 0.1], [0.45, 0.4]], "AC", (d) => {
    bars(d, ["AB", "CD", "BE", "DE"]);
    const gear = addGearOf(d, d.bodies[0], d.bodies[1]);
    gear.radii = [0.1, 0.2];
    Object.assign(d.motors[0], { mode: "drive", value: 3 });
    named(d.points, "E").traced = true;
  }),
  "Pendulum on a spring": () => drawn([[0, 0], [0.5, 0], [0.8, -0.3]], "A", (d) => {
    bars(d, ["AB", "BC"]);
    const anchor = addPoint(d, [0.5, 0.5], true);
    addSpringOf(d, anchor.name, "B");
    named(d.points, "C").traced = true;
  }),
};
