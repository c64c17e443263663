// A texture as true paths, as tones.py makes them: regions of even tone, contoured in u and v and
// laid along the ribbon.

const { TONE_UNIT } = CONSTANTS.format;
const { SLACK, MAX_POINTS, MAX_SLACK, HELD, SPECK, FOLD, COARSE_BINS, CLEAR } = CONSTANTS.tones;
const BIN = 256 / COARSE_BINS; // levels of opacity in a bin of a first look

// of a cell's corners a (row, column), b (column + 1), c (both + 1), d (row + 1), those inside, as
// bits 1, 2, 4, 8: the pieces of contour, from edge to edge (0 a-b, 1 b-c, 2 c-d, 3 d-a), all with
// the inside on the same hand
// prettier-ignore
const PIECES = [
  [], [[3, 0]], [[0, 1]], [[3, 1]], [[1, 2]], [[3, 0], [1, 2]], [[0, 2]], [[3, 2]],
  [[2, 3]], [[2, 0]], [[0, 1], [2, 3]], [[2, 1]], [[1, 3]], [[1, 0]], [[0, 3]], [],
];
// the same where the cell's middle is inside
// prettier-ignore
const JOINED = { 5: [[3, 2], [1, 0]], 10: [[0, 3], [2, 1]] };

/**
 * Rings [[row, column], ...] round what is above `level` in a field (rows, columns); rows go round
 * and round if `wrap`.
 */
function contours(field, rows, columns, level, wrap) {
  // a rim of nothing, but none where it goes round
  const [width, height] = [columns + 2, wrap ? rows : rows + 2];
  const at = (r, c) => {
    const row = wrap ? r % rows : r - 1;
    return c < 1 || c > columns || row < 0 || row >= rows ? 0 : field[row * columns + c - 1];
  };
  const edge = (r, c, side) => {
    const [row, column] = [(side === 2 ? r + 1 : r) % height, side === 1 ? c + 1 : c];
    return 2 * (row * width + column) + (side % 2);
  };
  const next = new Int32Array(2 * width * height).fill(-1);
  const starts = [];
  for (let r = 0; r < (wrap ? height : height - 1); r++) {
    for (let c = 0; c < width - 1; c++) {
      const corners = [at(r, c), at(r, c + 1), at(r + 1, c + 1), at(r + 1, c)];
      const code = corners.reduce((sum, value, k) => sum + (value > level ? 1 << k : 0), 0);
      if (code === 0 || code === 15) continue;
      const middle = corners[0] + corners[1] + corners[2] + corners[3] > 4 * level;
      for (const [from, to] of (middle && JOINED[code]) || PIECES[code]) {
        next[edge(r, c, from)] = edge(r, c, to);
        starts.push(edge(r, c, from));
      }
    }
  }
  const rings = [];
  for (const start of starts) {
    const ring = [];
    for (let e = start, after; next[e] >= 0; e = after) {
      const cell = e >> 1;
      const [r, c] = [Math.floor(cell / width), cell % width];
      const down = e % 2; // along the rows or along the columns
      const [from, to] = [at(r, c), down ? at(r + 1, c) : at(r, c + 1)];
      const f = (level - from) / (to - from);
      const row = (down ? r + f : r) - (wrap ? 0 : 1);
      ring.push([row, (down ? c : c + f) - 1]);
      after = next[e];
      next[e] = -1;
    }
    if (ring.length > 2) rings.push(ring);
  }
  return rings;
}

/**
 * The opacities that a stroke's tones add up to, and the thresholds between them: {level,
 * threshold}, for alpha in 0..255. Least squares on the histogram of opacity, the best of coarse
 * partitions made finer (Lloyd 1982); then all are raised until the stroke is as dark as its
 * texture. Where there are fewer opacities than levels, there are fewer tones.
 */
function levelsOf(alpha, count) {
  const [below, mass, square] = [0, 1, 2].map(() => new Float64Array(257));
  for (const a of alpha) below[Math.round(a) + 1]++;
  for (let k = 0; k < 256; k++) {
    mass[k + 1] = mass[k] + (below[k + 1] * k) / 255;
    square[k + 1] = square[k] + below[k + 1] * (k / 255) ** 2;
    below[k + 1] += below[k];
  }
  let level = partitioned(below, mass, square, count);
  let threshold = level;
  let shown = 0;
  for (let round = 0; round < 4; round++) {
    threshold = level.map((value, k) => (value + (k ? level[k - 1] : 0)) / 2);
    const cut = [...threshold.map((value) => Math.ceil(value * 255)), 256];
    shown = 0;
    level = level.map((value, k) => {
      const number = below[cut[k + 1]] - below[cut[k]];
      const mean = number > 0 ? (mass[cut[k + 1]] - mass[cut[k]]) / number : value;
      shown += number * mean;
      return mean;
    });
  }
  const raise = Math.min(Math.max(mass[256] / Math.max(shown, 1e-9), 1), 1.25);
  level = level.map((value) => Math.min(value * raise, 1));
  const other = level.map((value, k) => value - (k ? level[k - 1] : 0) >= 1 / 255);
  return {
    level: level.filter((_, k) => other[k]),
    threshold: threshold.filter((_, k) => other[k]).map((t) => Math.max(t, CLEAR)),
  };
}

