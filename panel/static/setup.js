// The guided path: each step says what it needs, does it, and can be done again.

import {act, ask, toast} from "./actions.js";
import {field, fill, h, num, say, typed} from "./dom.js";
import {link, query} from "./link.js";
import {markPoints, picture} from "./picture.js";
import {cameraCard} from "./camera.js";
import {showJobs} from "./run.js";

export const title = "Set up";
export const watches = true;

const NAMES = {
  files: "A folder for the bench", stage: "Stage: port and settings", gap: "Home, gauge, set the gap", interlock: "Interlock",
  camera: "Camera", board: "Calibrate with the board", height: "Rod height, and which way is up", meter: "Tesla-meter: zero and sign",
  magnet: "Magnet: scan and fit", specimen: "Specimen", plan: "Dry run",
};
const UPS = {"camera looks down": [0, 0, 1], "rod's left side is up": [0, 1, 0], "rod's right side is up": [0, -1, 0], "rod points up": [1, 0, 0], "rod hangs down": [-1, 0, 0]};
let view = null;
let known = {values: {}, steps: [], marks: {}, shots: [], audit: [], meters: []};
let chosen = "";
let timer = 0;
let loadedAt = 0;

export function make(root) {
  const list = h("ol", {class: "steps"});
  const panel = h("section", {class: "card step", "aria-live": "off"});
  const live = picture({plain: true});
  const camera = cameraCard();
  const aside = h("div", {class: "stack", hidden: true}, live.element, camera.element);
  fill(root, h("h1", {class: "hidden-title"}, "Set up"), h("div", {class: "path"}, h("nav", {class: "card", "aria-label": "Steps"}, list), panel, aside));
  view = {list, panel, live, camera, aside};
  panel.addEventListener("input", () => { isTyped = true; });
  load(true);
}

export function enter() {
  clearInterval(timer);
  timer = setInterval(watchBoard, 700);
}

async function load(first = false) {
  try {
    known = await query("setup");
  } catch (error) {
    return toast(error.message, "bad");
  }
  loadedAt = performance.now();
  if (first || !chosen) chosen = (known.steps.find((step) => !step.done) ?? known.steps[0]).name;
  drawList();
  if (!isTyped) drawStep();
  return null;
}

async function doIt(name, values = {}, next = false) {
  isTyped = false;
  const answer = await act(name, values);
  await new Promise((resolve) => setTimeout(resolve, 300));
  if (answer && next) go(1);
  await load();
  return answer;
}

async function save(values, step) {
  isTyped = false;
  const answer = await act("setup-rig", {values}, true);
  if (answer && step) await act("setup-done", {step}, true);
  if (answer) toast("written into the rig file");
  await load();
  return answer;
}

function go(by) {
  const names = known.steps.map((step) => step.name);
  chosen = names[Math.min(names.length - 1, Math.max(0, names.indexOf(chosen) + by))];
}

function drawList() {
  fill(view.list, known.steps.map((step) => h("li", {}, h("button", {type: "button", class: step.done ? "done" : "", "aria-current": step.name === chosen ? "step" : null, onclick: () => { chosen = step.name; drawList(); drawStep(); }}, h("span", {class: "tick", "aria-hidden": "true"}, step.done ? "✓" : ""), NAMES[step.name], step.done ? h("span", {class: "hidden-title"}, " (done)") : null))));
}

function drawStep() {
  isTyped = false;
  markPoints(view.live.screen, []);
  const make_ = makers[chosen];
  const index = known.steps.findIndex((step) => step.name === chosen);
  view.aside.hidden = !["camera", "board", "height", "gap"].includes(chosen);
  const body = known.values.port === undefined && chosen !== "files" ? [h("p", {}, "First the folder: step 1 writes the files of the bench.")] : make_();
  fill(view.panel, h("p", {class: "facts"}, `Step ${index + 1} of ${known.steps.length}`), h("h2", {}, NAMES[chosen]), body,
    h("div", {class: "row spread pager"}, h("button", {type: "button", disabled: index === 0, onclick: () => { go(-1); drawList(); drawStep(); }}, "Back"), h("button", {type: "button", disabled: index === known.steps.length - 1, onclick: () => { go(1); drawList(); drawStep(); }}, "Next step")));
}

// Inputs bound to keys of the rig file

function text(name, size = 10) {
  return h("input", {type: "text", name, size, value: known.values[name] ?? "", autocomplete: "off", spellcheck: "false"});
}

