// The live picture with the measured and the predicted line over it.

import {fill, h, num, say} from "./dom.js";
import {on} from "./link.js";

const NAMES = {
  "magnet.nominal": "magnet, nominal moduli",
  "magnet.fitted": "magnet, fitted moduli",
  "uniform.nominal": "uniform field, nominal",
  "uniform.fitted": "uniform field, fitted",
};
const COLOURS = {measured: "#ff9d2e", "magnet.nominal": "#37c2ff", "magnet.fitted": "#c79bff", "uniform.nominal": "#7fe07f", "uniform.fitted": "#ffd84d"};
const DASHES = {measured: [], "magnet.nominal": [10, 5], "magnet.fitted": [3, 4], "uniform.nominal": [14, 4, 2, 4], "uniform.fitted": [6, 6]};

/** Make the figure; returns {element, render}. */
export function picture({plain = false} = {}) {
  const live = h("canvas", {width: 1600, height: 1200, "aria-hidden": "true"});
  const over = h("canvas", {width: 1600, height: 1200, role: "img", "aria-label": "live picture; the misfits are in the table below"});
  const facts = h("p", {class: "facts"});
  const doubt = h("p", {class: "doubt", hidden: true});
  const rows = h("tbody");
  const shown = {measured: true, "magnet.nominal": true, "magnet.fitted": true, "uniform.nominal": false, "uniform.fitted": false};
  const element = h("figure", {class: "card picture"},
    h("div", {class: "screen"}, live, over, h("p", {class: "no-picture"}, "no picture yet")),
    h("figcaption", {}, facts, plain ? null : [doubt,
      h("table", {class: "misfits"},
        h("thead", {}, h("tr", {}, ...["Line", "Misfit, RMS mm", "Tip off, mm", "State"].map((name) => h("th", {scope: "col"}, name)))), rows)]));
  const screen = {plain, marks: [], element, live, over, facts, doubt, rows, shown, drawn: null, newest: null, delays: [], rowFor: new Map()};
  on("picture", (news) => { if (!element.closest("[hidden]")) showPicture(screen, news); });
  on("overlay", (news) => { if (!element.closest("[hidden]")) showOverlay(screen, news); });
  new ResizeObserver(() => draw(screen)).observe(element);
  return {element, render: (state) => showFacts(screen, state), screen};
}

function showPicture(screen, news) {
  const {live} = screen;
  if (live.width !== news.bitmap.width || live.height !== news.bitmap.height) {
    live.width = news.bitmap.width;
    live.height = news.bitmap.height;
    live.parentElement.style.aspectRatio = `${live.width} / ${live.height}`;
  }
  live.getContext("2d").drawImage(news.bitmap, 0, 0);
  news.bitmap.close();
  screen.element.classList.add("has-picture");
  screen.newest = {number: news.number, size: news.size_px, age: news.age_s, at: news.receivedAt};
  screen.times = [...(screen.times ?? []), performance.now()].slice(-30);
}

function showOverlay(screen, news) {
  screen.drawn = news;
  screen.delays = [...screen.delays, news.late_ms].slice(-30);
  draw(screen);
  if (!screen.plain) showMisfits(screen, news);
}

/** Mark points over the picture, in its pixels. */
export function markPoints(screen, points) {
  screen.marks = points;
  draw(screen);
}

function draw(screen) {
  const {over, live, drawn, newest} = screen;
  const box = over.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  if (!box.width) return;
  over.width = Math.round(box.width * ratio);
  over.height = Math.round(box.height * ratio);
  const pen = over.getContext("2d");
  pen.clearRect(0, 0, over.width, over.height);
  if (!newest) return;
  pen.scale(over.width / (newest.size?.[0] ?? live.width), over.height / (newest.size?.[1] ?? live.height));
  const width = (newest.size?.[0] ?? live.width) / box.width;
  for (const [x, y] of screen.marks) dot(pen, x, y, width);
  if (!drawn || screen.plain) return;
  // The dashed predictions lie over the measured line, so that both show where they agree.
  if (screen.shown.measured && drawn.measured_px?.length) stroke(pen, drawn.measured_px, COLOURS.measured, [], width, 2.5, true);
  for (const [name, shape] of Object.entries(drawn.predicted ?? {}))
    if (screen.shown[name] && shape.px) stroke(pen, shape.px, COLOURS[name], DASHES[name], width, 2.5);
}

