// A run: the plan with what it should show, the run itself, and what is made of it.

import {act, ask, toast} from "./actions.js";
import {clock, field, fill, h, num, s, say, typed} from "./dom.js";
import {query} from "./link.js";
import {picture} from "./picture.js";
import {drawFlux, drawShapes} from "./plot.js";

export const title = "Run";
export const watches = true;

const DOING = {homing: "homing", moving: "moving", settling: "waiting until the rod is still", measuring: "reading the field", photographing: "photographing", paused: "paused", idle: "between steps", retracting: "retracting", over: "over"};
let view = null;
let shownRun = "";
let detailKey = "";
let foreseeTimer = 0;
let foreseen = 0;

export function make(root) {
  const live = picture();
  const plan = planCard();
  const going = goingCard();
  const result = resultCard();
  view = {live, plan, going, result};
  fill(root, h("h1", {class: "hidden-title"}, "Run"),
    h("div", {class: "columns"}, h("div", {class: "stack"}, going.element, result.element, live.element), plan.element));
  load();
}

export function enter() {
  detailKey = "";
}

// The plan

function planCard() {
  const inputs = {
    name: h("input", {type: "text", maxlength: 80}),
    operator: h("input", {type: "text", maxlength: 80}),
    gaps_mm: h("textarea", {rows: 2, spellcheck: "false"}),
    settle_s: h("input", {type: "text", inputmode: "decimal", size: 6}),
    frames: h("input", {type: "number", min: 1, max: 99}),
    samples: h("input", {type: "number", min: 1, max: 10000}),
    abort: h("select", {}, h("option", {value: "hold"}, "stay where it is"), h("option", {value: "retract"}, "retract from the magnet")),
  };
  const readings = h("input", {type: "text", inputmode: "decimal"});
  const byHand = h("div", {hidden: true}, field("Readings of the hand meter, mT, one a gap", readings, "left empty, the run has no field readings"));
  const problem = h("p", {class: "doubt", role: "alert"});
  const total = h("p", {class: "facts"});
  const plot = s("svg", {class: "plot", role: "img", "aria-label": "predicted shape at each gap"});
  const rows = h("tbody");
  const start = h("button", {type: "button", class: "primary", onclick: startRun}, "Start the run");
  const save = h("button", {type: "button", onclick: savePlan}, "Save the plan");
  const touched = new Set();
  const change = (event) => { touched.add(event.target); later(); };
  const form = h("form", {class: "form", oninput: change, onsubmit: (event) => event.preventDefault()},
    field("Name", inputs.name), field("Operator", inputs.operator),
    field("Gaps, mm, from far to near", inputs.gaps_mm, "with commas between them; or from:to:step, such as 90:50:-5"),
    h("div", {class: "row"}, field("Settle at least, s", inputs.settle_s), field("Pictures a step", inputs.frames), field("Field readings", inputs.samples)),
    field("If it is aborted", inputs.abort), byHand);
  const element = h("section", {class: "card", "aria-label": "Plan"},
    h("h2", {}, "Plan"), form, problem, h("h3", {}, "What it should show"), plot,
    h("div", {class: "wide"}, h("table", {}, h("thead", {}, h("tr", {}, ["Step", "Gap, mm", "Flux, mT", "Time, s", "State"].map((name) => h("th", {scope: "col"}, name)))), rows)), total,
    h("div", {class: "row"}, start, save));
  return {element, inputs, touched, readings, byHand, problem, total, plot, rows, start, save};
}

async function load() {
  const {inputs, touched, problem} = view.plan;
  try {
    const {values} = await query("plan");
    // What somebody has typed meanwhile stays.
    for (const [name, input] of Object.entries(inputs)) if (!touched.has(input)) input.value = name === "gaps_mm" ? values.gaps_mm.join(", ") : values[name];
    foresee();
  } catch (error) {
    say(problem, error.message);
  }
}

function gaps(text) {
  const range = text.match(/^\s*([^:]+):([^:]+):([^:]+)\s*$/);
  if (!range) return text.split(/[,;\s]+/).filter(Boolean).map(typed);
  const [from, to, step] = range.slice(1).map(typed);
  const found = [];
  if (step) for (let gap = from; step < 0 ? gap >= to - 1e-9 : gap <= to + 1e-9; gap += step) found.push(Math.round(gap * 1e6) / 1e6);
  return found.slice(0, 1001);
}

function values() {
  const {inputs} = view.plan;
  const list = gaps(inputs.gaps_mm.value);
  if (!list.length || list.some(Number.isNaN)) throw new Error("Gaps are numbers in mm, such as 70, 60, 50.");
  const settle = typed(inputs.settle_s.value);
  if (Number.isNaN(settle)) throw new Error("The time to settle is a number of seconds.");
  return {name: inputs.name.value, operator: inputs.operator.value, gaps_mm: list, settle_s: settle, frames: Number(inputs.frames.value), samples: Number(inputs.samples.value), abort: inputs.abort.value};
}