/**
 * The means of the parts, above one of no opacity, in which a histogram spreads least: Wang and
 * Song 2011, coarsely.
 */
function partitioned(below, mass, square, count) {
  const of = (sums, i, j) => sums[BIN * j] - sums[BIN * i]; // of bins i to j - 1
  let best = Array.from({ length: COARSE_BINS + 1 }, (_, j) => square[BIN * j]);
  const cuts = [];
  for (let k = 0; k < count; k++) {
    const from = new Int32Array(COARSE_BINS + 1);
    best = best.map((_, j) => {
      let least = Infinity;
      for (let i = 0; i <= j; i++) {
        const number = Math.max(of(below, i, j), 1e-9);
        const total = best[i] + of(square, i, j) - of(mass, i, j) ** 2 / number;
        if (total < least) [least, from[j]] = [total, i];
      }
      return least;
    });
    cuts.push(from);
  }
  const level = [];
  for (let k = count - 1, end = COARSE_BINS; k >= 0; k--) {
    const begin = cuts[k][end];
    level.unshift(of(mass, begin, end) / Math.max(of(below, begin, end), 1e-9));
    end = begin;
  }
  for (let k = 1; k < count; k++) level[k] = Math.max(level[k], level[k - 1]);
  return level;
}

/**
 * The colour of each tone, so that over those beneath it shows what the texture has there on
 * average.
 */
function tonesColors(strip, alpha, { level, threshold }, ink) {
  const byte = (value) => Math.round(255 * Math.min(Math.max(value, 0), 1));
  if (strip.alpha) return level.map(() => ink.slice(0, 3).map(byte));
  const sums = level.map(() => [0, 0, 0, 0]); // premultiplied
  for (let k = 0; k < alpha.length; k++) {
    const tone = threshold.filter((t) => alpha[k] >= 255 * t).length - 1;
    if (tone >= 0) for (let c = 0; c < 4; c++) sums[tone][c] += strip.data[4 * k + c];
  }
  let [under, clear] = [[0, 0, 0], 1];
  return level.map((value, k) => {
    const left = (1 - value) / Math.max(clear, 1e-6); // of what is beneath
    const wanted = [0, 1, 2].map(
      (c) => value * (sums[k][3] > 0 ? sums[k][c] / sums[k][3] : ink[c]),
    );
    const color = wanted.map((w, c) => byte((w - left * under[c]) / Math.max(1 - left, 1e-3)));
    [under, clear] = [wanted, 1 - value];
    return color;
  });
}

/**
 * Where a row, of so many, and v in [-1, 1] lie on a ribbon: a function of both. Normals turn
 * evenly round its bends.
 */
function layOut(band, rows) {
  const { x, y, half, along, length, closed } = band;
  const n = x.length - 1;
  const headings = [];
  const middles = [];
  const put = (k, shift) => {
    const angle = Math.atan2(y[k + 1] - y[k], x[k + 1] - x[k]);
    const last = headings.length ? headings[headings.length - 1] : angle;
    headings.push(last + turnBetween(last, angle));
    middles.push((along[k] + along[k + 1]) / 2 + shift);
  };
  if (closed) put(n - 1, -length);
  for (let k = 0; k < n; k++) put(k, 0);
  if (closed) put(0, length);
  const [heading, middle] = [Float64Array.from(headings), Float64Array.from(middles)];
  const bend = heading.map((h, k) =>
    k ? (h - heading[k - 1]) / Math.max(middle[k] - middle[k - 1], 1e-9) : 0,
  );
  // frames at every row, one before them and one after
  const at = Float64Array.from({ length: rows + 2 }, (_, i) => ((i - 0.5) / rows) * length);
  if (!closed) [at[0], at[rows + 1]] = [0, length];
  const inside = closed ? at.map((s) => s - length * Math.floor(s / length)) : at;
  const order = Array.from(inside.keys()).sort((a, b) => inside[a] - inside[b]);
  const sorted = taken(inside, order);
  const columns = [...interp(sorted, along, x, y, half), ...interp(sorted, middle, heading)];
  const [px, py, reach, angle, curvature] = [0, 1, 2, 3, 4].map(() => new Float64Array(rows + 2));
  let piece = 0;
  order.forEach((i, k) => {
    [px[i], py[i], reach[i], angle[i]] = columns.map((column) => column[k]);
    while (piece < middle.length && middle[piece] <= sorted[k]) piece++;
    curvature[i] = piece > 0 && piece < middle.length ? bend[piece] : 0;
  });
  for (let i = 1; i < rows + 2; i++) angle[i] = angle[i - 1] + turnBetween(angle[i - 1], angle[i]);
  return (row, v) => {
    const f = Math.min(Math.max(row + 1, 0), rows + 1);
    const a = Math.min(Math.floor(f), rows);
    const mix = (values) => values[a] + (f - a) * (values[a + 1] - values[a]);
    let across = Math.min(Math.max(v, -1), 1) * mix(reach);
    const curve = mix(curvature);
    // inside of a bend all lie on the bend's own centre
    if (across * curve > FOLD) across = FOLD / curve;
    const heading = mix(angle);
    return [mix(px) - across * Math.sin(heading), mix(py) + across * Math.cos(heading)];
  };
}

