// What every page does: send a command, say what came of it, ask.

import {h, say} from "./dom.js";
import {command} from "./link.js";

const $ = (id) => document.getElementById(id);

export function toast(text, kind = "") {
  const note = h("p", {class: `toast ${kind}`}, text);
  $("toasts").append(note);
  setTimeout(() => note.remove(), 6000 + 40 * text.length);
}

export function ask(title, text, yes) {
  const dialog = $("ask");
  say($("ask-title"), title);
  say($("ask-text"), text);
  say($("ask-yes"), yes);
  // Not modal: the stop must stay within reach of pointer and keyboard.
  dialog.show();
  $("ask-yes").focus();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), {once: true});
    dialog.returnValue = "no";
  });
}

/** Send a command, ask for the controls if another page has them, and say what came of it. */
export async function act(name, values = {}, quiet = false) {
  try {
    const answer = await command(name, values);
    if (!quiet && answer.text) toast(answer.text);
    return answer;
  } catch (error) {
    if (error.why === "not yours" && (await takeOver(error.message))) return act(name, values, quiet);
    if (error.why !== "not yours") toast(error.message, "bad");
    return null;
  }
}

async function takeOver(why) {
  const sure = await ask("Take over the controls?", `${why[0].toUpperCase()}${why.slice(1)}. The other page will only watch from then on.`, "Take over");
  if (sure) await command("take", {over: true});
  return sure;
}
