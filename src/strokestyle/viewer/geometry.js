// Centre lines, ribbons and edits, as ribbon.py and edit.py have them. A line is {x, y, width,
// closed}: typed arrays, pixels of the drawing; a closed one repeats its first point as its last.
// Nothing here is ever changed in place.

const { STIFFNESS, NARROWING, MAX_SPACING } = CONSTANTS.ribbon;
const THIN = 0.01; // px that a point left out of a ribbon may lie off
const { STEP } = CONSTANTS.edit;

/**
 * Memory for arrays that nobody keeps, used again and again: thousands of them a frame would keep
 * the collector busy.
 */
const spare = { values: new Float64Array(1 << 16), used: 0, open: false };

/** What a function gives that keeps none of the arrays of `floats`. */
function inSpare(make) {
  [spare.used, spare.open] = [0, true];
  try {
    return make();
  } finally {
    spare.open = false;
  }
}

/** An array of n numbers to be set. */
function floats(n) {
  if (!spare.open || spare.used + n > spare.values.length) return new Float64Array(n);
  spare.used += n;
  return spare.values.subarray(spare.used - n, spare.used);
}

/** Arc length from the first point to each. */
function arcLength(x, y) {
  const s = floats(x.length);
  let sum = 0;
  s[0] = 0;
  for (let i = 1; i < s.length; i++) {
    const dx = x[i] - x[i - 1];
    const dy = y[i] - y[i - 1];
    s[i] = sum += Math.sqrt(dx * dx + dy * dy);
  }
  return s;
}

/** Columns of values known at rising `along`, read at rising `at`, linearly. */
function interp(at, along, ...columns) {
  const [n, last] = [at.length, along.length - 1];
  const [place, share] = [floats(n), floats(n)];
  let k = 0;
  for (let i = 0; i < n; i++) {
    while (k < last - 1 && along[k + 1] <= at[i]) k++;
    const step = last > 0 ? along[k + 1] - along[k] : 0;
    const f = step > 0 ? (at[i] - along[k]) / step : 0;
    place[i] = k;
    share[i] = f < 0 ? 0 : f > 1 ? 1 : f;
  }
  const out = [];
  for (const values of columns) {
    const column = floats(n);
    for (let i = 0; i < n; i++) {
      const a = place[i];
      column[i] = values[a] + (share[i] ? share[i] * (values[a + 1] - values[a]) : 0);
    }
    out.push(column);
  }
  return out;
}

/**
 * A line with points added so that no two neighbours lie further apart than `spacing`; its own
 * points stay. `was` of a line says which point of the stroke's own line each point was: 2.5 lies
 * half-way between points 2 and 3.
 */
function evenly(line, spacing) {
  const s = arcLength(line.x, line.y);
  const at = [0];
  for (let i = 1; i < s.length; i++) {
    const pieces = Math.max(1, Math.ceil((s[i] - s[i - 1]) / spacing - 1e-9));
    for (let j = 1; j <= pieces; j++) at.push(i - 1 + j / pieces);
  }
  if (at.length === s.length) return line;
  const [x, y, width, was] = interp(
    Float64Array.from(at),
    counting(s.length),
    line.x,
    line.y,
    line.width,
    line.was,
  );
  return { x, y, width, was, closed: line.closed };
}

/** 0, 1, 2 ... */
function counting(n) {
  const out = new Float64Array(n);
  for (let i = 0; i < n; i++) out[i] = i;
  return out;
}

/** Values of a line's points, read at points of it such as 2.5, half-way between 2 and 3. */
function atIndex(values, points) {
  const out = floats(points.length);
  for (let i = 0; i < out.length; i++) {
    const k = Math.min(Math.floor(points[i]), values.length - 2);
    out[i] = values[k] + (points[i] - k) * (values[k + 1] - values[k]);
  }
  return out;
}

/**
 * Indices of the points that a polyline in several dimensions cannot leave out (Douglas and
 * Peucker).
 */
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
  const out = floats(values.length + 2);
  out[0] = first;
  out.set(values, 1);
  out[out.length - 1] = last;
  return out;
}

