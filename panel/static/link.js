// The connection: what the panel tells comes by the socket, commands go by POST.

const LOST_MS = 3500;

export const client = secret();
export const link = {state: null, you: {}, up: false, heardAt: 0};

const listeners = {state: [], picture: [], overlay: [], link: []};
let socket = null;
let wait = 250;
let wantsPicture = false;

/** Listen to "state", "picture", "overlay" or "link". */
export function on(what, listener) {
  listeners[what].push(listener);
}

function tell(what, ...news) {
  for (const listener of listeners[what]) listener(...news);
}

/** The secret of this page: it survives a reload, and no other page knows it. */
function secret() {
  let known = sessionStorage.getItem("client");
  if (!known) {
    known = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    sessionStorage.setItem("client", known);
  }
  return known;
}

/** Open the socket, and open it again whenever it is lost. */
export function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/socket?client=${client}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    wait = 250;
    setUp(true);
    sendWish();
    tellAwake();
  };
  socket.onmessage = (event) => {
    link.heardAt = performance.now();
    typeof event.data === "string" ? hear(JSON.parse(event.data)) : see(event.data);
  };
  socket.onclose = (event) => {
    setUp(false, event.reason);
    setTimeout(connect, wait);
    wait = Math.min(wait * 1.7, 4000);
  };
}

function setUp(up, reason = "") {
  link.up = up;
  link.reason = reason;
  tell("link", up);
}

function hear(message) {
  if (message.type === "state") {
    link.state = message.state;
    link.you = message.you;
    tell("state", link.state, link.you);
  } else if (message.type === "overlay") {
    tell("overlay", message);
  }
}

async function see(data) {
  const length = new DataView(data).getUint32(0);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const receivedAt = performance.now();
  try {
    const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)], {type: "image/jpeg"}));
    tell("picture", {...header, bitmap, receivedAt});
  } finally {
    send({shown: header.number});
  }
}

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

/** Ask for live pictures, or not; a hidden page asks for none. */
export function watchPicture(wish) {
  if (wish === wantsPicture) return;
  wantsPicture = wish;
  sendWish();
}

function sendWish() {
  send({picture: wantsPicture && !document.hidden});
}

let awakeAt = 0;
function tellAwake() {
  const now = performance.now();
  if (now - awakeAt < 10000) return;
  awakeAt = now;
  send({awake: true});
}

/** Send a command; returns the answer, throws an Error with the sentence. */
export async function command(name, values = {}) {
  let answer;
  try {
    answer = await fetch(`/api/${name}`, {
      method: "POST",
      keepalive: true,
      headers: {"Content-Type": "application/json", "X-Magbend-Client": client},
      body: JSON.stringify(values),
    });
  } catch {
    throw new Error("the panel cannot be reached; is magbend panel still running?");
  }
  const found = await answer.json().catch(() => ({error: `the panel answered ${answer.status}`}));
  if (answer.ok && found.ok !== false) return found;
  const error = new Error(found.error);
  error.why = found.why;
  throw error;
}

/** Look something up; throws an Error with the sentence. */
export async function query(name, values = {}) {
  const answer = await fetch(`/api/${name}?${new URLSearchParams(values)}`).catch(() => null);
  if (!answer) throw new Error("the panel cannot be reached; is magbend panel still running?");
  const found = await answer.json().catch(() => ({error: `the panel answered ${answer.status}`}));
  if (answer.ok && found.ok !== false) return found;
  throw new Error(found.error);
}

/** Whether nothing has been heard for too long. */
export function isLost() {
  return !link.up || performance.now() - link.heardAt > LOST_MS;
}

document.addEventListener("visibilitychange", sendWish);
for (const sign of ["pointerdown", "pointermove", "keydown", "touchstart", "wheel"])
  addEventListener(sign, tellAwake, {passive: true});
