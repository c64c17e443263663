// Our own SVG, read and written anew. The file is parsed as data and never put into the page.

const { ATTRIBUTES, PAPER_ID, PATH_SLACK, WIDTH_SLACK } = CONSTANTS.format;
const { DATA, STROKE_CLASS, TONE_CLASS } = CONSTANTS.format;
const { SHARE_DECIMALS, WIDTH_DECIMALS, LANDMARK_DECIMALS } = CONSTANTS.format;
const { IMAGE_LEVELS_GRAIN, IMAGE_LEVELS_SOFT, IMAGE_COLORS } = CONSTANTS.format;
const { STRIP_LEVELS, STRIP_LEVELS_FEW, STRIP_COLORS } = CONSTANTS.format;
const { GRAIN } = CONSTANTS.ink;
const XLINK = "http://www.w3.org/1999/xlink";
const SLEEPING = "data-sleeping-style"; // what `style` is called until a file is written
const SVG = "http://www.w3.org/2000/svg";

/**
 * SVG text of ours -> {text, xml, size, background, options, layers, strokes: [...]}, in painting
 * order.
 */
async function readDrawing(text) {
  // a style attribute would be applied even here, and the page's policy would refuse it: it sleeps
  // until it is written
  const xml = new DOMParser().parseFromString(
    text.replaceAll(" style=", ` ${SLEEPING}=`),
    "image/svg+xml",
  );
  const root = xml.documentElement;
  const size = root.getAttribute(ATTRIBUTES.SIZE).split(" ").map(Number);
  const options = new Map(
    (root.getAttribute(ATTRIBUTES.OPTIONS) ?? "").split(/\s+/).map((pair) => pair.split("=")),
  );
  const rectangle = xml.getElementById(PAPER_ID);
  const strokes = await Promise.all(
    Array.from(xml.querySelectorAll(`[${ATTRIBUTES.PATH}]`), readStroke),
  );
  const ribbons = strokes.filter((stroke) => stroke.strip);
  const columns = Math.max(...ribbons.map((stroke) => stroke.strip.columns));
  const stout = Math.max(
    ...ribbons.map(({ line, margin }) => Math.max(...line.width) / 2 / Math.max(margin, 1e-3)),
  );
  for (const stroke of ribbons) {
    stroke.strip = wider(stroke.strip, columns);
    stroke.stout = stout; // half width by margin, of the drawing's stoutest stroke
  }
  const background = rectangle ? rectangle.getAttribute("fill") : null;
  return {
    text,
    xml,
    size,
    background,
    options,
    layers: layersOf(strokes, options.get("layers") === "part"),
    strokes,
  };
}

/**
 * The layers of a drawing, the topmost first: {key, name, count, inner: layers of the same form};
 * `key` says in an edit's `hidden` that it is off. Kinds hold the named parts of the shape, or the
 * other way round.
 */
function layersOf(strokes, partsFirst) {
  const kind = (stroke) => [stroke.kind, stroke.kind];
  const part = (stroke) => [`/${stroke.part}`, stroke.part || "no part"];
  const both = (stroke) => `${stroke.kind}/${stroke.part}`;
  const [outer, inner] = partsFirst ? [part, kind] : [kind, part];
  const grouped = (some, nameOf, keyOf) => {
    const layers = new Map();
    for (const stroke of some) {
      const name = nameOf(stroke)[1];
      if (!layers.has(name)) layers.set(name, { key: keyOf(stroke), name, strokes: [] });
      layers.get(name).strokes.push(stroke);
    }
    return Array.from(layers.values()).reverse();
  };
  const parts = strokes.some((stroke) => stroke.part);
  return grouped(strokes, outer, (stroke) => outer(stroke)[0]).map(
    ({ key, name, strokes: own }) => ({
      key,
      name,
      count: own.length,
      inner: parts
        ? grouped(own, inner, both).map((layer) => ({
            ...layer,
            count: layer.strokes.length,
            inner: [],
          }))
        : [],
    }),
  );
}