/**
 * A line without points that coincide, with its fields; of the first field the largest of each heap
 * stays.
 */
function distinct(x, y, ...fields) {
  const apart = (i) => Math.abs(x[i] - x[i - 1]) + Math.abs(y[i] - y[i - 1]) > 1e-6;
  let alike = 0;
  for (let i = 1; i < x.length; i++) alike += apart(i) ? 0 : 1;
  if (!alike) return [x, y, ...fields];
  const keep = [0];
  for (let i = 1; i < x.length; i++) if (apart(i)) keep.push(i);
  const rest = [x, y, ...fields].map((values) => taken(values, keep));
  keep.push(x.length);
  for (let k = 0; k < rest[2].length; k++) {
    for (let i = keep[k]; i < keep[k + 1]; i++) rest[2][k] = Math.max(rest[2][k], fields[0][i]);
  }
  return rest;
}

/**
 * Pixels from a line of arc length s to v = 1 at every point: half the width, kept from narrowing
 * abruptly, plus margin.
 */
function halfWidths({ width, closed }, s, margin) {
  const n = width.length;
  const half = floats(n);
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

/**
 * Whether a ribbon lies on ink of its own elsewhere, as ribbon.py has it; `margin` of its half
 * width holds none.
 */
function overlaps({ x, y, half, along, length, closed }, margin) {
  const n = Math.max(
    3,
    Math.ceil(length / Math.max(1, 0.4 * half.reduce((a, b) => Math.min(a, b)))) + 1,
  );
  const s = Float64Array.from({ length: n }, (_, i) => (i * length) / (n - 1));
  const [px, py, h] = interp(s, along, x, y, half);
  for (let i = 0; i < n; i++) {
    for (let j = i + 1; j < n; j++) {
      const both = h[i] + h[j];
      const apart = closed ? Math.min(s[j] - s[i], length - s[j] + s[i]) : s[j] - s[i];
      if (apart > 0.6 * Math.PI * both && Math.hypot(px[i] - px[j], py[i] - py[j]) < both - margin)
        return true;
    }
  }
  return false;
}

/**
 * Points evenly spaced along a centre line that is smoothed by STIFFNESS times its median half
 * width.
 */
function stiffened(x, y, half, closed, step) {
  const along = arcLength(x, y);
  const total = along[along.length - 1];
  const sorted = floats(half.length);
  sorted.set(half);
  sorted.sort();
  const middle = sorted.length >> 1;
  const median = sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
  const count = Math.max(
    3,
    Math.ceil(total / Math.max(step, Math.min(STIFFNESS * median, MAX_SPACING))),
  );
  const sigma = (STIFFNESS * median * count) / total;
  const at = floats(count + 1);
  for (let i = 0; i <= count; i++) at[i] = (total * i) / count;
  const all = interp(at, along, x, y, half);
  for (const k of [0, 1]) all[k] = smoothed(all[k], sigma, closed);
  return distinct(...all);
}

/**
 * Gaussian of `sigma` values; turned about its ends, so that these stay, or round and round where
 * closed.
 */
function smoothed(values, sigma, closed) {
  const count = values.length - 1;
  const reach = Math.min(Math.trunc(4 * sigma) + 1, count);
  const padded = floats(count + 1 + 2 * reach);
  padded.set(values, reach);
  for (let k = 1; k <= reach; k++) {
    padded[reach - k] = closed ? values[count - k] : 2 * values[0] - values[k];
    padded[reach + count + k] = closed ? values[k] : 2 * values[count] - values[count - k];
  }
  const kernel = floats(reach + 1);
  let weight = 0;
  for (let k = 0; k <= reach; k++) {
    kernel[k] = Math.exp((-0.5 * k * k) / (sigma * sigma));
    weight += k ? 2 * kernel[k] : kernel[k];
  }
  const out = floats(count + 1);
  for (let i = 0; i <= count; i++) {
    const c = i + reach;
    let sum = kernel[0] * padded[c];
    for (let k = 1; k <= reach; k++) sum += kernel[k] * (padded[c - k] + padded[c + k]);
    out[i] = sum / weight;
  }
  if (closed) out[count] = out[0];
  return out;
}

/**
 * The ribbon of a line: {x, y, half, along, length, closed}, run on past both ends by its half
 * width there. Points that lie within `slack` px between their neighbours are left out, of those
 * `step` px apart that it is made of at first.
 */
function ribbonOf(line, halves, slack, step) {
  let [x, y, half] = distinct(line.x, line.y, halves);
  const closed = line.closed && x.length > 3;
  if (x.length > 2) [x, y, half] = stiffened(x, y, half, closed, step);
  if (!closed) {
    const n = x.length;
    const end = (i, j) => {
      const size = n > 1 ? Math.hypot(x[i] - x[j], y[i] - y[j]) : 1;
      const reach = Math.max(half[i], 1e-3) / size;
      return n > 1
        ? [x[i] + reach * (x[i] - x[j]), y[i] + reach * (y[i] - y[j])]
        : [x[0] + j * reach, y[0]];
    };
    const [first, last] = [end(0, n > 1 ? 1 : -1), end(n - 1, n > 1 ? n - 2 : 1)];
    x = framed(first[0], x, last[0]);
    y = framed(first[1], y, last[1]);
    half = framed(half[0], half, half[n - 1]);
  }
  const along = arcLength(x, y);
  return thinned({ x, y, half, along, length: along[along.length - 1], closed }, slack);
}

/**
 * A ribbon without points that lie within `slack` px between their neighbours anyway: rounds of
 * every other point.
 */
function thinned(band, slack) {
  const { x, y, half, along, length, closed } = band;
  const n = x.length;
  const keep = floats(n).fill(1);
  let count = n;
  for (let step = 1; step <= 4; step *= 2) {
    for (let i = step; i + step < n; i += 2 * step) {
      const a = i - step;
      const b = i + step;
      if (step > 1 && (keep[i - step / 2] || keep[i + step / 2])) continue;
      const dx = x[b] - x[a];
      const dy = y[b] - y[a];
      const off = (x[i] - x[a]) * dy - (y[i] - y[a]) * dx;
      const near = off * off <= slack * slack * (dx * dx + dy * dy);
      if (!near || Math.abs(half[i] - (half[a] + half[b]) / 2) > slack) continue;
      keep[i] = 0;
      count--;
    }
  }
  const kept = [x, y, half, along].map((values) => {
    const out = new Float64Array(count);
    for (let i = 0, k = 0; i < n; i++) if (keep[i]) out[k++] = values[i];
    return out;
  });
  return { x: kept[0], y: kept[1], half: kept[2], along: kept[3], length, closed };
}

// ------------------------------------------------------------------------------------------- edits
// as edit.py makes them, in this order: points moved one after another, wiggle, thickness

/** Columns smoothed by a Gaussian of `sigma` px along a line; open lines keep their ends. */
function smoothedAlong(x, y, s, sigma, closed) {
  const total = s[s.length - 1];
  const count = Math.min(Math.max(Math.ceil(total / Math.max(sigma / 4, 1e-3)), 8), 20000);
  const at = Float64Array.from({ length: count + 1 }, (_, i) => (total * i) / count);
  const even = interp(at, s, x, y).map((values) =>
    smoothed(values, (sigma * count) / total, closed),
  );
  return interp(s, at, ...even);
}

/**
 * Numbers in [0, 1) that depend on a seed, the stroke's number and their own, as `chances` of
 * edits.py draws them.
 */
function chances(seed, stroke, count) {
  const mixed = (h) => {
    h = Math.imul(h ^ (h >>> 16), 0x85ebca6b);
    h = Math.imul(h ^ (h >>> 13), 0xc2b2ae35);
    return (h ^ (h >>> 16)) >>> 0;
  };
  const start = mixed(mixed(seed) ^ stroke);
  return Float64Array.from(
    { length: count },
    (_, k) => mixed(start + Math.imul(k + 1, 0x9e3779b9)) / 2 ** 32,
  );
}

/**
 * Smooth noise in [-1, 1] at arc lengths s: random heights of alternating sign, half a wavelength
 * apart.
 */
function noise(s, wavelength, closed, stroke) {
  const total = s[s.length - 1];
  let count = Math.max(closed ? 2 : 1, Math.round((2 * total) / wavelength));
  if (closed) count += count % 2;
  const drawn = chances(0, stroke, count + 5);
  const sign = drawn[count + 3] < 0.5 ? -1 : 1;
  const height = Float64Array.from(
    { length: count + 3 },
    (_, k) => (0.45 + 0.55 * drawn[k]) * (k % 2 ? sign : -sign),
  );
  const shift = closed ? 0.5 : 0.25 + 0.5 * drawn[count + 4];
  if (closed) for (let k = 0; k < 3; k++) height[count + k] = height[k];
  return s.map((at) => {
    const place = (at / Math.max(total, 1e-9)) * count + shift;
    const k = Math.min(Math.floor(place), count + 1);
    const f = place - k;
    return height[k] + (height[k + 1] - height[k]) * f * f * (3 - 2 * f);
  });
}

/** 0 .. 1, level at both. */
function smoothStep(f) {
  const t = Math.min(Math.max(f, 0), 1);
  return t * t * (3 - 2 * t);
}

/**
 * A line with the point at arc length `at`, and its neighbours up to `reach` px away the less,
 * moved by (dx, dy).
 */
function moved(line, { at, reach, dx, dy }) {
  line = evenly(line, STEP);
  const s = arcLength(line.x, line.y);
  const total = s[s.length - 1];
  const far = Math.max(line.closed ? Math.min(reach, total / 2) : reach, 1e-9);
  const near = s.map((here) => {
    const away = Math.abs(here - at);
    return smoothStep(1 - (line.closed ? Math.min(away, total - away) : away) / far);
  });
  return {
    ...line,
    ...shut(
      line.x.map((x, i) => x + near[i] * dx),
      line.y.map((y, i) => y + near[i] * dy),
      line.closed,
    ),
  };
}

function shut(x, y, closed) {
  if (closed) [x[x.length - 1], y[y.length - 1]] = [x[0], y[0]];
  return { x, y };
}

/**
 * The way in which a line wiggles: {line: with points enough, dx, dy: for an amplitude of 1 px}.
 */
function wavesOf(line, wavelength, stroke) {
  line = evenly(line, Math.min(STEP, wavelength / 8));
  const { closed } = line;
  const s = arcLength(line.x, line.y);
  const [n, total] = [s.length, s[s.length - 1]];
  const [x, y] = smoothedAlong(line.x, line.y, s, wavelength / 8, closed);
  const swing = noise(s, wavelength, closed, stroke);
  const [dx, dy] = [new Float64Array(n), new Float64Array(n)];
  for (let i = 0; i < n; i++) {
    const a = i > 0 ? i - 1 : closed ? n - 2 : 0;
    const b = i < n - 1 ? i + 1 : closed ? 1 : n - 1;
    const [tx, ty] = [x[b] - x[a], y[b] - y[a]];
    const size = Math.sqrt(tx * tx + ty * ty);
    // nothing at the ends, in full from a third of the way between crests on
    const rise = closed
      ? 1
      : smoothStep(Math.min(s[i], total - s[i]) / Math.min(wavelength / 3, total / 2));
    dx[i] = size > 1e-12 ? (-ty / size) * rise * swing[i] : 0;
    dy[i] = size > 1e-12 ? (tx / size) * rise * swing[i] : rise * swing[i];
  }
  return { line, dx, dy };
}

/** A line that wiggles by `amplitude` px. */
function wiggled({ line, dx, dy }, amplitude) {
  const n = dx.length;
  const [x, y] = [new Float64Array(n), new Float64Array(n)];
  for (let i = 0; i < n; i++) {
    x[i] = line.x[i] + amplitude * dx[i];
    y[i] = line.y[i] + amplitude * dy[i];
  }
  return { ...line, ...shut(x, y, line.closed) };
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