function select(name, options) {
  const now = String(known.values[name] ?? "");
  const box = h("select", {name}, options.map((option) => h("option", {value: option}, option)));
  box.value = options.map(String).includes(now) ? now : String(options[0]);
  return box;
}

function read(inputs, numbers) {
  const values = {};
  for (const input of inputs) {
    const raw = input.value.trim();
    if (numbers.includes(input.name)) {
      if (raw === "") { values[input.name] = null; continue; }
      const value = typed(raw);
      if (Number.isNaN(value)) throw new Error(`${input.name} is a number; instead it says “${raw}”.`);
      values[input.name] = value;
    } else values[input.name] = raw;
  }
  return values;
}

function saver(inputs, numbers, step, label = "Write into the rig file") {
  return h("button", {type: "button", class: "primary", onclick: () => {
    try {
      save(read(inputs, numbers), step);
    } catch (error) {
      toast(error.message, "bad");
    }
  }}, label);
}

async function setGap(gap) {
  if (Number.isNaN(gap)) { toast("The gauge is a number of mm.", "bad"); return; }
  const said = link.state?.bench.facts.gap_mm ?? gap;
  if (Math.abs(gap - said) <= 5) { doIt("setup-gap", {gap_mm: gap}); return; }
  const text = `The map said ${num(said, 1)} mm; this changes it by ${num(gap - said, 1)} mm, and the interlock with it. A misread gauge would do the same.`;
  if (await ask("Is the gauge right?", text, "It is right")) doIt("setup-gap", {gap_mm: gap, confirm: true});
}