async function readStroke(element, number) {
  const [x, y] = readPath(element.getAttribute(ATTRIBUTES.PATH));
  const closed = element.getAttribute(ATTRIBUTES.CLOSED) === "1";
  const fill = element.getAttribute("fill") ?? "#000000";
  const opacity = Number(
    element.getAttribute(ATTRIBUTES.OPACITY) ?? element.getAttribute("fill-opacity") ?? 1,
  );
  const color = [1, 3, 5].map((i) => parseInt(fill.slice(i, i + 2), 16) / 255).concat(opacity);
  const kept = element.getAttribute(ATTRIBUTES.TEXTURE) ?? element.getAttribute(ATTRIBUTES.STRIP);
  const strip = kept ? readStrip(await readPng(bytesOf(kept))) : null;
  const line = widened(x, y, element.getAttribute(ATTRIBUTES.WIDTH), closed);
  line.was = counting(line.x.length);
  const margin = Number(element.getAttribute(ATTRIBUTES.MARGIN) ?? 0);
  const [kind, part] = [
    element.getAttribute(ATTRIBUTES.CLASS),
    element.getAttribute(ATTRIBUTES.PART) ?? "",
  ];
  return { element, number, id: element.id, kind, part, line, color, strip, margin };
}

/** "M x y l dx dy ..." -> [x, y]. */
function readPath(data) {
  const numbers = Float64Array.from(data.match(/-?(\d+\.?\d*|\.\d+)(e-?\d+)?/g) ?? [], Number);
  const x = numbers.filter((_, i) => i % 2 === 0);
  const y = numbers.filter((_, i) => i % 2 === 1);
  for (let i = 1; i < x.length; i++) [x[i], y[i]] = [x[i] + x[i - 1], y[i] + y[i - 1]];
  return [x, y];
}

/**
 * A line with the widths of a stroke's width attribute: one a point, or "t,w ..." of which every t
 * becomes a point.
 */
function widened(x, y, data, closed) {
  const pairs = data
    .trim()
    .split(/\s+/)
    .map((pair) => pair.split(",").map(Number));
  if (!data.includes(",")) return { x, y, width: Float64Array.from(pairs, ([w]) => w), closed };
  const s = arcLength(x, y);
  const total = s[s.length - 1];
  const t = Float64Array.from(pairs, ([at]) => at * total);
  const width = Float64Array.from(pairs, ([, w]) => w);
  const at = Float64Array.from([...s, ...t.filter((v) => v > 1e-6 && v < total - 1e-6)]).sort();
  const kept = at.filter((v, i) => i === 0 || v - at[i - 1] > 1e-6 || i === at.length - 1);
  const [px, py] = interp(kept, s, x, y);
  return { x: px, y: py, width: interp(kept, t, width)[0], closed };
}

/**
 * A texture's PNG, u to the right -> {rows along u, columns across, and of every texel, u by u}:
 * `alpha` bytes of one ink, or else `data`, premultiplied RGBA bytes.
 */
function readStrip({ width: rows, height: columns, index, levels, palette }) {
  const table = (palette ?? []).map(([r, g, b, a]) => [
    (r * a) / 255,
    (g * a) / 255,
    (b * a) / 255,
    a,
  ]);
  const alpha = palette ? null : new Uint8Array(rows * columns);
  const data = palette ? new Uint8ClampedArray(4 * rows * columns) : null;
  for (let c = 0; c < columns; c++) {
    for (let r = 0; r < rows; r++) {
      const value = index[c * rows + r];
      if (palette) data.set(table[value], 4 * (r * columns + c));
      else alpha[r * columns + c] = (255 * value) / levels;
    }
  }
  return { rows, columns, alpha, data };
}

// ----------------------------------------------------------------------------------------- writing

function numberText(value, decimals) {
  let text = value.toFixed(decimals);
  if (text.includes(".")) text = text.replace(/\.?0+$/, "");
  text = text.replace(/^(-?)0\./, "$1.");
  return text === "-0" ? "0" : text;
}

