// Point at clamp, tip and ruler in a photograph that is not measured by itself.

import {act, toast} from "./actions.js";
import {field, fill, h, say, typed} from "./dom.js";
import {query} from "./link.js";
import {draw, pointing, showImage} from "./pointing.js";
import {showJobs} from "./run.js";

export const title = "Point";

let view = null;
let ruler = [];
let done = "";

export function make(root) {
  const board = pointing({changed: told, label: "photograph"});
  const photo = h("select", {onchange: () => load(photo.value)});
  const what = h("select", {onchange: turn}, h("option", {value: "rod"}, "the rod: clamp, points between, tip"), h("option", {value: "ruler"}, "the ruler: two ticks"));
  const length = h("input", {type: "text", inputmode: "decimal", size: 7, value: "50"});
  const note = h("p", {role: "status"});
  const measure = h("button", {type: "button", class: "primary", onclick: send}, "Measure the rod");
  const jobs = h("div");
  const overlay = h("div");
  fill(root, h("h1", {class: "hidden-title"}, "Point"), h("div", {class: "columns"},
    h("section", {class: "card", "aria-label": "Photograph"}, field("Photograph", photo), board.element),
    h("section", {class: "card stack", "aria-label": "Points"}, h("p", {}, "Point at the rod where it leaves the clamp, then at its tip (between them where the way is not plain). Points can be dragged. The rod's edges decide where it lies; you say which thing it is."),
      field("I point at", what), field("The ruler's ticks are apart by, mm", length, "without a ruler the bench's calibration gives the scale"),
      h("div", {class: "row"}, measure, h("button", {type: "button", onclick: () => { rodOf(board).pop(); draw(board); told(board.points); }}, "Take the last point away"), h("button", {type: "button", class: "quiet", onclick: clear}, "Begin anew")), note, jobs, overlay)));
  view = {board, photo, what, length, note, measure, jobs, overlay, rod: []};
  listPhotos();
}

function rodOf(board) {
  return board.points;
}

async function listPhotos() {
  try {
    const found = await query("photos");
    fill(view.photo, found.map((name) => h("option", {value: name}, name)));
    if (found.length) load(found[0]);
    else say(view.note, "There are no photographs yet: those of runs, and those in the bench's folder, can be pointed at.");
  } catch (error) {
    say(view.note, error.message);
  }
}

async function load(name) {
  clear();
  try {
    const {size_px: size} = await query("photo-size", {name});
    await showImage(view.board, `/api/photo?${new URLSearchParams({name, width: 1600})}`, size);
  } catch (error) {
    toast(error.message, "bad");
  }
}

/** Turn from the rod to the ruler, or back. */
function turn() {
  const {board} = view;
  [board.points, view.other] = [view.other ?? [], board.points];
  board.marks = [{points: view.other, colour: view.what.value === "rod" ? "#ffd84d" : "#c79bff"}];
  draw(board);
}

function clear() {
  view.board.points = [];
  view.other = [];
  view.board.marks = [];
  draw(view.board);
  say(view.note, "");
}

function told(points) {
  const isRuler = view.what.value === "ruler";
  if (isRuler && points.length > 2) points.splice(0, points.length - 2);
  draw(view.board);
}

async function send() {
  const isRuler = view.what.value === "ruler";
  const rod = isRuler ? view.other ?? [] : view.board.points;
  ruler = isRuler ? view.board.points : view.other ?? [];
  const values = {photo: view.photo.value, points: rod};
  if (ruler.length === 2) Object.assign(values, {ruler, ruler_mm: typed(view.length.value)});
  if (values.ruler && Number.isNaN(values.ruler_mm)) return toast("The ruler's length is a number of mm.", "bad");
  done = "";
  return act("point", values);
}

export function render(state) {
  const jobs = state.jobs.filter((job) => job.what === "points").slice(0, 2);
  showJobs(view.jobs, jobs);
  const last = jobs[0];
  if (last?.status === "done" && done !== String(last.number)) {
    done = String(last.number);
    const out = last.command.match(/--out (\S+)/)?.[1] ?? "measured";
    const name = view.photo.value.split("/").at(-1).replace(/\.\w+$/, ".png");
    fill(view.overlay, h("img", {src: `/api/photo?${new URLSearchParams({name: `${out}/overlays/${name}`, width: 1000})}&${last.number}`, alt: "what was measured", class: "wide-picture"}));
  }
}