const makers = {
  files() {
    if (known.values.port !== undefined) return [h("p", {}, "The bench's files are there: ", h("code", {}, link.state?.files.folder ?? "")), h("p", {}, "rig.toml says what stands on the bench, specimen.toml what the rod is, plan.toml what is to be done. All have comments; change them here or by hand.")];
    return [h("p", {}, "Three commented files will be written: rig.toml, specimen.toml and plan.toml. Nothing that is there is overwritten."),
      h("div", {class: "row"}, h("button", {type: "button", class: "primary", onclick: () => doIt("setup-begin", {}, true)}, "For a real bench"), h("button", {type: "button", onclick: () => doIt("setup-begin", {twin: true}, true)}, "For the computed bench (twin)"))];
  },
  stage() {
    const inputs = [select("driver", ["grbl", "marlin"]), text("port", 18), select("axis", ["X", "Y", "Z"]), select("homing", ["switches", "manual"])];
    const ports = h("div", {class: "facts"});
    query("ports").then((found) => fill(ports, found.length ? found.map((port) => h("button", {type: "button", class: "quiet", onclick: () => { inputs[1].value = port.device; }}, `${port.device} ${port.description ?? ""}`)) : "No serial ports are there; is the cable in, and does it carry data?")).catch(() => {});
    const take = known.audit.filter((row) => row.key && row.file === "");
    return [h("p", {}, "Which board drives the stage, and on which port? “auto” takes the only one."), h("div", {class: "row"}, field("Driver", inputs[0]), field("Port", inputs[1]), field("Axis", inputs[2]), field("Homing", inputs[3])), ports,
      h("div", {class: "row"}, saver(inputs, [], null), h("button", {type: "button", onclick: () => doIt("connect")}, "Connect")),
      known.audit.length ? [h("h3", {}, "Settings of the board"), h("div", {class: "wide"}, h("table", {}, h("thead", {}, h("tr", {}, ["Setting", "Means", "Board", "Rig file", "Cure"].map((name) => h("th", {scope: "col"}, name)))), h("tbody", {}, known.audit.map((row) => h("tr", {}, h("th", {scope: "row"}, row.setting), h("td", {}, row.means), h("td", {}, row.board), h("td", {}, row.file || "–"), h("td", {class: row.cure ? "doubt" : ""}, row.cure || "good")))))),
        take.length ? h("button", {type: "button", onclick: () => save(Object.fromEntries(take.map((row) => [row.key, Number(row.board)])))}, "Hold the board to these values from now on") : null] : h("p", {class: "doubt"}, link.state?.bench.trouble || link.state?.bench.problems.stage || "Not connected.")];
  },
  gap() {
    const gauge = h("input", {type: "text", inputmode: "decimal", size: 8, name: "gauge"});
    return [h("p", {}, "Home the stage, jog until a gauge block just fits between the magnet's N face and the tip of the straight rod (or a straight dummy of its length), and say how long the gauge is."),
      h("div", {class: "row"}, h("button", {type: "button", onclick: async () => { if (await ask("Home the stage?", "It runs to its switch. Stop (Escape) ends it at once.", "Home it")) await act("home", {}, true); }}, "Home"), [-10, -1, -0.1, 0.1, 1, 10].map((step) => h("button", {type: "button", onclick: () => act("jog", {step_mm: step}, true)}, `${step > 0 ? "+" : "−"}${Math.abs(step)}`))),
      h("p", {class: "big", id: "setup-gap"}), h("div", {class: "row"}, field("The gauge, mm", gauge), h("button", {type: "button", class: "primary", onclick: () => setGap(typed(gauge.value))}, "Set the gap")),
      h("h3", {}, "Which way does it go?"), h("p", {}, `The first time, let the stage move by 1 mm and back, and say what you saw. ${known.tested ? "That was done." : "That has not been done on this bench."}`),
      h("div", {class: "row"}, h("button", {type: "button", onclick: () => doIt("setup-try-direction")}, "Move by 1 mm"), h("button", {type: "button", onclick: () => doIt("setup-tell-direction", {farther: true})}, "It went farther away"), h("button", {type: "button", onclick: () => doIt("setup-tell-direction", {farther: false})}, "It came nearer"))];
  },
  interlock() {
    const names = ["min_gap_mm", "max_gap_mm", "contact_gap_mm", "feed_mm_min", "backlash_mm"];
    const inputs = names.map((name) => text(name, 8));
    return [h("p", {}, "Nothing nearer than the interlock is ever sent to the stage. Between it and the gap at which something touches, the stage must be able to stop from full speed."),
      h("div", {class: "row"}, field("Interlock (smallest gap), mm", inputs[0]), field("Largest gap, mm", inputs[1]), field("Something touches at, mm", inputs[2])), h("div", {class: "row"}, field("Speed, mm/min", inputs[3]), field("Backlash, mm", inputs[4])), saver(inputs, names, "interlock")];
  },
  camera() {
    const inputs = [select("backend", ["auto", "opencv", "mjpeg", "folder", "video", "twin"]), text("source", 22), text("exposure", 8), text("gain", 8)];
    return [h("p", {}, "Turn the lens until the focus score is at its best; then lock focus and exposure. The background should be bright and nothing of it white (saturated)."),
      h("div", {class: "row"}, field("Backend", inputs[0]), field("Source: number, address or folder", inputs[1]), field("Exposure (locks it)", inputs[2]), field("Gain", inputs[3])), saver(inputs, ["exposure", "gain"], "camera")];
  },
  board() {
    const line = h("input", {type: "text", inputmode: "decimal", size: 7, value: "50", name: "line"});
    const twin = link.state?.files.twin;
    return [h("p", {}, "Print the board at 100 %, glue it flat, and measure the line below it."),
      h("div", {class: "row"}, h("a", {class: "button", href: "/api/board-pdf", download: "board.pdf"}, "The board as PDF"), field("The 50 mm line measures, mm", line), twin ? h("button", {type: "button", onclick: () => doIt("setup-show-board", {shows: true})}, "Lay the board under the camera") : null),
      h("p", {id: "board-look", role: "status"}, "looking …"),
      h("div", {class: "row"}, h("button", {type: "button", class: "primary", onclick: () => doIt("setup-take-board", {kind: "plane"})}, "Take the flat picture"), h("button", {type: "button", onclick: () => doIt("setup-take-board", {kind: "lens"})}, "Take a tilted picture"), known.shots.length ? h("button", {type: "button", class: "quiet", onclick: () => doIt("setup-forget-board")}, "Begin anew") : null),
      h("p", {class: "facts"}, known.shots.length ? `Taken: ${known.shots.join(", ")}` : "Nothing taken yet."),
      h("button", {type: "button", class: "primary", disabled: !known.shots.includes("plane.png"), onclick: async () => { const length = typed(line.value); if (await doIt("setup-calibrate", {line_mm: length}) && twin) await doIt("setup-show-board", {shows: false}); }}, "Calibrate"),
      link.state?.files.calibration ? h("p", {class: "good"}, `Calibrated: ${num(link.state.files.calibration.rms_px, 3)} px RMS, camera tilted by ${num(link.state.files.calibration.tilt_deg, 1)}°.`) : null];
  },
  height() {
    const height = h("input", {type: "text", inputmode: "decimal", size: 8, value: link.state?.files.calibration?.rod_height_mm ?? "", name: "height"});
    const up = h("select", {name: "up"}, Object.keys(UPS).map((name) => h("option", {}, name)));
    const now = JSON.stringify(known.values.up?.map(Number));
    up.value = Object.keys(UPS).find((name) => JSON.stringify(UPS[name]) === now) ?? "camera looks down";
    return [h("p", {}, "How high is the axis of the rod above the board's plane? A millimetre changes a length by about 0.3 %."), h("div", {class: "row"}, field("Height of the rod's axis, mm", height), h("button", {type: "button", class: "primary", onclick: () => { const value = typed(height.value); Number.isNaN(value) ? toast("The height is a number of mm.", "bad") : doIt("setup-height", {rod_height_mm: value}); }}, "Set the height")),
      h("p", {}, "Weight counts where the specimen has a density; so say which way is up."), h("div", {class: "row"}, field("Which way is up?", up), h("button", {type: "button", onclick: () => save({up: UPS[up.value].map((part) => part)})}, "Write into the rig file"))];
  },
  meter() {
    const inputs = [select("meter", known.meters), text("meter_port", 16), select("sign", [1, -1]), text("zero_mT", 8)];
    const reading = h("p", {class: "big", id: "setup-meter"});
    return [h("p", {}, "Which Tesla-meter? A hand meter is “manual”: its readings are typed in. Near the magnet's N face the reading should be positive; if not, turn the sign round."), h("div", {class: "row"}, field("Meter", inputs[0]), field("Port", inputs[1]), field("Sign", inputs[2]), field("Zero, mT", inputs[3])),
      reading, h("div", {class: "row"}, h("button", {type: "button", onclick: () => { try { const values = read(inputs, ["zero_mT"]); values.sign = Number(values.sign); if (!values.meter_port) delete values.meter_port; save(values, "meter"); } catch (error) { toast(error.message, "bad"); } }, class: "primary"}, "Write into the rig file"), h("button", {type: "button", onclick: () => doIt("setup-zero")}, "This is zero field: take it off"))];
  },
  magnet() {
    const inputs = [text("side_mm", 8), text("remanence_T", 8)];
    const gaps = h("input", {type: "text", size: 26, value: "100, 90, 80, 70, 60, 50", name: "gaps"});
    const verdict = h("div", {});
    showScan(verdict);
    return [h("p", {}, "Put the probe where the undeformed tip will be, and let the stage read the field along its way: one remanence must explain all readings."), h("div", {class: "row"}, field("Side of the cube, mm", inputs[0]), field("Remanence, T", inputs[1]), saver(inputs, ["side_mm", "remanence_T"], "magnet")),
      h("div", {class: "row"}, field("Gaps to read at, mm, far to near", gaps), h("button", {type: "button", onclick: () => doIt("setup-scan", {gaps_mm: gaps.value.split(/[,;\s]+/).filter(Boolean).map(typed)})}, "Scan the field")), h("div", {id: "setup-jobs"}), verdict];
  },
  specimen() {
    const rod = known.specimen;
    const number = h("select", {name: "gmc"}, [1, 2, 3, 4, 5, 6, 7].map((each) => h("option", {value: each}, `GMC ${each}`)));
    number.value = "2";
    const own = {name: h("input", {type: "text", value: rod?.name ?? ""}), side_mm: h("input", {type: "text", size: 6, value: rod?.side_mm ?? ""}), remanence_mT: h("input", {type: "text", size: 8, value: rod?.remanence_mT ?? ""}), density_kg_m3: h("input", {type: "text", size: 8, value: rod?.density_kg_m3 ?? ""}), length_mm: h("input", {type: "text", size: 18, value: rod?.length_mm.join(", ") ?? ""}), E_MPa: h("input", {type: "text", size: 18, value: rod?.E_MPa.join(", ") ?? ""})};
    const list = (input) => input.value.split(/[,;\s]+/).filter(Boolean).map(typed);
    return [h("h3", {}, "A rod of the paper's Table 1"), h("div", {class: "row"}, field("Rod", number), h("button", {type: "button", class: "primary", onclick: () => doIt("setup-specimen", {gmc: Number(number.value)})}, "Take it")),
      h("h3", {}, "Your own"), h("div", {class: "row"}, field("Name", own.name), field("Side, mm", own.side_mm), field("Remanence, mT", own.remanence_mT, "+ points root to tip"), field("Density, kg/m³", own.density_kg_m3, "with it weight counts")),
      h("div", {class: "row"}, field("Lengths of the sections, mm, root first", own.length_mm), field("Moduli, MPa, root first", own.E_MPa)),
      h("button", {type: "button", onclick: () => { const density = typed(own.density_kg_m3.value); doIt("setup-specimen", {name: own.name.value, side_mm: typed(own.side_mm.value), remanence_mT: typed(own.remanence_mT.value), density_kg_m3: Number.isNaN(density) ? null : density, length_mm: list(own.length_mm), E_MPa: list(own.E_MPa)}); }}, "Write specimen.toml")];
  },
  plan() {
    const total = h("p", {});
    const rows = h("tbody");
    query("plan").then(({values}) => query("plan", {values: JSON.stringify(values)})).then((found) => {
      say(total, `${found.name}: about ${Math.ceil(found.total_s / 60)} min with homing; every gap is inside the limits; nothing was moved.`);
      fill(rows, found.steps.map((step) => h("tr", {}, [num(step.gap_mm, 2), num(step.stage_mm, 2), num(step.flux_mT, 2), step.shape_mm ? `${num(step.shape_mm.at(-1)[0], 2)}, ${num(step.shape_mm.at(-1)[1], 2)}` : step.status].map((cell) => h("td", {}, cell)))));
    }).catch((error) => { say(total, error.message); total.className = "doubt"; });
    return [h("p", {}, "What the plan will do, checked against every limit, without moving anything:"), total, h("div", {class: "wide"}, h("table", {}, h("thead", {}, h("tr", {}, ["Gap, mm", "Stage, mm", "Flux, mT", "Tip x, y, mm"].map((name) => h("th", {scope: "col"}, name)))), rows)), h("a", {class: "button primary", href: "#run"}, "To the page Run")];
  },
};

