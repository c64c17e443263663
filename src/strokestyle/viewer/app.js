// The page: what is shown, what the hand does, and what is remembered of it.

const SETTLE = 200; // ms without a change until the picture is painted at its best
const CROWD = 14; // px of the screen between handles that are shown
const PART = 0.3; // of the background: where less than this changes, only that is painted
const BAND = 96; // rows of the picture at its best painted at a time
const PAINTERS = 4; // at most
const ROUGH = 0.3; // of the density of a mark whose texture is not looked at
const FRAME = 26; // ms a frame may take before it is painted coarser
const byId = (id) => document.getElementById(id);
const [ink, stage] = [byId("ink"), byId("stage")];

// one a drawing: {name, drawing, strokes, past, edit, future, camera, marks, saved}
const sheets = [];
let current = null;
let selected = -1; // the stroke whose handles are shown
let hovered = -1;
let gesture = null; // the slider or drag under way: one step of undo
let before = false;

// ------------------------------------------------------------------------------------------- state

/** Go on with another edit; those of one gesture are one step of undo. */
function change(edit, name = null) {
  if (!current) return;
  if (before) showBefore(false);
  if (name === null || name !== gesture) current.past.push(current.edit);
  gesture = name;
  current.edit = edit;
  current.future = [];
  current.saved = false;
  refresh();
}

function changeStroke(number, part, name = null) {
  const strokes = {
    ...current.edit.strokes,
    [number]: { ...strokeEdit(current.edit, number), ...part },
  };
  change({ ...current.edit, strokes }, name);
}

function travel(from, to) {
  if (!current[from].length) return;
  current[to].push(current.edit);
  current.edit = current[from].pop();
  current.saved = false;
  gesture = null;
  if (selected >= 0 && !visible(current.edit, current.drawing.strokes[selected])) selected = -1;
  refresh();
}

// ---------------------------------------------------------------------------------------- painting

let frame = 0; // the animation frame that was asked for, until it is shown
let handling = 0; // likewise, of the handles
let settling = 0; // the timer of the picture at its best
let round = 0; // goes up whenever something changes, so that a picture in the making is given up
let quality = 1;
// a frame is in the making: while a hand drags, controls change no oftener than the picture
let painting = false;
let stale = false; // they will have to
let shares = []; // of the picture's height, what each painter paints
let shown = null; // what the canvas shows: {sheet, edit, canvas, camera, size}

function refresh() {
  if (painting && gesture) stale = true;
  else showControls();
  repaint();
}

/**
 * Paint soon and fast, as coarse as this machine needs, and at its best once nothing changes any
 * more.
 */
function repaint() {
  round++;
  clearTimeout(settling);
  settling = setTimeout(paintWell, SETTLE);
  handling ||= requestAnimationFrame(placeHandles);
  frame ||= requestAnimationFrame(paintSoon);
}

async function paintSoon() {
  while (current) {
    const [start, mine] = [performance.now(), round];
    painting = true;
    await paint(quality);
    painting = false;
    if (stale) showControls();
    const took = performance.now() - start;
    if (took > FRAME) quality = Math.max(0.4, quality * Math.max(0.7, Math.sqrt(FRAME / took)));
    else if (took < 0.6 * FRAME) quality = Math.min(1, quality * 1.1);
    if (mine === round) break;
    if (took < 8) await new Promise(requestAnimationFrame); // no faster than the screen
  }
  frame = 0;
}

/**
 * Those who paint: a worker for each core; where a browser lets none work, the page does it itself.
 */
const painters = [];

function hirePainters() {
  const code = new Blob([byId("painter").textContent], { type: "text/javascript" });
  const count = Math.min(navigator.hardwareConcurrency || 1, PAINTERS);
  for (let k = 0; k < count; k++) painters.push(newPainter(code));
  shares = painters.map(() => 1 / count);
}

