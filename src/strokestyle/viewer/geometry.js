// Centre lines, ribbons and edits, as ribbons.py and strokes.py have them. A line is {x, y, width, closed}: typed
// arrays, pixels of the drawing; a closed one repeats its first point as its last. Nothing here is ever changed in place.

const STIFFNESS = 0.35; // of a ribbon's half width: sigma of its centre line's smoothing
const NARROWING = 0.25; // px a px: the most by which a ribbon's half width falls along it
const THIN = 0.01; // px that a point left out of a ribbon may lie off
const QUICK = 0.15; // px likewise, while things move
const SPACING = 3; // px between the points of a line that is edited
const DENSE = 1; // px between those of a line that is bent by hand

/** Arc length from the first point to each. */
function arcLength(x, y) {
  const s = new Float64Array(x.length);
  for (let i = 1; i < s.length; i++) {
    const [dx, dy] = [x[i] - x[i - 1], y[i] - y[i - 1]];
    s[i] = s[i - 1] + Math.sqrt(dx * dx + dy * dy);
  }
  return s;
}

/** Columns of values known at rising `along`, read at rising `at`, linearly. */
function interp(at, along, ...columns) {
  const last = along.length - 1;
  const out = columns.map(() => new Float64Array(at.length));
  let k = 0;
  for (let i = 0; i < at.length; i++) {
    while (k < last - 1 && along[k + 1] <= at[i]) k++;
    const next = last > 0 ? k + 1 : k;
    const step = along[next] - along[k];
    let f = step > 0 ? (at[i] - along[k]) / step : 0;
    f = f < 0 ? 0 : f > 1 ? 1 : f;
    for (let c = 0; c < columns.length; c++) out[c][i] = columns[c][k] + f * (columns[c][next] - columns[c][k]);
  }
  return out;
}

/** A line with points added so that no two neighbours lie further apart than `spacing`. */
function densified(line, spacing) {
  const s = arcLength(line.x, line.y);
  const at = [0];
  for (let i = 1; i < s.length; i++) {
    const pieces = Math.max(1, Math.ceil((s[i] - s[i - 1]) / spacing));
    for (let j = 1; j <= pieces; j++) at.push(s[i - 1] + ((s[i] - s[i - 1]) * j) / pieces);
  }
  const [x, y, width] = interp(at, s, line.x, line.y, line.width);
  return { x, y, width, closed: line.closed };
}

/** Indices of the points that a polyline in several dimensions cannot leave out (Douglas and Peucker). */
function simplified(columns, tolerance) {
  const n = columns[0].length;
  const keep = new Uint8Array(n);
  keep[0] = keep[n - 1] = 1;
  const spans = [[0, n - 1]];
  while (spans.length) {
    const [a, b] = spans.pop();
    let size = 0;
    for (const c of columns) size += (c[b] - c[a]) ** 2;
    let far = tolerance * tolerance;
    let at = -1;
    for (let i = a + 1; i < b; i++) {
      let dot = 0;
      for (const c of columns) dot += (c[i] - c[a]) * (c[b] - c[a]);
      const t = size > 0 ? Math.min(Math.max(dot / size, 0), 1) : 0;
      let off = 0;
      for (const c of columns) off += (c[i] - c[a] - t * (c[b] - c[a])) ** 2;
      if (off > far) [far, at] = [off, i];
    }
    if (at > 0) {
      keep[at] = 1;
      spans.push([a, at], [at, b]);
    }
  }
  return Array.from(keep.keys()).filter((i) => keep[i]);
}

/** The values at some indices. */
function taken(values, index) {
  const out = new Float64Array(index.length);
  for (let i = 0; i < out.length; i++) out[i] = values[index[i]];
  return out;
}

/** Values between one put before and one put after them. */
function framed(first, values, last) {
  const out = new Float64Array(values.length + 2);
  out[0] = first;
  out.set(values, 1);
  out[out.length - 1] = last;
  return out;
}