/** The turn from one angle to another, within half a circle. */
function turnBetween(from, to) {
  return Math.atan2(Math.sin(to - from), Math.cos(to - from));
}

/**
 * The tones of marks, Map of mark -> [{color, opacity, rings}], the lightest first. Their rings are
 * simplified together: where they had more than MAX_POINTS, the slack grows, to MAX_SLACK at most.
 */
function tonesOf(marks, options) {
  const count = Number(options.get("tones") ?? CONSTANTS.options.tones);
  const tolerance = Number(options.get("tolerance") ?? CONSTANTS.options.tolerance);
  const made = new Map(marks.map((mark) => [mark, regionsOf(mark, count)]));
  const rings = Array.from(made.values()).flatMap((tones) => tones.flatMap((tone) => tone.rings));
  simplifyRings(rings, SLACK * tolerance);
  return made;
}

/** A stroke's texture in so many tones, their edges as rings {x, y, area, kept}. */
function regionsOf({ strip, band, color }, count) {
  const { rows, columns } = strip;
  const alpha = strip.alpha ?? strip.data.filter((_, i) => i % 4 === 3);
  const levels = levelsOf(alpha, count);
  const colors = tonesColors(strip, alpha, levels, color);
  const place = layOut(band, rows);
  return levels.level.map((level, k) => {
    const contoured = contours(alpha, rows, columns, 255 * levels.threshold[k], band.closed);
    const rings = contoured.map((ring) =>
      ringOf(ring.map(([r, c]) => place(r, (2 * c + 1) / columns - 1))),
    );
    // the largest comes first: from it a reader tells how a stroke was moved
    const largest = rings.reduce((best, { area }, i) => (area > rings[best].area ? i : best), 0);
    if (largest) rings.unshift(...rings.splice(largest, 1));
    const opacity = 1 - (1 - level) / Math.max(k ? 1 - levels.level[k - 1] : 1, 1e-6);
    return { color: colors[k], opacity: Math.min(Math.max(opacity, 0), 1), rings };
  });
}

/** Points as a ring: x and y repeat the first point; `kept` are the points that are needed. */
function ringOf(points) {
  const [x, y] = [0, 1].map((k) => Float64Array.from([...points, points[0]], (point) => point[k]));
  return { x, y, area: Math.abs(areaOf(points)), kept: Array.from(points.keys()) };
}

/**
 * Keep of rings the points that a slack, px, needs, and within MAX_POINTS of them; of specks none.
 */
function simplifyRings(rings, slack) {
  for (;;) {
    let count = 0;
    for (const ring of rings) {
      const { x, y, kept } = ring;
      if (ring.area <= SPECK * slack * slack) ring.kept = [];
      else {
        const all = [...kept, x.length - 1];
        ring.kept = simplifiedRing(taken(x, all), taken(y, all), slack).map((i) => all[i]);
      }
      count += ring.kept.length;
    }
    if (count <= MAX_POINTS || slack >= MAX_SLACK) return;
    slack = Math.min(MAX_SLACK, slack * Math.max(1.1, (count / MAX_POINTS) ** 0.6));
  }
}

/** A stroke's tones, as `tonesOf` made them, in place of those that were there. */
function writeTones(element, tones) {
  element.replaceChildren(...element.querySelectorAll("desc"));
  for (const { color, opacity, rings } of tones) {
    const d = rings.map(splineText).join("");
    if (!d) continue;
    const path = element.ownerDocument.createElementNS(SVG, "path");
    const hex = color.map((byte) => byte.toString(16).padStart(2, "0")).join("");
    path.setAttribute("fill", `#${hex}`);
    path.setAttribute("fill-opacity", numberText(opacity, 2));
    path.setAttribute(SLEEPING, "opacity:1");
    path.setAttribute("transform", `scale(${numberText(TONE_UNIT, 4)})`);
    path.setAttribute("d", d);
    element.append("\n", path);
  }
}