/** {tell(strokes), paint(job) -> bytes}: of several jobs one after another. */
function newPainter(code) {
  const waiting = [];
  const alone = ({ job, done }) => setTimeout(() => done(painted(sheets[job.sheet], job)));
  let worker = null;
  try {
    worker = new Worker(URL.createObjectURL(code));
    worker.onmessage = ({ data }) => waiting.shift().done(data);
    worker.onerror = (event) => {
      event.preventDefault();
      worker = null;
      waiting.splice(0).forEach(alone);
    };
  } catch {
    // some browsers allow a page from a file no workers
  }
  return {
    tell: (strokes) => worker?.postMessage({ strokes }),
    paint: (job) =>
      new Promise((done) => {
        if (!worker) return alone({ job, done });
        waiting.push({ job, done });
        worker.postMessage({ job });
      }),
  };
}

function backgroundColor() {
  const context = document.createElement("canvas").getContext("2d");
  context.fillStyle = "#ffffff";
  // a name becomes #rrggbb, nonsense is left out
  context.fillStyle = current.drawing.background ?? "#ffffff";
  const hex = parseInt(context.fillStyle.slice(1), 16);
  return 0xff000000 | ((hex & 255) << 16) | (hex & 0xff00) | (hex >> 16);
}

/**
 * The canvas at `fine` pixels a pixel of the screen: {width, height, its sides there, view, box of
 * the drawing seen}.
 */
function canvasAt(fine) {
  const density = devicePixelRatio * fine;
  const { zoom, x, y } = current.camera;
  const [width, height] = [
    Math.round(stage.clientWidth * density),
    Math.round(stage.clientHeight * density),
  ];
  const view = { scale: zoom * density, x: x * density, y: y * density };
  const [w, h] = current.drawing.size;
  const [x0, y0] = [Math.max(0, Math.round(view.x)), Math.max(0, Math.round(view.y))];
  const x1 = Math.min(width, Math.round(view.x + w * view.scale));
  const y1 = Math.min(height, Math.round(view.y + h * view.scale));
  const box = { x0, y0, width: x1 - x0, height: y1 - y0 };
  const sides = [`${stage.clientWidth}px`, `${stage.clientHeight}px`];
  return {
    width,
    height,
    sides,
    view,
    box: width > 0 && height > 0 && x1 > x0 && y1 > y0 ? box : null,
  };
}

function editShown() {
  return before ? UNEDITED : current.edit;
}

function sizeNow() {
  return `${stage.clientWidth} ${stage.clientHeight} ${devicePixelRatio}`;
}

/**
 * Show pictures, each {data, y0} of the rows of a box of the canvas, in place of what was there.
 */
function showCanvas(next, pictures, box = next.canvas.box) {
  const { canvas, camera, sheet } = next;
  const context = ink.getContext("2d");
  if (canvas !== shown?.canvas) {
    if (ink.width !== canvas.width || ink.height !== canvas.height)
      [ink.width, ink.height] = [canvas.width, canvas.height];
    // not the window's, which may grow before the next picture comes
    [ink.style.width, ink.style.height] = canvas.sides;
    context.clearRect(0, 0, canvas.width, canvas.height);
    const [w, h] = sheet.drawing.size;
    const sides = {
      left: camera.x,
      top: camera.y,
      width: camera.zoom * w,
      height: camera.zoom * h,
    };
    for (const [side, value] of Object.entries(sides))
      byId("background").style[side] = `${value}px`;
  }
  for (const { data, y0 } of pictures)
    context.putImageData(new ImageData(data, box.width), box.x0, y0);
  shown = next;
}

/** What is to be shown now, {sheet, edit, canvas, camera, size}, on a canvas. */
function pictureOn(canvas) {
  return { sheet: current, edit: editShown(), canvas, camera: current.camera, size: sizeNow() };
}

/** A painter's job, to paint a box of a picture. */
function jobOf({ sheet, edit, canvas }, box) {
  // in steps, so that marks outlast a little zoom
  const density = 2 ** (Math.ceil(4 * Math.log2(canvas.view.scale)) / 4);
  return {
    sheet: sheets.indexOf(sheet),
    edit,
    view: canvas.view,
    density,
    background: backgroundColor(),
    ...box,
  };
}

/**
 * Paint the drawing now: only what changed if that is little, else all of it at `fine` pixels a
 * pixel of the screen.
 */