async function showScan(element) {
  try {
    const found = await query("scan");
    fill(element, h("h3", {}, `Scan ${found.scan}`), h("p", {class: "big"}, `${num(found.remanence_T, 4)} ± ${num(found.remanence_sd_T, 4)} T`), h("p", {class: "facts"}, `The rig file says ${num(found.in_file_T, 4)} T.`),
      h("div", {class: "wide"}, h("table", {}, h("thead", {}, h("tr", {}, ["Gap, mm", "Read, mT", "Fitted, mT", "Verdict"].map((name) => h("th", {scope: "col"}, name)))), h("tbody", {}, found.readings.map((reading) => h("tr", {}, [num(reading.gap_mm, 1), num(reading.flux_mT, 2), num(reading.predicted_mT, 2), reading.verdict].map((cell) => h("td", {}, cell))))))),
      h("button", {type: "button", class: "primary", onclick: () => save({remanence_T: Math.round(found.remanence_T * 1e4) / 1e4}, "magnet")}, "Write this remanence into the rig file"));
  } catch {
    fill(element);
  }
}

async function watchBoard() {
  if (chosen !== "board" || document.hidden || view.panel.closest("[hidden]")) return;
  const told = document.getElementById("board-look");
  if (!told) return;
  try {
    const seen = await query("board");
    say(told, seen.corners_px.length ? `${seen.corners_px.length} of ${seen.of} corners, over ${num(seen.covers_percent, 0)} % of the picture, tilted by ${num(seen.tilt_deg, 0)}°. Next: ${seen.next}.` : `${seen.why}.`);
    markPoints(view.live.screen, seen.corners_px);
  } catch (error) {
    say(told, error.message);
  }
}