function areaOf(points) {
  let area = 0;
  points.forEach(([x, y], i) => {
    const [ax, ay] = points[(i + 1) % points.length];
    area += (x * ay - y * ax) / 2;
  });
  return area;
}

/** A simplified ring as a closed uniform quadratic B-spline; nothing where it is a speck. */
function splineText({ x, y, kept }) {
  if (!kept.length) return "";
  let polygon = fitted(x, y, kept);
  polygon = polygon.map((point) => point.map((value) => Math.round(value / (2 * TONE_UNIT))));
  polygon = polygon.filter(([px, py], i) => {
    const last = polygon[(i + polygon.length - 1) % polygon.length];
    return px !== last[0] || py !== last[1];
  });
  if (polygon.length < 3) return "";
  const middles = polygon.map(([px, py], i) => {
    const next = polygon[(i + 1) % polygon.length];
    return [px + next[0], py + next[1]];
  });
  const from = middles[middles.length - 1];
  const steps = middles.map((point, i) => {
    const last = i ? middles[i - 1] : from;
    return `${point[0] - last[0]} ${point[1] - last[1]}`;
  });
  const control = polygon[0].map((value, k) => 2 * value - from[k]).join(" ");
  const d = `M${from[0]} ${from[1]}q${control} ${steps[0]}t${steps.slice(1).join(" ")}z`;
  return d.replaceAll(" -", "-");
}

/**
 * The control points of the B-spline nearest to a ring, which repeats its first point; near each of
 * the points `kept` lies the middle of its piece. Least squares over all points, by the normal
 * equations, which Gauss and Seidel's steps solve.
 */
function fitted(x, y, kept) {
  const n = kept.length;
  // of each control point, what the equations hold of itself, of the next and of the one after
  // that; and their right sides
  const [own, next, second] = [0, 1, 2].map(() => new Float64Array(n));
  const sides = [x, y].map((values) => ({
    values,
    right: new Float64Array(n),
    at: new Float64Array(n),
  }));
  for (const { values, right, at } of sides) {
    for (let j = 0; j < n; j++) {
      // at the middle of its piece the spline is (before + 6 here + after) / 8
      at[j] =
        1.25 * values[kept[j]] -
        0.125 * (values[kept[(j + n - 1) % n]] + values[kept[(j + 1) % n]]);
      right[j] = HELD * at[j];
    }
  }
  own.fill(HELD);
  for (let j = 0; j < n; j++) {
    const [from, to] = [kept[j], j + 1 < n ? kept[j + 1] : x.length - 1];
    const run = [0];
    for (let i = from; i < to; i++)
      run.push(run[i - from] + Math.hypot(x[i + 1] - x[i], y[i + 1] - y[i]));
    for (let i = from; i < to; i++) {
      const share = run[i - from] / Math.max(run[to - from], 1e-9);
      const [middle, t] = share < 0.5 ? [j, share + 0.5] : [(j + 1) % n, share - 0.5];
      const basis = [0.5 * (1 - t) ** 2, 0.5 + t * (1 - t), 0.5 * t * t];
      const place = [(middle + n - 1) % n, middle, (middle + 1) % n];
      basis.forEach((weight, k) => {
        own[place[k]] += weight * weight;
        for (const { values, right } of sides) right[place[k]] += weight * values[i];
      });
      next[place[0]] += basis[0] * basis[1];
      next[place[1]] += basis[1] * basis[2];
      second[place[0]] += basis[0] * basis[2];
    }
  }
  for (const { right, at } of sides) {
    for (let round = 0; round < 12; round++) {
      for (let j = 0; j < n; j++) {
        const [a, b, c, d] = [(j + n - 2) % n, (j + n - 1) % n, (j + 1) % n, (j + 2) % n];
        at[j] =
          (right[j] - second[a] * at[a] - next[b] * at[b] - next[j] * at[c] - second[j] * at[d]) /
          own[j];
      }
    }
  }
  return kept.map((_, j) => sides.map(({ at }) => at[j]));
}

/**
 * `simplified` of a ring, which repeats its first point: cut in two where it is widest; the last
 * index is left out.
 */
function simplifiedRing(x, y, tolerance) {
  let far = 0;
  for (let i = 1; i < x.length; i++) {
    if (Math.hypot(x[i] - x[0], y[i] - y[0]) > Math.hypot(x[far] - x[0], y[far] - y[0])) far = i;
  }
  const half = (from, to) =>
    simplified([x.slice(from, to + 1), y.slice(from, to + 1)], tolerance).map((i) => i + from);
  if (!far) return [0];
  return half(0, far)
    .slice(0, -1)
    .concat(half(far, x.length - 1).slice(0, -1));
}