async function paint(fine) {
  const from = shown;
  const part = partChanged();
  const next = pictureOn(part ? from.canvas : canvasAt(fine));
  const box = part ?? next.canvas.box;
  let pictures = [];
  if (box?.height && from) pictures = await paintBands(jobOf(next, box));
  // the first picture at once: painters may be long in coming
  else if (box?.height) pictures = [{ data: painted(current, jobOf(next, box)), y0: box.y0 }];
  if (current !== next.sheet || (part && shown !== from)) return; // something else is shown by now
  if (from && !part) balance(pictures);
  showCanvas(next, pictures, box);
}

/** Paint a job's rows, a band by each painter: [{data, y0, pace: ms a row}]. */
async function paintBands(job) {
  let share = 0;
  const ends = shares.map((each) => Math.round((share += each) * job.height));
  ends[ends.length - 1] = job.height;
  const bands = painters.map(async (painter, k) => {
    const top = k ? ends[k - 1] : 0;
    const height = ends[k] - top;
    if (height <= 0) return null;
    const start = performance.now();
    const data = await painter.paint({ ...job, y0: job.y0 + top, height });
    return { data, y0: job.y0 + top, pace: (performance.now() - start) / height };
  });
  return (await Promise.all(bands)).filter((band) => band);
}

/** Give each painter as many rows as it would paint in the same time as the others. */
function balance(pictures) {
  if (pictures.length < painters.length) return;
  const wanted = pictures.map(({ pace }, k) => Math.sqrt(shares[k] / Math.max(pace, 1e-6)));
  const sum = wanted.reduce((total, value) => total + value, 0);
  shares = wanted.map((value) => Math.max(value / sum, 0.02));
}

/**
 * The box of the canvas where strokes changed since it was painted; null where to paint that is no
 * less work than all.
 */
function partChanged() {
  const edit = editShown();
  if (shown?.camera !== current.camera || shown.sheet !== current || !shown.canvas.box) return null;
  if (shown.size !== sizeNow()) return null;
  const { box, view } = shown.canvas;
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const stroke of current.strokes) {
    const shapes = [shown.edit, edit].map(
      (each) => visible(each, stroke) && effective(each, stroke),
    );
    if (!shapes[0] && !shapes[1]) continue;
    if (shapes[0] && shapes[1] && sameShape(...shapes)) continue;
    for (const shape of shapes.filter((each) => each)) {
      const part = extentOf(edited(stroke, shape), stroke.margin);
      const [left, top, right, bottom] = part.map(
        (value, i) => view.scale * value + (i % 2 ? view.y : view.x),
      );
      [x0, y0] = [Math.min(x0, Math.floor(left - 1)), Math.min(y0, Math.floor(top - 1))];
      [x1, y1] = [Math.max(x1, Math.ceil(right + 1)), Math.max(y1, Math.ceil(bottom + 1))];
    }
    if ((x1 - x0) * (y1 - y0) > PART * box.width * box.height) return null;
  }
  [x0, y0] = [Math.max(x0, box.x0), Math.max(y0, box.y0)];
  [x1, y1] = [Math.min(x1, box.x0 + box.width), Math.min(y1, box.y0 + box.height)];
  const empty = !(x1 > x0 && y1 > y0);
  return empty
    ? { x0: 0, y0: 0, width: 0, height: 0 }
    : { x0, y0, width: x1 - x0, height: y1 - y0 };
}

/**
 * Paint the drawing with two pixels a pixel of the screen at least, a band at a time so that the
 * hand need not wait.
 */
async function paintWell() {
  const mine = round;
  // a coarse picture that is still being painted would take this one's place
  while (frame) await new Promise(requestAnimationFrame);
  if (mine !== round || !current) return;
  const next = pictureOn(canvasAt(Math.max(1, 2 / devicePixelRatio)));
  const { box } = next.canvas;
  if (!box) return;
  const bands = [];
  for (let y = 0; y < box.height; y += BAND)
    bands.push({ y0: box.y0 + y, height: Math.min(BAND, box.height - y) });
  const pictures = [];
  const job = { ...jobOf(next, box), density: Infinity };
  const work = async (painter) => {
    while (bands.length && mine === round) {
      const band = bands.shift();
      pictures.push({ ...band, data: await painter.paint({ ...job, ...band }) });
    }
  };
  await Promise.all(painters.map(work));
  if (mine === round) showCanvas(next, pictures);
}

/**
 * The centre line and handles of the selected stroke, or the line of the one under the mouse, over
 * the picture.
 */