/** A line without points that coincide, with its fields; of the first field the largest of each heap stays. */
function distinct(x, y, ...fields) {
  const keep = [0];
  for (let i = 1; i < x.length; i++) {
    if (Math.abs(x[i] - x[i - 1]) + Math.abs(y[i] - y[i - 1]) > 1e-6) keep.push(i);
  }
  if (keep.length === x.length) return [x, y, ...fields];
  const rest = [x, y, ...fields].map((values) => taken(values, keep));
  keep.push(x.length);
  for (let k = 0; k < rest[2].length; k++) {
    for (let i = keep[k]; i < keep[k + 1]; i++) rest[2][k] = Math.max(rest[2][k], fields[0][i]);
  }
  return rest;
}

/** Pixels from the centre line to v = 1 at every point: half the width, kept from narrowing abruptly, plus margin. */
function halfWidths(line, margin) {
  const { x, y, width, closed } = line;
  const n = width.length;
  const s = arcLength(x, y);
  const half = new Float64Array(n);
  for (let i = 0; i < n; i++) half[i] = width[i] / 2;
  const rounds = closed ? 2 : 1; // what narrows across the seam is met in the second round
  const total = s[n - 1];
  let best = -Infinity;
  for (let r = 0; r < rounds; r++) {
    for (let i = 0; i < n; i++) {
      best = Math.max(best, half[i] + NARROWING * (s[i] + r * total));
      half[i] = best - NARROWING * (s[i] + r * total);
    }
  }
  best = -Infinity;
  for (let r = 0; r < rounds; r++) {
    for (let i = n - 1; i >= 0; i--) {
      const back = total - s[i] + r * total;
      best = Math.max(best, half[i] + NARROWING * back);
      half[i] = best - NARROWING * back;
    }
  }
  for (let i = 0; i < n; i++) half[i] += margin;
  return half;
}

/** Points evenly spaced along a centre line that is smoothed by STIFFNESS times its median half width, with fields. */
function stiffened(x, y, fields, closed) {
  const along = arcLength(x, y);
  const total = along[along.length - 1];
  const sorted = fields[0].slice().sort();
  const middle = sorted.length >> 1;
  const median = sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
  const count = Math.max(3, Math.ceil(total / Math.max(1, Math.min(STIFFNESS * median, 3))));
  const sigma = (STIFFNESS * median * count) / total;
  const at = new Float64Array(count + 1);
  for (let i = 0; i <= count; i++) at[i] = (total * i) / count;
  const all = interp(at, along, x, y, ...fields);
  for (const k of [0, 1]) all[k] = smoothed(all[k], sigma, closed);
  const keep = [0];
  for (let i = 1; i <= count; i++) {
    if (Math.abs(all[0][i] - all[0][i - 1]) + Math.abs(all[1][i] - all[1][i - 1]) > 1e-6) keep.push(i);
  }
  return keep.length === count + 1 ? all : all.map((values) => taken(values, keep));
}

/** Gaussian of `sigma` values; turned about its ends, so that these stay, or round and round where closed. */
function smoothed(values, sigma, closed) {
  const count = values.length - 1;
  const reach = Math.min(Math.trunc(4 * sigma) + 1, count);
  const padded = new Float64Array(count + 1 + 2 * reach);
  padded.set(values, reach);
  for (let k = 1; k <= reach; k++) {
    padded[reach - k] = closed ? values[count - k] : 2 * values[0] - values[k];
    padded[reach + count + k] = closed ? values[k] : 2 * values[count] - values[count - k];
  }
  const kernel = new Float64Array(reach + 1);
  let weight = 0;
  for (let k = 0; k <= reach; k++) {
    kernel[k] = Math.exp((-0.5 * k * k) / (sigma * sigma));
    weight += k ? 2 * kernel[k] : kernel[k];
  }
  const out = new Float64Array(count + 1);
  for (let i = 0; i <= count; i++) {
    const c = i + reach;
    let sum = kernel[0] * padded[c];
    for (let k = 1; k <= reach; k++) sum += kernel[k] * (padded[c - k] + padded[c + k]);
    out[i] = sum / weight;
  }
  if (closed) out[count] = out[0];
  return out;
}

/** What every point of a line has to do with the texture made for it: its u, and the pixels from it to v = 1. */
function textureFrame(line, margin) {
  const s = arcLength(line.x, line.y);
  const total = Math.max(s[s.length - 1], 1e-9);
  const band = ribbonOf(line, margin);
  const [first, last] = band.closed ? [0, 0] : [band.half[0], band.half[band.half.length - 1]];
  const inner = band.length - first - last;
  return { u: s.map((at) => (first + (at / total) * inner) / band.length), half: halfWidths(line, margin) };
}

