// The gap, drawn to scale: magnet, interlock, allowed range, where the tip is, where it goes.

import {fill, num, s} from "./dom.js";

const WIDTH = 560;
const HEIGHT = 104;
const LEFT = 6;

/** Draw the scale into an SVG element. */
export function drawGap(svg, bench) {
  const far = bench.max_gap_mm ?? 150;
  const magnet = Math.min(bench.magnet_mm ?? 30, 60);
  const scale = (WIDTH - 2 * LEFT) / (magnet + far * 1.04);
  const x = (gap) => LEFT + (magnet + gap) * scale;
  const gap = bench.facts.gap_mm;
  const [low, high] = bench.facts.allowed_mm ?? [bench.min_gap_mm, bench.max_gap_mm];
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  const parts = [
    s("rect", {x: x(0), y: 24, width: Math.max(0, x(bench.min_gap_mm ?? 0) - x(0)), height: 36, class: "interlock"}),
    s("rect", {x: x(low ?? 0), y: 24, width: Math.max(0, x(high ?? far) - x(low ?? 0)), height: 36, class: "allowed"}),
    s("rect", {x: LEFT, y: 14, width: magnet * scale, height: 56, rx: 3, class: "magnet"}),
    s("text", {x: LEFT + magnet * scale - 8, y: 47, class: "pole", "text-anchor": "end"}, "N"),
  ];
  for (let mark = 0; mark <= far; mark += 10) {
    const big = mark % 50 === 0;
    parts.push(s("line", {x1: x(mark), x2: x(mark), y1: 60, y2: big ? 70 : 65, class: "tick"}));
    if (big) parts.push(s("text", {x: x(mark), y: 83, "text-anchor": "middle", class: "mark"}, String(mark)));
  }
  parts.push(s("text", {x: WIDTH - LEFT, y: 99, "text-anchor": "end", class: "mark"}, "gap from the N face, mm"));
  parts.push(s("text", {x: x((bench.min_gap_mm ?? 0) / 2), y: 19, "text-anchor": "middle", class: "mark"}, bench.min_gap_mm ? `interlock ${num(bench.min_gap_mm, 0)}` : ""));
  if (bench.target_mm !== null && bench.target_mm !== undefined)
    parts.push(s("path", {d: `M${x(bench.target_mm)} 24v36`, class: "target"}), s("text", {x: x(bench.target_mm), y: 19, "text-anchor": "middle", class: "mark"}, "target"));
  if (gap !== null && gap !== undefined)
    parts.push(s("path", {d: `M${x(gap)} 60l-7 -11h14z M${x(gap)} 24v30`, class: "here"}));
  fill(svg, ...parts);
}