function placeHandles() {
  handling = 0;
  const number = before ? -1 : selected >= 0 ? selected : hovered;
  const spine = byId("spine");
  const handles = byId("handles");
  spine.classList.toggle("hover", number !== selected);
  if (number < 0) {
    spine.removeAttribute("d");
    handles.replaceChildren();
    return;
  }
  const { zoom, x, y } = current.camera;
  const stroke = current.drawing.strokes[number];
  const mark = markNow(current, stroke, current.edit, ROUGH);
  const { line } = mark;
  const points = Array.from(
    line.x,
    (value, i) => `${(zoom * value + x).toFixed(1)} ${(zoom * line.y[i] + y).toFixed(1)}`,
  );
  spine.setAttribute("d", `M${points.join("L")}`);
  if (number !== selected) {
    handles.replaceChildren();
    return;
  }
  const at = handlePlaces(stroke);
  while (handles.children.length > at.length) handles.lastChild.remove();
  while (handles.children.length < at.length) handles.append(newHandle(handles.children.length));
  let last = [-Infinity, -Infinity];
  at.forEach((want, k) => {
    const [px, py] = pointAt(mark, want);
    const crowded = zoom * Math.hypot(px - last[0], py - last[1]) < CROWD;
    if (!crowded) last = [px, py];
    handles.children[k].classList.toggle(
      "crowded",
      crowded && handles.children[k] !== document.activeElement,
    );
    const handle = handles.children[k];
    handle.setAttribute("transform", `translate(${zoom * px + x} ${zoom * py + y})`);
    handle.setAttribute("aria-label", `Point ${k + 1} of ${at.length}`);
  });
}

function newHandle(k) {
  const group = document.createElementNS(SVG, "g");
  for (const name of ["", "grab"]) {
    const circle = document.createElementNS(SVG, "circle");
    if (name) circle.setAttribute("class", name);
    group.append(circle);
  }
  group.setAttribute("tabindex", "0");
  group.setAttribute("role", "button");
  group.dataset.k = k;
  return group;
}

function lineLengths(stroke) {
  return (stroke.lengths ??= arcLength(stroke.line.x, stroke.line.y));
}

/** Arc lengths of a stroke's handles on its line as it was. */
function handlePlaces(stroke) {
  return (stroke.handles ??= handlesOf(stroke.line).map((i) => lineLengths(stroke)[i]));
}

/** Where the point at arc length `at` of a stroke's line as it was lies now. */
function pointAt({ stroke, line }, at) {
  const [point] = interp(Float64Array.of(at), lineLengths(stroke), counting(stroke.line.x.length));
  const [[x], [y]] = interp(point, line.was, line.x, line.y);
  return [x, y];
}

// -------------------------------------------------------------------------------------- the camera

function fit() {
  const [w, h] = current.drawing.size;
  const [across, down] = [stage.clientWidth, stage.clientHeight];
  const margin = Math.min(28, 0.04 * Math.min(across, down));
  const zoom = Math.min((across - 2 * margin) / w, (down - 2 * margin) / h);
  current.camera = { zoom, x: (across - zoom * w) / 2, y: (down - zoom * h) / 2, fitted: true };
  refresh();
}

function zoomBy(factor, px = stage.clientWidth / 2, py = stage.clientHeight / 2) {
  const { zoom, x, y } = current.camera;
  const next = Math.min(Math.max(zoom * factor, 0.05), 64);
  const f = next / zoom;
  current.camera = { zoom: next, x: px - f * (px - x), y: py - f * (py - y), fitted: false };
  refresh();
}

function panBy(dx, dy) {
  const { zoom, x, y } = current.camera;
  current.camera = { zoom, x: x + dx, y: y + dy, fitted: false };
  repaint();
}

/**
 * The stroke under a point of the stage, topmost first, and where along its line as it was:
 * {number, at} or null.
 */
