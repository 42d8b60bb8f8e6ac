// A picture on which points are set, by mouse, finger or keys.

import {h, say} from "./dom.js";

const STEP = 1;
const LEAP = 20;

/** Make the board; `changed(points)` is called whenever a point is set or moved. */
export function pointing({changed, label}) {
  const canvas = h("canvas", {tabindex: "0", role: "application", "aria-label": `${label}: arrow keys move the cross, with Shift by ${LEAP}, Enter sets a point, Backspace takes the last one away`});
  const where = h("p", {class: "facts", "aria-live": "polite"});
  const element = h("div", {}, h("div", {class: "screen pointing"}, canvas), where);
  const board = {canvas, where, element, image: null, size: [1, 1], points: [], marks: [], cross: null, changed, dragged: -1};
  canvas.addEventListener("pointerdown", (event) => press(board, event));
  canvas.addEventListener("pointermove", (event) => drag(board, event));
  canvas.addEventListener("pointerup", () => { board.dragged = -1; });
  canvas.addEventListener("keydown", (event) => key(board, event));
  return board;
}

/** Show a picture; size is that of the original, in its pixels. */
export async function showImage(board, address, size = null) {
  const answer = await fetch(address);
  if (!answer.ok || !(answer.headers.get("content-type") ?? "").startsWith("image/")) throw new Error((await answer.json().catch(() => ({}))).error ?? "the picture cannot be shown");
  board.image = await createImageBitmap(await answer.blob());
  board.size = size ?? [board.image.width, board.image.height];
  board.canvas.width = board.image.width;
  board.canvas.height = board.image.height;
  board.canvas.parentElement.style.aspectRatio = `${board.image.width} / ${board.image.height}`;
  board.cross = [board.size[0] / 2, board.size[1] / 2];
  draw(board);
}

/** Draw picture, lines and points. */
export function draw(board) {
  const pen = board.canvas.getContext("2d");
  if (!board.image) return;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.drawImage(board.image, 0, 0);
  const scale = board.canvas.width / board.size[0];
  const thin = board.canvas.width / Math.max(1, board.canvas.getBoundingClientRect().width);
  const at = ([x, y]) => [x * scale, y * scale];
  for (const {points, colour} of [...board.marks, {points: board.points, colour: "#37c2ff"}]) {
    pen.lineWidth = 2 * thin;
    pen.strokeStyle = colour;
    pen.beginPath();
    points.forEach((point, index) => (index ? pen.lineTo(...at(point)) : pen.moveTo(...at(point))));
    pen.stroke();
    points.forEach((point, index) => {
      pen.beginPath();
      pen.arc(...at(point), 5 * thin, 0, 7);
      pen.fillStyle = index === 0 ? "#ff9d2e" : colour;
      pen.fill();
      pen.strokeStyle = "#000a";
      pen.stroke();
      pen.strokeStyle = colour;
    });
  }
  if (document.activeElement === board.canvas && board.cross) {
    const [x, y] = at(board.cross);
    pen.strokeStyle = "#ff3b6b";
    pen.beginPath();
    pen.moveTo(x - 14 * thin, y); pen.lineTo(x + 14 * thin, y); pen.moveTo(x, y - 14 * thin); pen.lineTo(x, y + 14 * thin);
    pen.stroke();
  }
}

function place(board, event) {
  const box = board.canvas.getBoundingClientRect();
  return [((event.clientX - box.left) / box.width) * board.size[0], ((event.clientY - box.top) / box.height) * board.size[1]].map((value) => Math.round(value * 10) / 10);
}

function press(board, event) {
  if (!board.image) return;
  board.canvas.focus({preventScroll: true});
  const spot = place(board, event);
  const reach = (14 * board.size[0]) / board.canvas.getBoundingClientRect().width;
  board.dragged = board.points.findIndex(([x, y]) => Math.hypot(x - spot[0], y - spot[1]) < reach);
  if (board.dragged < 0) board.dragged = board.points.push(spot) - 1;
  board.canvas.setPointerCapture(event.pointerId);
  tell(board, spot);
}

function drag(board, event) {
  if (board.dragged < 0 || !board.points[board.dragged]) return;
  board.points[board.dragged] = place(board, event);
  tell(board, board.points[board.dragged]);
}

function key(board, event) {
  const by = event.shiftKey ? LEAP : STEP;
  const moves = {ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by]};
  if (moves[event.key] && board.cross) board.cross = board.cross.map((value, axis) => Math.min(board.size[axis] - 1, Math.max(0, value + moves[event.key][axis])));
  else if (event.key === "Enter" && board.cross) board.points.push([...board.cross]);
  else if (event.key === "Backspace") board.points.pop();
  else return;
  event.preventDefault();
  tell(board, board.cross);
}

function tell(board, spot) {
  say(board.where, `${board.points.length} points; ${Math.round(spot[0])}, ${Math.round(spot[1])} px`);
  draw(board);
  board.changed(board.points);
}