function later() {
  clearTimeout(foreseeTimer);
  foreseeTimer = setTimeout(foresee, 300);
}

async function foresee() {
  const {plan} = view;
  const mine = ++foreseen;
  try {
    const found = await query("plan", {values: JSON.stringify(values())});
    if (mine !== foreseen) return;
    say(plan.problem, "");
    plan.start.disabled = false;
    fill(plan.rows, found.steps.map((step) => h("tr", {}, h("th", {scope: "row"}, String(step.index + 1)), ...[num(step.gap_mm, 2), num(step.flux_mT, 2), num(step.time_s, 0), step.status].map((text) => h("td", {}, text)))));
    drawShapes(plan.plot, found.steps.filter((step) => step.shape_mm).map((step) => ({points: step.shape_mm, label: num(step.gap_mm, 0)})));
    say(plan.total, `About ${clock(found.total_s)} with homing. Every gap is inside the limits; nothing has moved.`);
  } catch (error) {
    if (mine !== foreseen) return;
    say(plan.problem, error.message);
    plan.start.disabled = true;
  }
}

async function savePlan() {
  try {
    return await act("plan-save", values());
  } catch (error) {
    toast(error.message, "bad");
    return null;
  }
}

async function startRun() {
  if (await savePlan()) {
    const read = view.plan.byHand.hidden ? [] : view.plan.readings.value.split(/[;\s]+|,\s+/).filter(Boolean).map(typed);
    const answer = await act("run-start", {flux_mT: read});
    if (answer) detailKey = "";
  }
}

// The run

function goingCard() {
  const head = h("h2", {});
  const line = h("p", {class: "facts", role: "status"});
  const bar = h("progress", {max: 1, value: 0, "aria-label": "steps done"});
  const left = h("p", {});
  const pause = h("button", {type: "button", onclick: () => act("run-pause")}, "Pause");
  const resume = h("button", {type: "button", class: "primary", onclick: () => act("run-resume")}, "Go on");
  const abort = h("button", {type: "button", class: "danger", onclick: abortRun}, "Abort …");
  const element = h("section", {class: "card", "aria-label": "The run", hidden: true}, head, bar, left, line, h("div", {class: "row"}, pause, resume, abort));
  return {element, head, line, bar, left, pause, resume, abort};
}

async function abortRun() {
  if (await ask("Abort the run?", "The stage is held and the ending written. What was recorded stays, and the run can be resumed.", "Abort it")) await act("run-abort");
}

function resultCard() {
  const head = h("h2", {});
  const ending = h("p", {});
  const rows = h("tbody");
  const thumbs = h("div", {class: "thumbs"});
  const plot = s("svg", {class: "plot", role: "img", "aria-label": "flux density against gap"});
  const fit = h("div", {});
  const jobs = h("div", {class: "jobs"});
  const buttons = h("div", {class: "row"});
  const element = h("section", {class: "card", "aria-label": "Steps of the run", hidden: true}, head, ending, buttons, jobs, fit,
    h("div", {class: "wide"}, h("table", {}, h("thead", {}, h("tr", {}, ["Step", "Gap, mm", "Flux, mT", "Settled", "Doubts"].map((name) => h("th", {scope: "col"}, name)))), rows)), thumbs, plot);
  return {element, head, ending, rows, thumbs, plot, fit, jobs, buttons};
}

export function render(state) {
  view.live.render(state);
  const {run} = state;
  view.plan.byHand.hidden = state.files.meter !== "manual";
  const {going, result} = view;
  const facts = run.facts;
  going.element.hidden = !facts && !run.starting;
  view.plan.start.disabled = Boolean(facts) || run.starting || Boolean(view.plan.problem.textContent);
  if (facts) {
    const paused = facts.state === "paused";
    say(going.head, facts.command === "rig run" ? `Run ${facts.name ?? ""}: step ${facts.step ?? 0} of ${facts.steps ?? "?"}, ${DOING[facts.state] ?? facts.state}` : `The bench is held by magbend ${facts.command}`);
    going.bar.max = facts.steps || 1;
    going.bar.value = Math.max(0, (facts.step || 1) - 1);
    say(going.left, `${facts.time_left_s === null || facts.time_left_s === undefined ? "" : `about ${clock(facts.time_left_s)} left · `}gap ${num(facts.gap_mm, 2, "mm")} · flux ${num(facts.flux_mT, 2, "mT")}`);
    say(going.line, facts.line ?? "");
    going.pause.hidden = paused || facts.command !== "rig run";
    going.resume.hidden = !paused;
  } else if (run.starting) {
    say(going.head, "The run is starting …");
    going.pause.hidden = going.resume.hidden = true;
  }
  if (run.last && run.last !== shownRun) shownRun = run.last;
  result.element.hidden = !shownRun;
  const key = `${shownRun}|${facts?.step}|${facts?.state}|${Boolean(facts)}|${state.jobs.map((job) => job.number + job.status).join()}`;
  if (shownRun && key !== detailKey) {
    detailKey = key;
    detail(shownRun, Boolean(facts));
  }
  showJobs(result.jobs, state.jobs.filter((job) => job.run === shownRun));
}