function strokeUnder(px, py, slack = 6) {
  const { zoom, x, y } = current.camera;
  const [qx, qy] = [(px - x) / zoom, (py - y) / zoom];
  let best = null;
  let least = slack;
  for (const stroke of current.drawing.strokes) {
    if (!visible(current.edit, stroke)) continue;
    const mark = markNow(current, stroke, current.edit, ROUGH);
    const { line } = mark;
    const [x0, y0, x1, y1] = prepared(mark).extent;
    const far = slack / zoom;
    if (qx < x0 - far || qy < y0 - far || qx > x1 + far || qy > y1 + far) continue;
    for (let i = 0; i + 1 < line.x.length; i++) {
      const [dx, dy] = [line.x[i + 1] - line.x[i], line.y[i + 1] - line.y[i]];
      const size = dx * dx + dy * dy;
      const t = size
        ? Math.min(Math.max(((qx - line.x[i]) * dx + (qy - line.y[i]) * dy) / size, 0), 1)
        : 0;
      const off = Math.hypot(qx - line.x[i] - t * dx, qy - line.y[i] - t * dy) - line.width[i] / 2;
      const distance = Math.max(zoom * off, 0) - (stroke.number === selected ? 0.5 : 0);
      if (distance <= least) {
        least = distance;
        best = { stroke, was: line.was[i] + t * (line.was[i + 1] - line.was[i]) };
      }
    }
  }
  if (!best) return null;
  const lengths = lineLengths(best.stroke);
  const [[at]] = interp(Float64Array.of(best.was), counting(lengths.length), lengths);
  return { number: best.stroke.number, at };
}

// ---------------------------------------------------------------------------------------- the hand

const pointers = new Map();
let drag = null; // {kind: "pan" | "bend", ...}

function place(event) {
  const box = stage.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

function select(number) {
  if (selected === number) return;
  selected = number;
  hovered = -1;
  if (number >= 0) {
    const stroke = current.drawing.strokes[number];
    const s = lineLengths(stroke);
    byId("reach").value = Math.round(Math.min(Math.max(s[s.length - 1] / 4, 16), 90));
  }
  refresh();
}

/**
 * Move what lies at arc length `at` of a stroke by (dx, dy) px of the drawing, on top of `moves`.
 */
function bend(number, moves, at, dx, dy, name) {
  changeStroke(
    number,
    { moves: [...moves, { at, reach: Number(byId("reach").value), dx, dy }] },
    name,
  );
}

stage.addEventListener("pointerdown", (event) => {
  if (event.target.closest(".zoom") || !current) return;
  const [px, py] = place(event);
  pointers.set(event.pointerId, [px, py]);
  stage.setPointerCapture(event.pointerId);
  if (pointers.size === 2) {
    drag = null;
    return;
  }
  if (before) showBefore(false);
  const handle = event.target.closest("#handles g");
  const under =
    handle || event.button ? null : strokeUnder(px, py, event.pointerType === "touch" ? 14 : 6);
  const bending = handle || (under && under.number === selected);
  if (bending) {
    const stroke = current.drawing.strokes[selected];
    const at = handle ? handlePlaces(stroke)[handle.dataset.k] : under.at;
    const { moves } = strokeEdit(current.edit, selected);
    drag = { kind: "bend", at, moves, from: [px, py], name: `bend ${event.timeStamp}` };
    handle?.focus();
  } else drag = { kind: "pan", last: [px, py], from: [px, py], under, moved: false };
  event.preventDefault();
  if (!handle) ink.focus({ preventScroll: true });
});

stage.addEventListener("pointermove", (event) => {
  if (!current) return;
  const [px, py] = place(event);
  if (!pointers.has(event.pointerId)) {
    const under = event.target.closest("#handles g, .zoom") ? null : strokeUnder(px, py);
    ink.classList.toggle("over", under !== null && under.number !== selected);
    ink.classList.toggle("bend", under !== null && under.number === selected);
    const next = under ? under.number : -1;
    if (next !== hovered) {
      hovered = next;
      placeHandles();
    }
    return;
  }
  const last = pointers.get(event.pointerId);
  pointers.set(event.pointerId, [px, py]);
  if (pointers.size === 2) {
    const [other] = Array.from(pointers.entries()).filter(([id]) => id !== event.pointerId);
    const [ox, oy] = other[1];
    const [was, is] = [Math.hypot(last[0] - ox, last[1] - oy), Math.hypot(px - ox, py - oy)];
    panBy((px - last[0]) / 2, (py - last[1]) / 2);
    if (was > 0) zoomBy(is / was, (px + ox) / 2, (py + oy) / 2);
    return;
  }
  if (drag?.kind === "bend") {
    const { zoom } = current.camera;
    const [dx, dy] = [(px - drag.from[0]) / zoom, (py - drag.from[1]) / zoom];
    if (gesture === drag.name || Math.hypot(px - drag.from[0], py - drag.from[1]) > 2) {
      bend(selected, drag.moves, drag.at, dx, dy, drag.name);
    }
  } else if (drag?.kind === "pan") {
    drag.moved ||= Math.hypot(px - drag.from[0], py - drag.from[1]) > 4;
    if (drag.moved) {
      ink.classList.add("held");
      panBy(px - drag.last[0], py - drag.last[1]);
      drag.last = [px, py];
    }
  }
});

for (const name of ["pointerup", "pointercancel"]) {
  stage.addEventListener(name, (event) => {
    if (!pointers.delete(event.pointerId)) return;
    ink.classList.remove("held");
    if (drag?.kind === "pan" && !drag.moved && name === "pointerup")
      select(drag.under ? drag.under.number : -1);
    drag = null;
    gesture = null;
  });
}
stage.addEventListener("pointerleave", () => {
  hovered = -1;
  if (current) placeHandles();
});
stage.addEventListener(
  "wheel",
  (event) => {
    if (!current) return;
    event.preventDefault();
    const unit = event.deltaMode === 1 ? 18 : 1;
    if (event.shiftKey) panBy(-unit * (event.deltaX || event.deltaY), 0);
    else zoomBy(Math.exp(-unit * event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)), ...place(event));
  },
  { passive: false },
);

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