/**
 * Points [x0, y0, x1, y1, ...] as "x0 y0" and the steps between them, rounded so that errors do not
 * add up.
 */
function steps(points, decimals) {
  const unit = 10 ** decimals;
  const whole = points.map((p) => Math.round(p * unit));
  return whole.map((p, i) => numberText((i > 1 ? p - whole[i - 2] : p) / unit, decimals));
}

function pathText(x, y, decimals) {
  const points = Array.from(x).flatMap((value, i) => [value, y[i]]);
  const text = steps(points, decimals);
  return `M${text[0]} ${text[1]}l${text.slice(2).join(" ")}`.replaceAll(" -", "-");
}

function ringsText(rings, decimals) {
  const unit = 10 ** decimals;
  const parts = rings
    .filter((ring) => ring.length)
    .map((ring) => {
      const whole = ring.map((cubic) => cubic.map((p) => Math.round(p * unit)));
      const text = whole.map((c) =>
        [2, 3, 4, 5, 6, 7].map((i) => numberText((c[i] - c[i % 2]) / unit, decimals)).join(" "),
      );
      return `M${whole[0][0] / unit} ${whole[0][1] / unit}c${text.join(" ")}z`;
    });
  return parts.join("").replaceAll(" -", "-");
}

/**
 * The SVG text of a drawing with its strokes as `marks` has them: one mark a stroke, null where it
 * is to be left out. What was not changed is written as it was.
 */
async function writeDrawing(drawing, marks) {
  if (marks.every((mark) => mark && !mark.changed))
    return withDataOnShapes(
      drawing.text.replace(new RegExp(` ${ATTRIBUTES.STRIP}="[^"]*"`, "g"), ""),
    );
  const xml = drawing.xml.cloneNode(true);
  const elements = Array.from(xml.querySelectorAll(`[${ATTRIBUTES.PATH}]`));
  const anew = marks.filter((mark) => mark?.changed && mark.strip);
  const vector = drawing.options.get("texture") === "vector";
  const tones = vector ? tonesOf(anew, drawing.options) : null;
  for (const [i, element] of elements.entries()) {
    if (!marks[i]) removeStroke(element);
    else if (marks[i].changed) await writeStroke(element, marks[i], drawing.options, tones);
    element.removeAttribute(ATTRIBUTES.STRIP);
  }
  const written = new XMLSerializer()
    .serializeToString(xml.documentElement)
    .replaceAll(` ${SLEEPING}=`, " style=");
  return withDataOnShapes(`<?xml version="1.0" encoding="utf-8"?>\n${written}\n`);
}

/**
 * The text of a drawing with each stroke's data on the first shape in its group, as files have it:
 * there they outlast Inkscape's Ungroup. The page has all on the group.
 */
function withDataOnShapes(text) {
  const group = `(<g\\b[^<>]* class="${STROKE_CLASS}"[^<>]*>)`;
  const first = String.raw`((?:\s*<desc>[^<]*</desc>)?\s*<(?:path(?: d="[^"]*")?|image))`;
  const stroke = new RegExp(`${group}${first}([^]*?</g>)`, "g");
  const attribute = new RegExp(` ${DATA}[a-z]+="[^"]*"`, "g");
  return text.replace(stroke, (_, head, shape, rest) => {
    const data = head.match(attribute) ?? [];
    const others = rest.replaceAll("<path ", `<path class="${TONE_CLASS}" `);
    return head.replaceAll(attribute, "") + shape + data.join("") + others;
  });
}

function removeStroke(element) {
  const layer = element.parentNode;
  // its line
  if (element.previousSibling?.nodeType === Node.TEXT_NODE) element.previousSibling.remove();
  element.remove();
  if (layer.localName === "g" && !layer.children.length) removeStroke(layer);
}

