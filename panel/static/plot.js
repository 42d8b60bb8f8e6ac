// Two plots, drawn as SVG: shapes in millimetres, and flux against gap.

import {fill, num, s} from "./dom.js";

const PAD = {left: 52, right: 12, top: 12, bottom: 40};

/** Round marks of an axis. */
function marks(low, high, count = 5) {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= raw);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9; value += step) found.push(value);
  return found;
}

function frame(svg, {width, height, x, y, xName, yName, equal}) {
  let [x0, x1] = x;
  let [y0, y1] = y;
  const wide = width - PAD.left - PAD.right;
  const high = height - PAD.top - PAD.bottom;
  if (equal) {
    const scale = Math.min(wide / (x1 - x0), high / (y1 - y0));
    const midX = (x0 + x1) / 2, midY = (y0 + y1) / 2;
    [x0, x1] = [midX - wide / scale / 2, midX + wide / scale / 2];
    [y0, y1] = [midY - high / scale / 2, midY + high / scale / 2];
  }
  const px = (value) => PAD.left + ((value - x0) / (x1 - x0)) * wide;
  const py = (value) => PAD.top + high - ((value - y0) / (y1 - y0)) * high;
  const tidy = (value) => String(Math.round(value * 1e6) / 1e6).replace("-", "−");
  const parts = [
    ...marks(x0, x1, width / 90).flatMap((value) => [s("line", {x1: px(value), x2: px(value), y1: PAD.top, y2: PAD.top + high, class: "grid"}), s("text", {x: px(value), y: PAD.top + high + 16, "text-anchor": "middle", class: "mark"}, tidy(value))]),
    ...marks(y0, y1, height / 60).flatMap((value) => [s("line", {x1: PAD.left, x2: PAD.left + wide, y1: py(value), y2: py(value), class: "grid"}), s("text", {x: PAD.left - 6, y: py(value) + 4, "text-anchor": "end", class: "mark"}, tidy(value))]),
    s("text", {x: PAD.left + wide / 2, y: height - 6, "text-anchor": "middle", class: "mark"}, xName),
    s("text", {x: 12, y: PAD.top + high / 2, transform: `rotate(-90 12 ${PAD.top + high / 2})`, "text-anchor": "middle", class: "mark"}, yName),
  ];
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  return {px, py, parts};
}

function line(points, px, py, attributes) {
  return s("polyline", {points: points.map(([x, y]) => `${px(x).toFixed(1)},${py(y).toFixed(1)}`).join(" "), fill: "none", ...attributes});
}

/** Draw shapes: [{points, label, kind}], in mm with equal scales. */
export function drawShapes(svg, shapes) {
  const all = shapes.flatMap((shape) => shape.points);
  if (!all.length) return fill(svg);
  const xs = all.map(([x]) => x), ys = all.map(([, y]) => y);
  const room = 2;
  const {px, py, parts} = frame(svg, {width: 560, height: 340, x: [Math.min(...xs, 0) - room, Math.max(...xs) + room], y: [Math.min(...ys, 0) - room, Math.max(...ys) + room], xName: "x, mm", yName: "y, mm", equal: true});
  shapes.forEach((shape, index) => {
    parts.push(line(shape.points, px, py, {class: shape.kind ?? "shape", "stroke-opacity": shape.kind ? 1 : 0.45 + (0.55 * (index + 1)) / shapes.length}));
    const [x, y] = shape.points.at(-1);
    if (shape.label) parts.push(s("text", {x: px(x) + 6, y: py(y) + 4, class: "label"}, shape.label));
  });
  fill(svg, ...parts);
}

/** Draw flux against gap: the model's line, the readings with their deviations. */
export function drawFlux(svg, model, steps) {
  const line_ = model.filter(([, flux]) => flux !== null);
  const read = steps.filter((step) => step.flux_mT !== null);
  const all = [...line_, ...read.map((step) => [step.gap_mm, step.flux_mT])];
  if (!all.length) return fill(svg);
  const xs = all.map(([x]) => x), ys = all.map(([, y]) => y);
  const {px, py, parts} = frame(svg, {width: 560, height: 260, x: [Math.min(...xs) - 3, Math.max(...xs) + 3], y: [Math.min(...ys, 0), Math.max(...ys) * 1.08], xName: "gap, mm", yName: "flux density, mT"});
  parts.push(line([...line_].sort((a, b) => a[0] - b[0]), px, py, {class: "model"}));
  for (const step of read) {
    const sd = step.flux_sd_mT ?? 0;
    parts.push(s("line", {x1: px(step.gap_mm), x2: px(step.gap_mm), y1: py(step.flux_mT - 2 * sd), y2: py(step.flux_mT + 2 * sd), class: "model"}),
      s("circle", {cx: px(step.gap_mm), cy: py(step.flux_mT), r: 4.5, class: "reading"}, s("title", {}, `${num(step.gap_mm, 1)} mm: ${num(step.flux_mT, 2)} mT`)));
  }
  fill(svg, ...parts);
}