document.addEventListener("keydown", (event) => {
  if (!current) return;
  const { key } = event;
  const command = event.ctrlKey || event.metaKey;
  const typing = event.target.matches("input, summary, [role=tab]");
  const handle = event.target.closest?.("#handles g");
  let done = true;
  if (command && key.toLowerCase() === "z")
    event.shiftKey ? travel("future", "past") : travel("past", "future");
  else if (command && key.toLowerCase() === "y") travel("future", "past");
  else if (command && key.toLowerCase() === "s") save();
  else if (command || event.altKey) done = false;
  else if (ARROWS[key] && !typing) {
    const [dx, dy] = ARROWS[key].map((d) => d * (event.shiftKey ? 10 : 1));
    if (handle) {
      const stroke = current.drawing.strokes[selected];
      nudge(stroke, handlePlaces(stroke)[handle.dataset.k], dx, dy);
    } else panBy(-40 * Math.sign(dx), -40 * Math.sign(dy));
  } else if (key === "+" || key === "=") zoomBy(1.25);
  else if (key === "-") zoomBy(0.8);
  else if (key === "0") fit();
  else if (key === "1") zoomBy(1 / current.camera.zoom);
  else if (key === "[" || key === "]") step(key === "]" ? 1 : -1);
  else if (key === "b" || key === "B") showBefore(!before);
  else if ((key === "Delete" || key === "Backspace") && selected >= 0 && !typing) removeSelected();
  else if (key === "Escape") select(-1);
  else done = false;
  if (done) event.preventDefault();
});
document.addEventListener("keyup", (event) => {
  if (ARROWS[event.key]) gesture = null;
});

/** Move a point by keys: taps and repeats of one key press add up in one move. */
function nudge(stroke, at, dx, dy) {
  const name = `nudge ${stroke.number} ${at}`;
  const { moves } = strokeEdit(current.edit, stroke.number);
  const last = moves[moves.length - 1];
  const reach = Number(byId("reach").value);
  if (last && last.at === at && last.reach === reach)
    bend(stroke.number, moves.slice(0, -1), at, last.dx + dx, last.dy + dy, name);
  else bend(stroke.number, moves, at, dx, dy, name);
}

function step(by) {
  const numbers = current.drawing.strokes
    .filter((stroke) => visible(current.edit, stroke))
    .map((s) => s.number);
  if (!numbers.length) return;
  const at = numbers.indexOf(selected);
  select(
    numbers[
      at < 0 ? (by > 0 ? 0 : numbers.length - 1) : (at + by + numbers.length) % numbers.length
    ],
  );
}

function removeSelected() {
  const number = selected;
  selected = -1;
  changeStroke(number, { removed: true });
  ink.focus({ preventScroll: true });
}

