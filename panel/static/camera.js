// What the camera's picture is worth: focus, histogram, saturation.

import {fill, h, num, s, say} from "./dom.js";

const WIDTH = 256;
const HEIGHT = 56;

export function cameraCard() {
  const focus = h("output", {});
  const light = h("output", {});
  const white = h("output", {});
  const bars = s("svg", {class: "histogram", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": "histogram of brightness"});
  let best = 0;
  const element = h("section", {class: "card", "aria-label": "Camera"},
    h("h2", {}, "Camera"),
    h("dl", {class: "pairs"}, h("dt", {}, "Focus score (best so far)"), h("dd", {}, focus), h("dt", {}, "Background"), h("dd", {}, light), h("dt", {}, "Saturated"), h("dd", {}, white)),
    bars, h("button", {type: "button", class: "quiet", onclick: () => { best = 0; }}, "Forget the best focus"));
  return {element, render({camera}) {
    if (camera.focus === undefined) return;
    best = Math.max(best, camera.focus);
    say(focus, `${num(camera.focus, 1)} (${num(best, 1)})`);
    say(light, `${num(100 * camera.brightness, 0)} %`);
    say(white, `${num(camera.saturated_percent, 1)} %${camera.saturated_percent > 2 ? ": expose it less" : ""}`);
    const top = Math.max(...camera.histogram, 1e-6);
    const wide = WIDTH / camera.histogram.length;
    fill(bars, camera.histogram.map((share, index) => {
      const high = HEIGHT * Math.sqrt(share / top);
      return s("rect", {x: index * wide, y: HEIGHT - high, width: wide * 0.9, height: high});
    }));
  }};
}
