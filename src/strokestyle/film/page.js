// The film page: drawings unpacked when they are wanted, painted once, kept while there is room.

const byId = (id) => document.getElementById(id);
const film = JSON.parse(byId("data").textContent);
const count = film.frames.length;
const starts = [0]; // of each drawing, in frames; the last is the end
for (const held of film.held) starts.push(starts[starts.length - 1] + held);
const [width, height] = film.size;

const BUDGET = 192 * 2 ** 20; // bytes of pictures that are kept
const AHEAD = 4; // pictures made before they are due
const BEFORE = "#d8362a"; // onion skin, as animators' pencils: red before, blue after
const AFTER = "#2a62d8";
const FAINT = [0.42, 0.26, 0.17, 0.11, 0.07]; // of neighbours, by their distance

// ------------------------------------------------------------------------------------- pictures

/** The SVG of a drawing, as its file holds it. */
async function svgText(i) {
  const packed = Uint8Array.from(atob(film.frames[i]), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Response(stream).text();
}

const pictures = new Map(); // by drawing: canvas, the latest used last
const making = new Map(); // by drawing: promise of its canvas
let pixels = [1, 1]; // of a picture
let era = 0; // goes up when pictures of another size are wanted

function room() {
  return Math.max(2 * FAINT.length + AHEAD, Math.floor(BUDGET / (4 * pixels[0] * pixels[1])));
}

/** The picture of a drawing without its background, or undefined while it is in the making. */
function picture(i) {
  const found = pictures.get(i);
  if (found) {
    pictures.delete(i);
    pictures.set(i, found);
  } else if (!making.has(i)) {
    making.set(i, make(i, era));
  }
  return found;
}

async function make(i, mine) {
  const canvas = document.createElement("canvas");
  try {
    const text = (await svgText(i)).replace(/<rect\b[^>]*\bid="paper"[^>]*?\/>/, "");
    const address = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    const image = new Image();
    image.src = address;
    await image.decode();
    [canvas.width, canvas.height] = pixels;
    canvas.getContext("2d").drawImage(image, 0, 0, ...pixels);
    URL.revokeObjectURL(address);
  } catch (error) {
    console.error(`drawing ${i + 1}: ${error}`);
  }
  if (mine !== era) return;
  making.delete(i);
  pictures.set(i, canvas);
  for (const old of pictures.keys()) {
    if (pictures.size <= room()) break;
    pictures.delete(old);
  }
  repaint();
}

// ------------------------------------------------------------------------------------- the stage

const stage = byId("stage");
const sheet = byId("sheet");
const canvas = byId("picture");
const brush = canvas.getContext("2d");
const skin = document.createElement("canvas");

function fit() {
  const style = getComputedStyle(stage);
  const free = [
    stage.clientWidth - 2 * parseFloat(style.paddingLeft),
    stage.clientHeight - 2 * parseFloat(style.paddingTop),
  ];
  const scale = Math.max(0.05, Math.min(free[0] / width, free[1] / height, 4));
  const shown = [width * scale, height * scale].map(Math.round);
  const wanted = shown.map((length) => Math.max(1, Math.round(length * devicePixelRatio)));
  [canvas.style.width, canvas.style.height] = shown.map((length) => `${length}px`);
  if (wanted[0] === canvas.width && wanted[1] === canvas.height) return;
  [canvas.width, canvas.height] = [skin.width, skin.height] = pixels = wanted;
  era++;
  pictures.clear();
  making.clear();
  repaint();
}

let asked = 0; // the animation frame that was asked for
let shown = -1; // the drawing that is on the stage

function repaint() {
  asked ||= requestAnimationFrame(paint);
}

function paint() {
  asked = 0;
  const now = picture(current);
  const sides = playing || !byId("onion").checked ? [] : neighbours();
  const skins = sides.map((side) => ({ ...side, canvas: picture(side.drawing) }));
  if (!now) return; // it comes back when it is made
  brush.clearRect(0, 0, canvas.width, canvas.height);
  for (const one of skins.reverse()) if (one.canvas) lay(one);
  brush.drawImage(now, 0, 0);
  shown = current;
  canvas.dataset.drawing = String(current);
  canvas.dataset.skins = String(skins.filter((one) => one.canvas).length);
  for (let k = 1; playing && k <= AHEAD; k++) picture(order(position + k).drawing);
}

/** The drawings beside the current one, the nearest first: {drawing, colour, faint}. */
function neighbours() {
  const found = [];
  for (let k = 1; k <= FAINT.length; k++) {
    for (const [id, step, colour] of [["before", -k, BEFORE], ["after", k, AFTER]]) {
      if (k > Number(byId(id).value)) continue;
      const drawing = film.loop ? (((current + step) % count) + count) % count : current + step;
      if (drawing < 0 || drawing >= count || drawing === current) continue;
      found.push({ drawing, colour, faint: FAINT[k - 1] });
    }
  }
  return found;
}

/** Lay a drawing on the stage, all its ink of one colour. */
function lay({ canvas: ink, colour, faint }) {
  const dye = skin.getContext("2d");
  dye.globalCompositeOperation = "copy";
  dye.drawImage(ink, 0, 0);
  dye.globalCompositeOperation = "source-in";
  dye.fillStyle = colour;
  dye.fillRect(0, 0, skin.width, skin.height);
  brush.globalAlpha = faint;
  brush.drawImage(skin, 0, 0);
  brush.globalAlpha = 1;
}

// ------------------------------------------------------------------------------------- time

let current = 0; // the drawing that is wanted on the stage
let position = 0; // its place in the order in which drawings are played
let playing = false;
let clock = 0; // frames since the drawing at `position` began
let last = 0; // ms, when the clock was last set

/** {drawing, last}: which drawing is at a place of the order, and whether it is the last of all. */
function order(place) {
  if (ending() === "pingpong" && count > 1) {
    const round = 2 * (count - 1);
    const at = ((place % round) + round) % round;
    return { drawing: at < count ? at : round - at, last: false };
  }
  return { drawing: ((place % count) + count) % count, last: ending() === "once" && place >= count - 1 };
}

function tick(time) {
  if (!playing) return;
  requestAnimationFrame(tick);
  const passed = Math.min(time - last, 250); // a page that was hidden goes on where it was
  last = time;
  if (shown !== current) return; // still in the making: the film waits for it
  clock += (passed / 1000) * film.fps * speed();
  let moved = false;
  while (clock >= film.held[current]) {
    if (order(position).last) return pause();
    clock -= film.held[current];
    position++;
    current = order(position).drawing;
    moved = true;
    if (!pictures.has(current)) { clock = 0; break; }
  }
  if (moved) { showPlace(); repaint(); }
}

function play() {
  if (playing || count < 2) return;
  if (order(position).last) go(0);
  playing = true;
  clock = 0;
  last = performance.now();
  requestAnimationFrame(tick);
  showPlaying();
  repaint();
}

function pause() {
  if (!playing) return;
  playing = false;
  position = current;
  showPlaying();
  repaint();
}

/** Show a drawing; past an end of a film that loops, from its other end. */
function go(drawing) {
  const inside = Math.min(Math.max(drawing, 0), count - 1);
  current = film.loop ? ((drawing % count) + count) % count : inside;
  position = current;
  clock = 0;
  showPlace();
  repaint();
}

function step(by) {
  pause();
  go(current + by);
}

// ------------------------------------------------------------------------------------- controls

const speed = () => 2 ** Number(byId("speed").value);
const ending = () => document.querySelector('input[name="end"]:checked').value;

function showPlaying() {
  const button = byId("play");
  button.setAttribute("aria-pressed", String(playing));
  button.setAttribute("aria-label", playing ? "Pause" : "Play");
  button.title = playing ? "Pause (space)" : "Play (space)";
  byId("to-play").toggleAttribute("hidden", playing);
  byId("to-pause").toggleAttribute("hidden", !playing);
}

function showPlace() {
  const [from, to] = [starts[current] + 1, starts[current + 1]];
  const frames = from === to ? String(from) : `${from}–${to}`;
  const words = `${frames} / ${starts[count]}`;
  byId("scrub").value = String(current);
  byId("scrub").setAttribute("aria-valuetext", `frame ${words}`);
  byId("place").textContent = words;
  canvas.setAttribute("aria-label", `${film.title}, frame ${words}`);
}

function showValues() {
  const rate = film.fps * speed();
  const shown = { speed: `${Number(rate.toFixed(1))} fps`, before: byId("before").value, after: byId("after").value };
  for (const [id, text] of Object.entries(shown)) {
    byId(id).closest("label").querySelector("output").textContent = text;
  }
}

function showGround() {
  const chosen = document.querySelector('input[name="ground"]:checked').value;
  const colour = { own: film.background || "#ffffff", none: "", colour: byId("colour").value }[chosen];
  sheet.classList.toggle("none", chosen === "none");
  sheet.style.backgroundColor = colour;
}

async function save() {
  const at = current;
  const text = await svgText(at);
  const link = document.createElement("a");
  const digits = Math.max(3, String(starts[count] - 1).length);
  link.download = `${film.title}-${String(starts[at]).padStart(digits, "0")}.svg`;
  link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  say(`Saved ${link.download}`);
}

let silence = 0;
function say(text) {
  byId("said").textContent = text;
  byId("said").classList.add("shown");
  clearTimeout(silence);
  silence = setTimeout(() => byId("said").classList.remove("shown"), 2500);
}

function turnSpeed(by) {
  byId("speed").value = String(Number(byId("speed").value) + by);
  showValues();
}

const keys = {
  " ": () => (playing ? pause() : play()),
  k: () => (playing ? pause() : play()),
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  ",": () => step(-1),
  ".": () => step(1),
  Home: () => step(-current),
  End: () => step(count - 1 - current),
  o: () => byId("onion").click(),
  l: () => {
    const all = [...document.querySelectorAll('input[name="end"]')];
    all[(all.findIndex((one) => one.checked) + 1) % all.length].click();
  },
  "+": () => turnSpeed(0.5),
  "=": () => turnSpeed(0.5),
  "-": () => turnSpeed(-0.5),
};

addEventListener("keydown", (event) => {
  const { key } = event;
  if ((event.ctrlKey || event.metaKey) && key.toLowerCase() === "s") {
    event.preventDefault();
    save();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const within = event.target;
  const range = within.type === "range" && within.id !== "scrub";
  if (range && (key.startsWith("Arrow") || key === "Home" || key === "End")) return;
  if (within.type === "radio" && key.startsWith("Arrow")) return;
  if (key === " " && /^(BUTTON|SUMMARY)$/.test(within.tagName)) return; // it is pressed
  if (key === " " && (within.type === "checkbox" || within.type === "radio")) return;
  const act = keys[key.length === 1 ? key.toLowerCase() : key];
  if (!act) return;
  event.preventDefault();
  act();
});

function listen() {
  byId("play").addEventListener("click", () => (playing ? pause() : play()));
  byId("back").addEventListener("click", () => step(-1));
  byId("forward").addEventListener("click", () => step(1));
  byId("save").addEventListener("click", save);
  byId("scrub").addEventListener("input", () => {
    pause();
    go(Number(byId("scrub").value));
  });
  for (const id of ["speed", "before", "after", "onion"]) {
    byId(id).addEventListener("input", () => {
      showValues();
      repaint();
    });
  }
  for (const one of document.querySelectorAll('input[name="ground"]')) one.addEventListener("change", showGround);
  for (const one of document.querySelectorAll('input[name="end"]')) {
    one.addEventListener("change", () => { position = current; });
  }
  byId("colour").addEventListener("input", () => {
    document.querySelector('input[name="ground"][value="colour"]').checked = true;
    showGround();
  });
  canvas.addEventListener("click", () => (playing ? pause() : play()));
  addEventListener("resize", fit);
  new ResizeObserver(fit).observe(stage);
}

function begin() {
  byId("scrub").max = String(count - 1);
  document.querySelector(`input[name="end"][value="${film.loop ? "loop" : "pingpong"}"]`).checked = true;
  document.querySelector(`input[name="ground"][value="${film.background === "" ? "none" : "own"}"]`).checked = true;
  for (const id of ["play", "back", "forward", "scrub"]) byId(id).disabled = count < 2;
  listen();
  showValues();
  showGround();
  showPlace();
  showPlaying();
  fit();
  repaint();
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play();
  document.documentElement.dataset.ready = "yes";
}

begin();
