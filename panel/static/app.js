// The frame of the panel: pages, stop, controls, banners. It starts everything.

import {h, fill, say} from "./dom.js";
import {client, command, connect, isLost, link, on, watchPicture} from "./link.js";
import {act, toast} from "./actions.js";
import * as bench from "./bench.js";
import * as run from "./run.js";
import * as runs from "./runs.js";
import * as setup from "./setup.js";
import * as point from "./point.js";
import * as design from "./design.js";

const pages = {setup, bench, run, runs, point, design};
const $ = (id) => document.getElementById(id);
let current = "";

// Pages

function show() {
  const name = pages[location.hash.slice(1).split("/")[0]] ? location.hash.slice(1).split("/")[0] : first();
  if (name === current) return;
  current = name;
  for (const [each, page] of Object.entries(pages)) {
    const view = $(`view-${each}`);
    view.hidden = each !== name;
    if (each === name && !view.dataset.made) {
      view.dataset.made = "yes";
      page.make(view);
    }
  }
  for (const anchor of $("nav").children) {
    if (anchor.hash === `#${name}`) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
  document.title = `${pages[name].title} · magbend`;
  watchPicture(Boolean(pages[name].watches));
  pages[name].enter?.();
  render();
}

function first() {
  return link.state && !link.state.files.has_rig_file ? "setup" : "bench";
}

function render() {
  if (!link.state) return;
  if (!current) return show();
  pages[current].render?.(link.state, link.you);
  frame(link.state, link.you);
}

function frame(state, you) {
  const chip = $("controls");
  chip.classList.toggle("mine", you.has_controls);
  say(chip, you.has_controls ? "You have the controls" : you.holder ? "Watching · take over" : "Controls are free");
  chip.title = you.holder && !you.has_controls ? `${you.holder} has them since ${you.since_utc}` : "";
  const {files} = state;
  say($("place"), `${files.rig ?? "no rig file"} · ${files.folder}${files.twin ? " · computed bench (twin)" : ""}`);
  banners(state);
}

// Banners: what a person must know wherever they look

const told = new Map();

function banners(state) {
  const list = [];
  if (isLost()) list.push(["bad", `The panel does not answer${link.reason ? `: ${link.reason}` : ""}. A run goes on in its own process; nothing here can stop the stage: use its own emergency stop, or magbend rig stop in a terminal.`]);
  if (stopFailed) list.push(["bad", stopFailed]);
  if (state) {
    if (state.files.problems.rig && state.files.has_rig_file) list.push(["bad", state.files.problems.rig]);
    if (!state.files.has_rig_file) list.push(["note", `There is no ${state.files.rig_file} in ${state.files.folder} yet: the page Set up writes one.`]);
    for (const sentence of Object.values(state.bench.problems)) list.push(["bad", sentence]);
    if (state.bench.trouble) list.push(["bad", state.bench.trouble]);
    if (state.camera.trouble) list.push(["bad", state.camera.trouble]);
    if (state.meter.trouble) list.push(["warn", state.meter.trouble]);
    if (state.meter.status === "overload") list.push(["warn", "The Tesla-meter is beyond its range (overload): choose a higher range, or go farther away."]);
    if (state.compiling) list.push(["note", state.compiling]);
    if (state.journal) list.push(["warn", state.journal]);
    if (state.files.twin) list.push(["twin", "Computed bench (twin): no real device moves."]);
  }
  const key = JSON.stringify(list);
  if (told.get("banners") === key) return;
  told.set("banners", key);
  fill($("banners"), [...new Map(list.map((item) => [item[1], item])).values()].map(([kind, text]) => h("p", {class: `banner ${kind}`}, text)));
}

// Stop: one click, one key, whoever watches

let stopFailed = "";

async function stop() {
  $("stop").classList.add("pressed");
  setTimeout(() => $("stop").classList.remove("pressed"), 600);
  for (let attempt = 0; attempt < 3; attempt += 1) {
    try {
      const answer = await command("stop");
      stopFailed = "";
      toast(answer.text || "stopped");
      break;
    } catch (error) {
      stopFailed = `The stop did not arrive: ${error.message} Use the stage's own emergency stop.`;
    }
  }
  banners(link.state);
}

async function controlsPressed() {
  if (link.you.has_controls) return act("release");
  return act("take");
}

// Light and dark

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  localStorage.setItem("theme", theme);
}

function turnTheme() {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const now = document.documentElement.dataset.theme || (dark ? "dark" : "light");
  setTheme(now === "dark" ? "light" : "dark");
  render();
}

if (localStorage.getItem("theme")) document.documentElement.dataset.theme = localStorage.getItem("theme");
$("stop").addEventListener("click", stop);
$("controls").addEventListener("click", controlsPressed);
$("theme").addEventListener("click", turnTheme);
addEventListener("keydown", (event) => {
  if (event.key !== "Escape") return;
  stop();
  if ($("ask").open) $("ask").close("no");
}, {capture: true});
addEventListener("hashchange", show);
on("state", render);
on("link", () => {
  say($("link-state"), link.up ? "connected" : "not connected");
  banners(link.state);
});
setInterval(() => banners(link.state), 1000);
window.magbend = {client, link};
connect();
if (location.hash) show();