// ------------------------------------------------------------------------------------ the controls

const SLIDERS = {
  thickness: {
    text: (v) => `× ${(2 ** v).toFixed(2)}`,
    get: (edit) => Math.log2(edit.thickness),
    set: (v) => ({ thickness: 2 ** v }),
  },
  wiggle: {
    text: (v) => `${v.toFixed(1)} px`,
    get: (edit) => edit.wiggle,
    set: (v) => ({ wiggle: v }),
  },
  wavelength: {
    text: (v) => `${v.toFixed(0)} px`,
    get: (edit) => edit.wavelength,
    set: (v) => ({ wavelength: v }),
  },
};

function sliderOf(id) {
  return {
    input: byId(id),
    output: byId(id).previousElementSibling,
    ...SLIDERS[id.replace("one-", "")],
  };
}

for (const id of ["thickness", "wiggle", "wavelength", "one-thickness", "one-wiggle"]) {
  const { input, set } = sliderOf(id);
  input.addEventListener("input", () => {
    const part = set(Number(input.value));
    if (id.startsWith("one-")) changeStroke(selected, part, id);
    else change({ ...current.edit, ...part }, id);
  });
  input.addEventListener("change", () => (gesture = null));
  input.addEventListener("dblclick", () => {
    input.value = id === "wavelength" ? UNEDITED.wavelength : 0;
    input.dispatchEvent(new Event("input"));
    gesture = null;
  });
}
byId("reach").addEventListener("input", showControls);
byId("undo").addEventListener("click", () => travel("past", "future"));
byId("redo").addEventListener("click", () => travel("future", "past"));
byId("before").addEventListener("click", () => showBefore(!before));
byId("save").addEventListener("click", () => save());
byId("smaller").addEventListener("click", () => zoomBy(0.8));
byId("larger").addEventListener("click", () => zoomBy(1.25));
byId("fit").addEventListener("click", fit);
byId("remove").addEventListener("click", removeSelected);
byId("restore").addEventListener("click", () => {
  const strokes = { ...current.edit.strokes };
  delete strokes[selected];
  change({ ...current.edit, strokes });
});
byId("reset").addEventListener("click", () => change(UNEDITED));

function showBefore(on) {
  before = on;
  byId("before").setAttribute("aria-pressed", String(on));
  byId("note").hidden = !on;
  repaint();
}

/** Bring every control in line with the edit. */
function showControls() {
  stale = false;
  const { edit, past, future, camera, drawing } = current;
  const stroke = selected >= 0 ? drawing.strokes[selected] : null;
  for (const id of ["thickness", "wiggle", "wavelength", "one-thickness", "one-wiggle"]) {
    const { input, output, get, text } = sliderOf(id);
    const value = get(id.startsWith("one-") ? strokeEdit(edit, selected) : edit);
    if (Math.abs(Number(input.value) - value) > 1e-9) input.value = value;
    output.textContent = text(value);
    input.setAttribute("aria-valuetext", text(value));
  }
  byId("reach").previousElementSibling.textContent = `${byId("reach").value} px`;
  byId("one").disabled = !stroke;
  byId("which").textContent = stroke
    ? `${stroke.kind}, ${stroke.id}`
    : "Click a stroke to bend it by its points, or to change it alone.";
  byId("restore").disabled = !stroke || strokeEdit(edit, selected) === PLAIN;
  byId("undo").disabled = !past.length;
  byId("redo").disabled = !future.length;
  byId("reset").disabled = edit === UNEDITED;
  byId("percent").textContent = `${Math.round(100 * camera.zoom)} %`;
  for (const input of byId("layers").querySelectorAll("input"))
    input.checked = !edit.hidden.includes(input.value);
  sheets.forEach((sheet, i) => {
    const tab = byId("tabs").children[i];
    tab.setAttribute("aria-selected", String(sheet === current));
    tab.tabIndex = sheet === current ? 0 : -1;
    tab.classList.toggle("changed", !sheet.saved && sheet.edit !== UNEDITED);
  });
}