/**
 * The ribbon of a line: {x, y, half, u, ratio, along, length, closed}, run on past both ends by its half width there.
 *
 * Without `frame` the texture is laid along it afresh. With the `textureFrame` of the line that it was made for, point by
 * point, each point keeps its u, and v times `ratio` is v of the texture, all `factor` times as wide. `quick` leaves the
 * smoothing out, as long as things move.
 */
function ribbonOf(line, margin, frame = null, factor = 1, quick = false) {
  const raw = halfWidths(line, margin);
  const scale = new Float64Array(raw.length).fill(1);
  if (frame) for (let i = 0; i < scale.length; i++) scale[i] = raw[i] / Math.max(factor * frame.half[i], 1e-9);
  let [x, y, half, ratio, u] = distinct(line.x, line.y, raw, scale, frame ? frame.u : raw);
  const closed = line.closed && x.length > 3;
  if (x.length > 2 && !quick) [x, y, half, ratio, u] = stiffened(x, y, [half, ratio, u], closed);
  if (!closed) {
    const n = x.length;
    const end = (i, j) => {
      const size = n > 1 ? Math.hypot(x[i] - x[j], y[i] - y[j]) : 1;
      const reach = Math.max(half[i], 1e-3) / size;
      return n > 1 ? [x[i] + reach * (x[i] - x[j]), y[i] + reach * (y[i] - y[j])] : [x[0] + j * reach, y[0]];
    };
    const [first, last] = [end(0, n > 1 ? 1 : -1), end(n - 1, n > 1 ? n - 2 : 1)];
    x = framed(first[0], x, last[0]);
    y = framed(first[1], y, last[1]);
    half = framed(half[0], half, half[n - 1]);
    ratio = framed(ratio[0], ratio, ratio[n - 1]);
    u = framed(0, u, 1);
  }
  const along = arcLength(x, y);
  const length = along[along.length - 1];
  if (!frame) u = along.map((at) => at / length);
  const band = { x, y, half, u, ratio, along, length, closed };
  return thinned(band, quick ? QUICK : THIN);
}

/** A ribbon without points that lie within `slack` px between their neighbours anyway: rounds of every other point. */
function thinned(band, slack) {
  const { x, y, half } = band;
  const keep = new Uint8Array(x.length).fill(1);
  for (const step of [1, 2, 4]) {
    for (let i = step; i + step < x.length; i += 2 * step) {
      const [a, b] = [i - step, i + step];
      if (step > 1 && (keep[i - step / 2] || keep[i + step / 2])) continue;
      const [dx, dy] = [x[b] - x[a], y[b] - y[a]];
      const off = (x[i] - x[a]) * dy - (y[i] - y[a]) * dx;
      const near = off * off <= slack * slack * (dx * dx + dy * dy);
      if (near && Math.abs(half[i] - (half[a] + half[b]) / 2) <= slack) keep[i] = 0;
    }
  }
  const index = [];
  for (let i = 0; i < keep.length; i++) if (keep[i]) index.push(i);
  const out = { length: band.length, closed: band.closed };
  for (const name of ["x", "y", "half", "u", "ratio", "along"]) out[name] = taken(band[name], index);
  return out;
}

// ------------------------------------------------------------------------------------------------------------- edits

/** Unit normals (-t_y, t_x) of a line, of its course over a few pixels. */
function normals(x, y, closed) {
  const n = x.length;
  const nx = new Float64Array(n);
  const ny = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    let [a, b] = [i - 2, i + 2];
    if (closed) [a, b] = [a < 0 ? a + n - 1 : a, b > n - 1 ? b - n + 1 : b];
    [a, b] = [Math.max(a, 0), Math.min(b, n - 1)];
    const [dx, dy] = [x[b] - x[a], y[b] - y[a]];
    const size = Math.sqrt(dx * dx + dy * dy) || 1;
    [nx[i], ny[i]] = [-dy / size, dx / size];
  }
  return [nx, ny];
}

