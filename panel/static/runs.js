// The folder of runs: how each ended, what was made of it, and what to make of several.

import {act, toast} from "./actions.js";
import {fill, h, num, say} from "./dom.js";
import {query} from "./link.js";
import {afterButtons, fitTable, flags, showJobs} from "./run.js";

export const title = "Runs";

const KINDS = {success: "good", abort: "warn", fail: "bad", damaged: "bad", "cut off": "warn"};
let view = null;
let key = "";
let chosen = new Set();
let opened = "";

export function make(root) {
  const rows = h("tbody");
  const none = h("p", {class: "facts"}, "There are no runs yet: the page Run starts one.");
  const jobs = h("div");
  const detail = h("div");
  const several = (what, label) => h("button", {type: "button", disabled: true, onclick: () => act("job", {what, runs: [...chosen]}, true)}, label);
  const buttons = [several("compare", "Compare"), several("fit", "Fit together"), several("report", "Report of all"), several("package", "Package for a paper")];
  fill(root, h("div", {class: "columns"},
    h("div", {class: "card"}, h("div", {class: "row spread"}, h("h1", {}, "Runs"), h("div", {class: "row", role: "group", "aria-label": "With the chosen runs"}, buttons)), none,
      h("div", {class: "wide"}, h("table", {class: "runs"}, h("thead", {}, h("tr", {}, ["Choose", "Run", "State", "Steps", "Doubts", "Done so far", "Fit"].map((name) => h("th", {scope: "col"}, name)))), rows))),
    h("div", {class: "stack"}, h("section", {class: "card", "aria-label": "One run"}, detail), h("section", {class: "card", "aria-label": "Work"}, h("h2", {}, "Work"), jobs))));
  view = {rows, none, jobs, detail, buttons};
}

export function enter() {
  key = "";
}

export function render(state) {
  showJobs(view.jobs, state.jobs);
  const now = `${state.run.last}|${Boolean(state.run.facts)}|${state.run.facts?.step}|${state.jobs.map((job) => job.number + job.status).join()}`;
  if (now !== key) {
    key = now;
    load();
  }
}

async function load() {
  let found;
  try {
    found = await query("runs");
  } catch (error) {
    return toast(error.message, "bad");
  }
  view.none.hidden = found.length > 0;
  chosen = new Set([...chosen].filter((name) => found.some((run) => run.name === name)));
  fill(view.rows, found.map(line));
  if (!opened && found.length) opened = found[0].name;
  if (opened) show(opened);
  choose();
  return null;
}

function line(run) {
  const box = h("input", {type: "checkbox", checked: chosen.has(run.name), "aria-label": `choose ${run.name}`, onchange: () => { box.checked ? chosen.add(run.name) : chosen.delete(run.name); choose(); }});
  return h("tr", {}, h("td", {}, box),
    h("th", {scope: "row"}, h("button", {type: "button", class: "quiet", onclick: () => show(run.name)}, run.name), run.twin ? h("span", {class: "chip"}, "twin") : null),
    h("td", {}, h("span", {class: `chip ${KINDS[run.status] ?? ""}`}, run.status), run.problem ? h("p", {class: "doubt"}, run.problem) : null),
    h("td", {}, run.planned === undefined ? "–" : `${run.steps} of ${run.planned}`), h("td", {}, run.flags ? String(run.flags) : "none"), h("td", {}, run.has.join(", ") || "–"), h("td", {}, run.verdict ?? "–"));
}

function choose() {
  for (const button of view.buttons) button.disabled = chosen.size === 0;
}

async function show(name) {
  opened = name;
  try {
    const found = await query("run", {name});
    fill(view.detail, h("h2", {}, name), h("p", {}, `${found.status}${found.reason ? `: ${found.reason}` : ""}`), found.warnings?.map((text) => h("p", {class: "doubt"}, text)),
      h("div", {class: "row"}, afterButtons(name, found)),
      h("div", {class: "wide"}, h("table", {}, h("thead", {}, h("tr", {}, ["Gap, mm", "Flux, mT", "Doubts"].map((label) => h("th", {scope: "col"}, label)))), h("tbody", {}, found.steps.map((step) => h("tr", {}, h("th", {scope: "row"}, num(step.gap_mm, 2)), h("td", {}, step.flux_mT === null ? step.flux_status : num(step.flux_mT, 2)), h("td", {}, flags(step.flags))))))),
      found.fit ? fitTable(found.fit) : null,
      h("div", {class: "thumbs"}, found.steps.filter((step) => step.image).map((step) => h("a", {href: `/runs/${encodeURIComponent(name)}/${step.image}`, target: "_blank"}, h("img", {src: `/runs/${encodeURIComponent(name)}/${step.image}?width=240`, alt: `photograph at ${num(step.gap_mm, 1)} mm`, width: 240, loading: "lazy"}), h("span", {}, num(step.gap_mm, 1, "mm"))))));
  } catch (error) {
    fill(view.detail, h("p", {class: "doubt"}, error.message));
  }
}