function showLayers() {
  const rows = current.drawing.layers.flatMap((layer) => {
    const row = layerRow(layer);
    if (layer.inner.length < 2) return [row];
    const inside = document.createElement("details");
    const summary = document.createElement("summary");
    summary.textContent = layer.inner.map(({ name }) => name).join(", ");
    inside.append(summary, ...layer.inner.map(layerRow));
    return [row, inside];
  });
  byId("layers").replaceChildren(byId("layers").firstElementChild, ...rows);
  byId("layers").hidden = !rows.length;
}

function layerRow({ key, name, count }) {
  const label = document.createElement("label");
  label.className = "check";
  const input = document.createElement("input");
  [input.type, input.value] = ["checkbox", key];
  input.addEventListener("change", () => {
    const others = current.edit.hidden.filter((other) => other !== key);
    const edit = { ...current.edit, hidden: input.checked ? others : [...others, key] };
    if (selected >= 0 && !visible(edit, current.strokes[selected])) selected = -1;
    change(edit);
  });
  const [words, output] = [document.createElement("span"), document.createElement("output")];
  words.textContent = words.title = name;
  output.textContent = count;
  label.append(input, words, output);
  return label;
}

function showSheet(sheet) {
  current = sheet;
  selected = hovered = -1;
  gesture = null;
  showBefore(false);
  ink.setAttribute("aria-label", `${sheet.name}: ${sheet.drawing.strokes.length} strokes`);
  showLayers();
  if (!sheet.camera || sheet.camera.fitted) fit();
  else refresh();
}

let saying = 0;

function say(text) {
  const said = byId("said");
  said.textContent = text;
  said.classList.add("shown");
  clearTimeout(saying);
  saying = setTimeout(() => said.classList.remove("shown"), 4000);
}

/**
 * What is seen now, as SVG text: layers that are off and strokes that were deleted are left out.
 */
function savedText(sheet) {
  const shown = (stroke) =>
    visible(sheet.edit, stroke) ? markNow(sheet, stroke, sheet.edit) : null;
  return writeDrawing(sheet.drawing, sheet.drawing.strokes.map(shown));
}

async function save() {
  const sheet = current;
  const { edit } = sheet;
  byId("save").disabled = true;
  try {
    const text = await savedText(sheet);
    const link = document.createElement("a");
    link.download = `${sheet.name.replace(/\.svgz?$/i, "")}-edited.svg`;
    link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    sheet.saved = sheet.edit === edit;
    const count = sheet.drawing.strokes.filter((stroke) => visible(edit, stroke)).length;
    const left = sheet.drawing.strokes.length - count;
    say(
      `${link.download}: ${count} strokes${left ? `, ${left} left out` : ""}, ` +
        `${Math.ceil(text.length / 1000)} kB`,
    );
  } catch (error) {
    say(`Not saved: ${error.message}`);
  } finally {
    byId("save").disabled = false;
    showControls();
  }
}

addEventListener("beforeunload", (event) => {
  if (sheets.some((sheet) => !sheet.saved && sheet.edit !== UNEDITED)) event.preventDefault();
});
new ResizeObserver(() => {
  if (!current) return;
  if (current.camera?.fitted) fit();
  else repaint();
}).observe(stage);

// --------------------------------------------------------------------------------------- beginning

async function begin() {
  hirePainters();
  for (const [i, { name, svg }] of JSON.parse(byId("data").textContent).entries()) {
    const drawing = await readDrawing(svg);
    const { strokes } = drawing;
    const sheet = {
      name,
      drawing,
      strokes,
      past: [],
      edit: UNEDITED,
      future: [],
      camera: null,
      marks: [],
      saved: false,
    };
    sheets.push(sheet);
    for (const painter of painters) painter.tell(strokes.map(({ element, ...stroke }) => stroke));
    const tab = document.createElement("button");
    tab.textContent = tab.title = name;
    tab.setAttribute("role", "tab");
    tab.addEventListener("click", () => showSheet(sheet));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!by) return;
      const next = (i + by + sheets.length) % sheets.length;
      showSheet(sheets[next]);
      byId("tabs").children[next].focus();
    });
    byId("tabs").append(tab);
    if (!i) showSheet(sheet);
  }
  byId("tabs").classList.toggle("single", sheets.length === 1);
  showControls();
  document.documentElement.dataset.ready = "yes";
}

begin().catch((error) => say(`This page cannot be shown: ${error.message}`));
