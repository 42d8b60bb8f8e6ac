// Draw a wanted curve on the picture; get rods that take it, with their bands.

import {act, toast} from "./actions.js";
import {field, fill, h, say, typed} from "./dom.js";
import {link} from "./link.js";
import {draw, pointing, showImage} from "./pointing.js";
import {showJobs} from "./run.js";

export const title = "Design";
export const watches = true;

let view = null;
let shown = "";

export function make(root) {
  const board = pointing({changed: () => {}, label: "wanted curve, from the clamp to the tip"});
  const gap = h("input", {type: "text", inputmode: "decimal", size: 7, value: "60"});
  const side = h("input", {type: "text", size: 12, value: "0.75, 1.35"});
  const moduli = h("input", {type: "text", size: 12, value: "8, 50"});
  const remanence = h("input", {type: "text", inputmode: "decimal", size: 7, value: "20.07"});
  const find = h("button", {type: "button", class: "primary", onclick: seek}, "Find rods");
  const note = h("p", {role: "status"});
  const jobs = h("div");
  const figure = h("div");
  fill(root, h("h1", {class: "hidden-title"}, "Design"), h("div", {class: "columns"},
    h("section", {class: "card", "aria-label": "Curve"}, h("p", {}, "Draw the wanted curve on the picture, from the clamp to the tip: at least three points."), board.element,
      h("div", {class: "row"}, h("button", {type: "button", onclick: take}, "Take the live picture"), h("button", {type: "button", onclick: () => { board.points.pop(); draw(board); }}, "Take the last point away"), h("button", {type: "button", class: "quiet", onclick: () => { board.points = []; draw(board); }}, "Begin anew"))),
    h("section", {class: "card stack", "aria-label": "Designs"}, h("div", {class: "row"}, field("At a gap of, mm", gap), field("Side from, to, mm", side), field("Moduli from, to, MPa", moduli), field("Remanence, mT", remanence)), find, note, figure, jobs)));
  view = {board, gap, side, moduli, remanence, note, figure, jobs};
}

async function take() {
  try {
    await showImage(view.board, `/api/picture?${Date.now()}`, link.state?.camera.size_px ?? null);
  } catch (error) {
    toast(error.message, "bad");
  }
}

function pair(text) {
  const found = text.split(/[,;\s]+/).filter(Boolean).map(typed);
  if (found.length !== 2 || found.some(Number.isNaN)) throw new Error("A range is two numbers, from and to.");
  return found;
}

async function seek() {
  let values;
  try {
    values = {points: view.board.points, gap_mm: typed(view.gap.value), side_mm: pair(view.side.value), E_MPa: pair(view.moduli.value), remanence_mT: typed(view.remanence.value)};
  } catch (error) {
    return toast(error.message, "bad");
  }
  return act("design", values);
}

export function render(state) {
  say(view.note, state.files.calibration ? "" : "The camera is not calibrated: do that on the page Set up first.");
  const jobs = state.jobs.filter((job) => job.what === "design").slice(0, 3);
  showJobs(view.jobs, jobs);
  const done = jobs.find((job) => job.status === "done");
  if (done && done.run !== shown) {
    shown = done.run;
    fill(view.figure, h("img", {class: "wide-picture figure", src: `/api/design-figure?name=${encodeURIComponent(done.run)}`, alt: "wanted curve and the designs, with the bands that hold 95 % of the rods made"}), h("pre", {}, done.lines.join("\n")));
  }
}