async function writeStroke(element, mark, options, tones) {
  const decimals = Number(options.get("decimals") ?? CONSTANTS.options.decimals);
  const tolerance = Number(options.get("tolerance") ?? CONSTANTS.options.tolerance);
  const { line } = mark;
  const along = arcLength(line.x, line.y);
  const total = along[along.length - 1];
  const points = simplified([line.x, line.y], PATH_SLACK);
  const keep = simplified([along, line.width], WIDTH_SLACK);
  const pairs = keep.map(
    (i) =>
      `${numberText(total ? along[i] / total : i && 1, SHARE_DECIMALS)},` +
      numberText(line.width[i], WIDTH_DECIMALS),
  );
  element.setAttribute(
    ATTRIBUTES.PATH,
    pathText(
      points.map((i) => line.x[i]),
      points.map((i) => line.y[i]),
      decimals,
    ),
  );
  element.setAttribute(ATTRIBUTES.WIDTH, pairs.join(" "));
  element.removeAttribute(ATTRIBUTES.RINGS); // of the outline that was
  if (mark.strip) await writeTexture(element, mark, options, tones);
  else element.setAttribute("d", ringsText(outlineOf(line, tolerance), decimals));
  const places = drawnAt(mark.strip ? element.querySelector("path, image") : element);
  if (places)
    element.setAttribute(
      ATTRIBUTES.AT,
      places.map((xy) => xy.map((p) => numberText(p, LANDMARK_DECIMALS)).join(",")).join(" "),
    );
  else element.removeAttribute(ATTRIBUTES.AT);
}

async function writeTexture(element, mark, options, tones) {
  element.removeAttribute(ATTRIBUTES.TEXTURE);
  if (overlaps(mark.band, mark.stroke.margin)) {
    const levels = options.get("texture") === "vector" ? STRIP_LEVELS_FEW : STRIP_LEVELS;
    const png = await (mark.strip.alpha ? greyPng(mark.strip, levels) : colorPng(mark.strip));
    element.setAttribute(ATTRIBUTES.TEXTURE, base64Of(png));
  }
  if (options.get("texture") === "vector") writeTones(element, tones.get(mark));
  else await writeImage(element, mark, options);
}

/**
 * Where a shape is, so that a reader sees how another program moved it, [[x, y] x 4]: an image's
 * corners, or the points at 0, 1/4, 1/2 and 3/4 of the length of a path's first ring; then [area]
 * of the ring. Null where nothing is drawn.
 */
function drawnAt(shape) {
  if (shape?.localName === "image") {
    const [x, y, width, height] = ["x", "y", "width", "height"].map((name) =>
      Number(shape.getAttribute(name)),
    );
    return [0, 1, 1, 0].map((right, k) => [x + right * width, y + (k > 1 ? height : 0)]);
  }
  const d = shape?.getAttribute("d");
  if (!d) return null;
  // as ringsText and splineText write it
  const [, start, letter, rest] = /^M([^cq]*)([cq])([^z]*)z/.exec(d);
  const numbers = (text) => text.match(/-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)/g).map(Number);
  const ring = [numbers(start)];
  const values = numbers(rest);
  let control;
  for (let k = 0; k < values.length;) {
    const from = ring[ring.length - 1];
    const next = () => [from[0] + values[k++], from[1] + values[k++]];
    const piece = [from];
    if (letter === "c") piece.push(next(), next(), next());
    else {
      control = k ? [2 * from[0] - control[0], 2 * from[1] - control[1]] : next();
      piece.push(control, next());
    }
    for (let t = 1; t <= 8; t++) ring.push(curvePoint(piece, t / 8));
  }
  const [x, y] = [0, 1].map((axis) => Float64Array.from(ring, (point) => point[axis]));
  const along = arcLength(x, y);
  const wanted = [0, 0.25, 0.5, 0.75].map((share) => share * along[along.length - 1]);
  const [atX, atY] = interp(wanted, along, x, y);
  const unit = shape.hasAttribute("transform") ? TONE_UNIT : 1; // of tones
  const places = Array.from(atX, (value, i) => [value * unit, atY[i] * unit]);
  return [...places, [Math.abs(areaOf(ring)) * unit * unit]];
}