let seenKey = "";
// What was typed and not sent yet is not drawn over.
let isTyped = false;
export function render(state) {
  view.live.render(state);
  view.camera.render(state);
  const gap = document.getElementById("setup-gap");
  if (gap) say(gap, state.bench.facts.gap_mm === undefined || state.bench.facts.gap_mm === null ? `gap unknown (${state.bench.doing || state.bench.facts.position_state || "not connected"})` : `${num(state.bench.facts.gap_mm, 3)} mm ${state.bench.doing}`);
  const meter = document.getElementById("setup-meter");
  if (meter) say(meter, state.meter.flux_mT === null ? `${state.meter.status ?? "no reading"}` : `${num(state.meter.flux_mT, 2)} mT (model ${num(state.meter.model_mT, 2)} mT)`);
  const jobs = document.getElementById("setup-jobs");
  if (jobs) showJobs(jobs, state.jobs.filter((job) => job.what === "scan-field").slice(0, 1));
  const key = JSON.stringify([state.bench.open, state.bench.facts.position_state, state.files.calibration, state.files.rig, state.jobs.map((job) => job.status), Object.keys(state.bench.facts).length]);
  if (key !== seenKey && !isTyped && performance.now() - loadedAt > 500 && !view.panel.contains(document.activeElement?.closest("input, select, textarea") ?? null)) {
    seenKey = key;
    load();
  }
}
