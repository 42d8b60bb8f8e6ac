// The bench: live picture with theory over it, the gap to scale, and what moves the stage.

import {act, ask, toast} from "./actions.js";
import {field, fill, h, num, s, say, typed} from "./dom.js";
import {drawGap} from "./gap.js";
import {picture} from "./picture.js";
import {cameraCard} from "./camera.js";

export const title = "Bench";
export const watches = true;

const TRUST = {
  homed: ["good", "homed: the position is good"],
  unverified: ["warn", "unverified: a move did not end as it should; home it"],
  unknown: ["warn", "unknown: home the stage first"],
};
const JOGS = [-10, -1, -0.1, 0.1, 1, 10];
let view = null;

export function make(root) {
  const live = picture();
  const scale = s("svg", {class: "gap-scale", role: "img", "aria-labelledby": "gap-now"});
  const gap = h("output", {class: "big", id: "gap-now"});
  const state = h("span", {class: "chip"});
  const trust = h("span", {class: "chip"});
  const detail = h("p", {class: "facts"});
  const target = h("input", {type: "text", inputmode: "decimal", size: 8, name: "gap", autocomplete: "off", placeholder: "70"});
  const go = h("form", {class: "row", onsubmit: goto}, field("Go to a gap, mm", target), h("button", {class: "primary"}, "Go"));
  const jogs = h("div", {class: "jogs", role: "group", "aria-label": "Jog, in mm: less is nearer to the magnet"},
    JOGS.map((step) => h("button", {type: "button", onclick: () => act("jog", {step_mm: step}, true), "aria-label": `${step > 0 ? "farther by" : "nearer by"} ${Math.abs(step)} mm`}, `${step > 0 ? "+" : "−"}${Math.abs(step)}`)));
  const home = h("button", {type: "button", onclick: homing}, "Home");
  const connect = h("button", {type: "button", class: "quiet", onclick: () => act("connect")}, "Connect anew");
  const recover = h("button", {type: "button", hidden: true, onclick: () => act("recover")}, "Recover");
  const unlock = h("button", {type: "button", hidden: true, onclick: unlocking}, "Unlock …");
  const field_ = fieldCard();
  const camera = cameraCard();
  fill(root,
    h("h1", {class: "hidden-title"}, "Bench"),
    h("div", {class: "columns"},
      live.element,
      h("div", {class: "stack"},
        h("section", {class: "card", "aria-label": "Gap"}, h("div", {class: "row spread"}, gap, h("div", {class: "chips"}, state, trust)), scale, detail),
        h("section", {class: "card", "aria-label": "Move"}, h("div", {class: "row spread"}, go, h("div", {class: "row"}, home, recover, unlock)), jogs, connect),
        field_.element, camera.element)));
  view = {live, scale, gap, state, trust, detail, target, home, recover, unlock, field: field_, camera};
}

async function goto(event) {
  event.preventDefault();
  const gap = typed(view.target.value);
  if (Number.isNaN(gap)) return toast("A gap is a number in mm, such as 70.", "bad");
  await act("goto", {gap_mm: gap}, true);
}

async function homing() {
  if (await ask("Home the stage?", "It runs to its switch, away from the magnet if the board is set so. Stop (Escape) ends it at once.", "Home it")) await act("home", {}, true);
}

async function unlocking() {
  const sure = await ask("Unlock without homing?", "The stage may not know where it is. Homing is safer.", "Unlock all the same");
  if (sure) await act("unlock", {confirm: true});
}

export function render(state) {
  const {bench} = state;
  const running = state.run.facts || state.run.starting;
  view.live.render(state);
  const facts = bench.facts;
  say(view.gap, facts.gap_mm === null || facts.gap_mm === undefined ? facts.stage_mm === undefined || facts.stage_mm === null ? "gap unknown" : `machine ${num(facts.stage_mm, 3)} mm` : `${num(facts.gap_mm, 3)} mm`);
  const doing = bench.doing || facts.state || (running ? "a run has the bench" : "not connected");
  chip(view.state, doing, facts.state === "alarm" ? "bad" : bench.doing ? "busy" : "");
  const [kind, sentence] = TRUST[facts.position_state] ?? ["", running ? "see the page Run" : ""];
  chip(view.trust, sentence.split(":")[0], kind);
  view.trust.hidden = !sentence;
  const [low, high] = facts.allowed_mm ?? [];
  say(view.detail, facts.state ? `${facts.doubt ? `${facts.doubt}. ` : ""}${facts.position_state === "homed" ? "" : `Position ${sentence}. `}Allowed from ${num(low, 1)} to ${num(high, 1)} mm · ${facts.firmware} on ${facts.port}${facts.pins ? ` · switches ${facts.pins}` : ""}` : bench.trouble || "");
  drawGap(view.scale, bench);
  view.recover.hidden = view.unlock.hidden = facts.state !== "alarm";
  view.field.render(state);
  view.camera.render(state);
}

function chip(element, text, kind) {
  say(element, text);
  element.className = `chip ${kind}`;
}

function fieldCard() {
  const read = h("output", {});
  const model = h("output", {});
  const off = h("output", {});
  const note = h("p", {class: "facts"});
  const element = h("section", {class: "card", "aria-label": "Field"},
    h("h2", {}, "Field at the tip"),
    h("dl", {class: "pairs"}, h("dt", {}, "Tesla-meter"), h("dd", {}, read), h("dt", {}, "Model of the magnet"), h("dd", {}, model), h("dt", {}, "Meter over model"), h("dd", {}, off)), note);
  return {element, render({meter, bench}) {
    const gap = bench.facts.gap_mm;
    say(read, meter.flux_mT === null ? meter.status ?? "none" : num(meter.flux_mT, 2, "mT"));
    say(model, num(meter.model_mT, 2, "mT"));
    const here = meter.read_at_gap_mm !== null && Math.abs(meter.read_at_gap_mm - gap) < 0.05;
    const ratio = here && meter.flux_mT !== null && meter.model_mT ? meter.flux_mT / meter.model_mT : null;
    say(off, ratio === null ? "–" : `${num(100 * (ratio - 1), 1)} %`);
    say(note, ratio !== null && ratio > 8 && ratio < 12 ? "Ten times the model: does the meter read gauss?" : ratio !== null && ratio < 0 ? "The sign is turned round: set sign = -1 in [meter], or turn the probe." : here || meter.read_at_gap_mm === null ? "" : `read at ${num(meter.read_at_gap_mm, 2)} mm`);
  }};
}