/** A number in [-1, 1] that depends on a seed and an index only. */
function chance(seed, index) {
  let h = Math.imul(seed + 1, 0x9e3779b1) ^ Math.imul(index + 1, 0x85ebca6b);
  h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
  h = Math.imul(h ^ (h >>> 12), 0x297a2d39);
  return ((h ^ (h >>> 15)) >>> 0) / 0x7fffffff - 1;
}

/** Smooth noise in about [-1, 1] along a line of length `total`, a swing and its return every `wavelength` px. */
function noise(s, total, wavelength, seed, closed) {
  const cells = closed ? Math.max(2, Math.round((2 * total) / wavelength)) : 0;
  const step = closed ? total / cells : wavelength / 2;
  const knots = new Float64Array(Math.floor(total / step) + 4); // from the one before the line to the two after it
  for (let k = 0; k < knots.length; k++) knots[k] = chance(seed, closed ? (k + cells - 1) % cells : k);
  const out = new Float64Array(s.length);
  for (let i = 0; i < out.length; i++) {
    const k = Math.floor(s[i] / step);
    const t = s[i] / step - k;
    const [a, b, c, d] = [knots[k], knots[k + 1], knots[k + 2], knots[k + 3]];
    out[i] = b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))); // Catmull and Rom
  }
  return out;
}

/** How much a point at arc length s follows one at `at`, 1 .. 0 at `reach` px: a smooth bump. */
function pull(s, at, reach, total, closed) {
  let d = Math.abs(s - at);
  if (closed) d = Math.min(d, total - d);
  return d < reach ? (1 - (d / reach) ** 2) ** 2 : 0;
}

/**
 * A line moved by hand, then made to wiggle, then scaled in width; points correspond, so that u of the texture does.
 *
 * moves: [{at, reach, dx, dy}], at and reach in px of arc length of the line as it was; wiggle: amplitude in px.
 */
function edited(line, { thickness = 1, wiggle = 0, wavelength = 40, seed = 0, moves = [] }) {
  if (thickness === 1 && !wiggle && !moves.length) return line;
  const width = line.width.map((w) => w * thickness);
  if (!wiggle && !moves.length) return { ...line, width };
  const x = Float64Array.from(line.x);
  const y = Float64Array.from(line.y);
  const s = arcLength(line.x, line.y);
  const total = s[s.length - 1];
  for (const { at, reach, dx, dy } of moves) {
    for (let i = 0; i < s.length; i++) {
      const w = pull(s[i], at, reach, total, line.closed);
      x[i] += w * dx;
      y[i] += w * dy;
    }
  }
  if (wiggle && total > 0) {
    const [nx, ny] = normals(x, y, line.closed);
    const waves = noise(s, total, wavelength, seed, line.closed);
    const fade = Math.min(wavelength / 2, total / 2);
    for (let i = 0; i < s.length; i++) {
      const near = line.closed ? 1 : Math.min(Math.min(s[i], total - s[i]) / fade, 1); // ends stay where they are
      const a = wiggle * waves[i] * near * near * (3 - 2 * near);
      x[i] += a * nx[i];
      y[i] += a * ny[i];
    }
    if (line.closed) [x[x.length - 1], y[y.length - 1]] = [x[0], y[0]];
  }
  return { x, y, width, closed: line.closed };
}

/** Indices of a line's points that serve as handles: where it bends, and never far apart. */
function handlesOf(line) {
  const s = arcLength(line.x, line.y);
  const total = s[s.length - 1];
  const corners = simplified([line.x, line.y], Math.max(2, total / 60));
  const far = Math.min(Math.max(total / 4, 20), 80);
  const at = [];
  corners.forEach((corner, k) => {
    if (k && s[corner] - s[at[at.length - 1]] < 12 && k < corners.length - 1) return;
    if (k) {
      const from = s[at[at.length - 1]];
      const pieces = Math.max(1, Math.round((s[corner] - from) / far));
      for (let j = 1; j < pieces; j++) {
        const want = from + ((s[corner] - from) * j) / pieces;
        let i = at[at.length - 1];
        while (i < corner && s[i] < want) i++;
        at.push(i);
      }
    }
    at.push(corner);
  });
  if (line.closed) at.pop();
  return Array.from(new Set(at));
}