/** A point of a Bezier curve, by de Casteljau. */
function curvePoint(points, t) {
  if (points.length === 1) return points[0];
  return curvePoint(
    points.slice(1).map((to, i) => to.map((value, axis) => (1 - t) * points[i][axis] + t * value)),
    t,
  );
}

/** A strip of one ink as a grey PNG of 4 bits, in so many levels. */
function greyPng({ rows, columns, alpha }, levels) {
  const index = new Uint8Array(rows * columns);
  for (let r = 0; r < rows; r++) {
    for (let c = 0; c < columns; c++) {
      const level = Math.round((alpha[r * columns + c] / 255) * (levels - 1)) / (levels - 1);
      index[c * rows + r] = Math.round((STRIP_LEVELS - 1) * level);
    }
  }
  return writePng(rows, columns, index, null);
}

/** The change of a strip's opacity from one texel to the next along it, of the mean opacity. */
function changeAlong({ rows, columns, alpha }) {
  let [change, amount] = [0, 0];
  for (let i = 0; i < rows * columns; i++) {
    amount += alpha[i];
    if (i >= columns) change += Math.abs(alpha[i] - alpha[i - columns]);
  }
  return change / Math.max(amount, 1e-9);
}

function colorPng({ rows, columns, data }) {
  const planes = [0, 1, 2, 3].map(() => new Float32Array(rows * columns));
  for (let c = 0; c < columns; c++) {
    for (let r = 0; r < rows; r++) {
      for (let channel = 0; channel < 4; channel++) {
        planes[channel][c * rows + r] = data[4 * (r * columns + c) + channel] / 255;
      }
    }
  }
  const { palette, index } = quantised(planes, STRIP_COLORS);
  return writePng(rows, columns, index, palette);
}

/** The stroke as a raster of its own. */
async function writeImage(element, mark, options) {
  const resolution = Number(options.get("texture_res") ?? CONSTANTS.options.texture_res);
  const view = { scale: resolution, x: 0, y: 0 };
  const made = pixelsOf(mark, view, boxOf(mark, view));
  let png;
  if (mark.strip.alpha) {
    const ink = mark.color.slice(0, 3).map((c) => Math.round(255 * c));
    const levels = changeAlong(mark.strip) > GRAIN ? IMAGE_LEVELS_GRAIN : IMAGE_LEVELS_SOFT;
    // a faint stroke has as many levels
    const most = Math.max(
      made.a.subarray(0, made.count).reduce((m, a) => Math.max(m, a), 0),
      1e-6,
    );
    const palette = Array.from({ length: levels }, (_, k) => [
      ...ink,
      Math.round((255 * most * k) / (levels - 1)),
    ]);
    const index = new Uint8Array(made.w * made.h);
    for (let k = 0; k < made.count; k++) {
      index[made.place[k]] = Math.round((made.a[k] / most) * (levels - 1));
    }
    png = await writePng(made.w, made.h, index, palette);
  } else {
    const planes = ["r", "g", "b", "a"].map((name) => {
      const plane = new Float32Array(made.w * made.h);
      for (let k = 0; k < made.count; k++) plane[made.place[k]] = made[name][k];
      return plane;
    });
    const { palette, index } = quantised(planes, IMAGE_COLORS);
    png = await writePng(made.w, made.h, index, palette);
  }
  const box = { x: made.x0, y: made.y0, width: made.w, height: made.h };
  const image = element.ownerDocument.createElementNS(SVG, "image");
  for (const [name, value] of Object.entries(box))
    image.setAttribute(name, numberText(value / resolution, LANDMARK_DECIMALS));
  image.setAttribute("preserveAspectRatio", "none");
  image.setAttributeNS(XLINK, "xlink:href", `data:image/png;base64,${base64Of(png)}`);
  element.removeAttribute("clip-path");
  element.replaceChildren("\n", image);
}