async function detail(name, running) {
  const {result} = view;
  let found;
  try {
    found = await query("run", {name});
  } catch (error) {
    say(result.ending, error.message);
    return;
  }
  say(result.head, `${name}: ${found.steps.length} of ${found.planned} steps`);
  say(result.ending, running ? "" : `${found.status}${found.reason ? `: ${found.reason}` : ""}`);
  fill(result.rows, found.steps.map((step) => h("tr", {}, h("th", {scope: "row"}, String(step.index + 1)), h("td", {}, num(step.gap_mm, 2)), h("td", {}, step.flux_mT === null ? step.flux_status : num(step.flux_mT, 2)), h("td", {}, `${step.settle} after ${num(step.settle_s, 1)} s`), h("td", {}, flags(step.flags)))));
  fill(result.thumbs, found.steps.filter((step) => step.image).map((step) => h("a", {href: `/runs/${encodeURIComponent(name)}/${step.image}`, target: "_blank"}, h("img", {src: `/runs/${encodeURIComponent(name)}/${step.image}?width=240`, alt: `photograph at ${num(step.gap_mm, 1)} mm`, width: 240, loading: "lazy"}), h("span", {}, num(step.gap_mm, 1, "mm")))));
  drawFlux(result.plot, found.model_mT, found.steps);
  fill(result.buttons, running ? [] : afterButtons(name, found));
  fill(result.fit, found.fit ? fitTable(found.fit) : null);
}

/** The doubts of a step, each with what it means. */
export function flags(list) {
  return list.length ? h("ul", {class: "flags"}, list.map((flag) => h("li", {}, h("strong", {}, flag.name), ` ${flag.means}`))) : "none";
}

/** What can be made of a run that is over. */
export function afterButtons(name, found) {
  const job = (what, label, ready = true) => h("button", {type: "button", disabled: !ready, class: ready && !found.has.includes(what) ? "primary" : "", onclick: () => act("job", {what, runs: [name]}, true)}, found.has.includes(what) ? `${label} again` : label);
  const over = found.status !== "success" && found.steps.length < found.planned;
  return [
    over ? h("button", {type: "button", class: "primary", onclick: () => act("run-start", {resume: name})}, "Resume the run") : null,
    job("extract", "Extract", found.steps.some((step) => step.image)), job("fit", "Fit", found.has.includes("extract")), job("report", "Report", found.has.includes("extract")),
    h("button", {type: "button", onclick: () => act("job", {what: "verify", runs: [name]}, true)}, "Verify"),
    found.has.includes("report") ? h("a", {class: "button", href: `/runs/${encodeURIComponent(name)}/report.html`, target: "_blank"}, "Open the report") : null,
  ];
}

/** What a fit found, and what it is worth. */
export function fitTable(fit) {
  const known = (fit.E_MPa ?? []).map((value, index) => h("tr", {}, h("th", {scope: "row"}, `section ${index + 1}`), h("td", {}, value === null ? "not identifiable" : `${num(value, 2)} ± ${num(fit.E_sd_MPa[index], 2)} MPa`)));
  const verdict = h("span", {class: `chip ${{supported: "good", doubtful: "warn", contradicted: "bad"}[fit.verdict] ?? ""}`}, fit.verdict ?? "no verdict");
  const likely = fit.reasons?.length ? (fit.suspects ?? []).slice(0, 3).map((one) => one.value === null ? one.name : `${one.name} = ${num(one.value, 3)} ± ${num(one.sd, 3)} ${one.unit}`) : [];
  return [h("h3", {}, "Fitted moduli ", verdict), h("table", {}, h("tbody", {}, known)), (fit.reasons ?? []).map((reason) => h("p", {class: "doubt"}, reason)),
    likely.length ? h("p", {class: "doubt"}, `Would explain it, best first: ${likely.join("; ")}.`) : null,
    fit.rests_on?.length ? h("p", {class: "facts"}, `No photograph tests what the moduli rest on: ${fit.rests_on.map((told) => told.sentence).join(", ")}.`) : null,
    h("p", {class: "facts"}, `χ² over degrees of freedom ${num(fit.chi2_reduced, 2)}, p ${num(fit.p_value, 3)}. ${(fit.degenerate_directions ?? []).join(" ")}`)];
}

/** The jobs, each with its command, its progress and what it said. */
export function showJobs(element, jobs) {
  const key = JSON.stringify(jobs.map((job) => [job.number, job.status, job.lines.length, job.done]));
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  fill(element, jobs.slice(0, 6).map((job) => h("details", {class: `job ${job.status}`, open: job.status === "failed" || job.status === "running"},
    h("summary", {}, `${job.what}: ${job.status}${job.total ? `, ${job.done} of ${job.total}` : ""}${job.time_s ? `, ${num(job.time_s, 0)} s` : ""}`),
    h("p", {class: "facts"}, "By hand: ", h("code", {}, job.command)), h("pre", {}, job.lines.join("\n")))));
}