function dot(pen, x, y, width) {
  pen.beginPath();
  pen.arc(x, y, 4 * width, 0, 7);
  pen.fillStyle = "#37c2ff";
  pen.fill();
  pen.lineWidth = 1.5 * width;
  pen.strokeStyle = "rgba(0,0,0,.6)";
  pen.stroke();
}

function stroke(pen, points, colour, dash, width, weight, cased = false) {
  const path = new Path2D();
  points.forEach(([x, y], index) => (index ? path.lineTo(x, y) : path.moveTo(x, y)));
  pen.lineJoin = pen.lineCap = "round";
  if (cased) {
    pen.setLineDash([]);
    pen.strokeStyle = "rgba(0,0,0,.55)";
    pen.lineWidth = (weight + 2) * width;
    pen.stroke(path);
  }
  pen.setLineDash(dash.map((part) => part * width));
  pen.strokeStyle = colour;
  pen.lineWidth = weight * width;
  pen.stroke(path);
}

function showMisfits(screen, news) {
  say(screen.doubt, news.status === "ok" ? "" : `Not measured: ${news.reason}`);
  screen.doubt.hidden = news.status === "ok";
  row(screen, "measured", "measured", news.status === "ok" ? ["", "", (news.flags ?? []).filter((flag) => flag !== "uncalibrated").join(", ") || (news.calibrated ? "good" : "in pixels: calibrate the camera")] : ["–", "–", "not measured"]);
  for (const name of Object.keys(NAMES)) {
    const shape = news.predicted?.[name];
    if (!shape) {
      screen.rowFor.get(name)?.line.remove();
      screen.rowFor.delete(name);
      continue;
    }
    row(screen, name, NAMES[name], [num(shape.misfit_mm, 3), num(shape.tip_off_mm, 3), shape.why_not ?? shape.status]);
  }
}

function row(screen, name, label, values) {
  let found = screen.rowFor.get(name);
  if (!found) {
    const box = h("input", {type: "checkbox", checked: screen.shown[name], onchange: () => { screen.shown[name] = box.checked; draw(screen); }});
    const swatch = h("span", {class: "swatch", "aria-hidden": "true"});
    swatch.style.background = COLOURS[name];
    const cells = values.map(() => h("td", {}));
    const line = h("tr", {"data-line": name}, h("th", {scope: "row"}, h("label", {}, box, swatch, label)), cells);
    found = {cells, line};
    screen.rowFor.set(name, found);
    screen.rows.append(line);
  }
  values.forEach((value, index) => say(found.cells[index], value));
}

function showFacts(screen, state) {
  const {camera} = state;
  const newest = screen.newest;
  const age = newest ? newest.age + (performance.now() - newest.at) / 1000 : null;
  const late = screen.delays.length ? screen.delays.reduce((sum, each) => sum + each, 0) / screen.delays.length : null;
  const times = screen.times ?? [];
  const rate = times.length > 1 ? ((times.length - 1) * 1000) / (times.at(-1) - times[0]) : 0;
  screen.rate = rate;
  screen.element.classList.toggle("stale", age !== null && age > 2.5);
  say(screen.facts, newest
    ? `${num(rate, 0)} pictures a second · newest ${age > 1 ? num(age, 1, "s") : num(age * 1000, 0, "ms")} old · ${newest.size?.join(" × ")} px · theory ${num(camera.overlays_per_s, 0)} times a second, ${num(late, 0, "ms")} after its picture`
    : camera.trouble || "waiting for the first picture");
}
