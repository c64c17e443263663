// A texture's tones as paths: regions of more than so much opacity, contoured in u and v and laid along the ribbon.

const TONE_SLACK = 0.12; // px a contour may be off where points are left out

// of a cell's corners a (row, column), b (column + 1), c (both + 1), d (row + 1), those inside, as bits 1, 2, 4, 8:
// the pieces of contour, from edge to edge (0 a-b, 1 b-c, 2 c-d, 3 d-a), all with the inside on the same hand
const PIECES = [
  [], [[3, 0]], [[0, 1]], [[3, 1]], [[1, 2]], [[3, 0], [1, 2]], [[0, 2]], [[3, 2]],
  [[2, 3]], [[2, 0]], [[0, 1], [2, 3]], [[2, 1]], [[1, 3]], [[1, 0]], [[0, 3]], [],
]; // prettier-ignore
const JOINED = { 5: [[3, 2], [1, 0]], 10: [[0, 3], [2, 1]] }; // the same where the cell's middle is inside

/** Rings [[row, column], ...] round what is above `level` in a field (rows, columns); rows go round and round if `wrap`. */
function contours(field, rows, columns, level, wrap) {
  const [width, height] = [columns + 2, wrap ? rows : rows + 2]; // a rim of nothing, but none where it goes round
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

/** Where u in [0, 1] and v in [-1, 1] lie on a ribbon: a function of both. Normals turn evenly round its bends. */
function layOut(band) {
  const { x, y, half, along, length } = band;
  const n = x.length - 1;
  const [middle, tx, ty] = [new Float64Array(n), new Float64Array(n), new Float64Array(n)];
  for (let k = 0; k < n; k++) {
    const size = along[k + 1] - along[k] || 1;
    [middle[k], tx[k], ty[k]] = [(along[k] + along[k + 1]) / 2, (x[k + 1] - x[k]) / size, (y[k + 1] - y[k]) / size];
  }
  const where = new Float64Array(1);
  return (u, v) => {
    where[0] = Math.min(Math.max(u, 0), 1) * length;
    const [[px], [py], [h]] = interp(where, along, x, y, half);
    const [[dx], [dy]] = interp(where, middle, tx, ty);
    const across = (Math.min(Math.max(v, -1), 1) * h) / (Math.hypot(dx, dy) || 1);
    return [px - across * dy, py + across * dx];
  };
}

/** One path for each tone; the paths that were there say how many there are and how opaque. */
function writeTones(element, mark, options) {
  const decimals = Math.min(Number(options.get("decimals") ?? 2), 2);
  const { strip, band } = mark;
  const { rows, columns } = strip;
  const field = strip.alpha ?? strip.data.filter((_, i) => i % 4 === 3);
  const place = layOut(band);
  let below = 0; // opacity of the tones painted so far
  for (const path of element.querySelectorAll("path")) {
    const opacity = Number(path.getAttribute("fill-opacity") ?? 1);
    const above = 1 - (1 - below) * (1 - opacity);
    const rings = contours(field, rows, columns, (255 * (below + above)) / 2, band.closed).map((ring) => {
      const points = ring.map(([r, c]) => place((r + 0.5) / rows, (2 * c + 1) / columns - 1));
      return points.concat([points[0]]);
    });
    below = above;
    const parts = rings.map((ring) => {
      const [x, y] = [0, 1].map((k) => Float64Array.from(ring, (point) => point[k]));
      const keep = simplifiedRing(x, y, TONE_SLACK);
      return keep.length > 2 ? `${pathText(taken(x, keep), taken(y, keep), decimals)}z` : "";
    });
    path.setAttribute("d", parts.join(""));
  }
}

/** `simplified` of a ring, which repeats its first point: cut in two where it is widest; the last index is left out. */
function simplifiedRing(x, y, tolerance) {
  let far = 0;
  for (let i = 1; i < x.length; i++) {
    if (Math.hypot(x[i] - x[0], y[i] - y[0]) > Math.hypot(x[far] - x[0], y[far] - y[0])) far = i;
  }
  const half = (from, to) => simplified([x.slice(from, to + 1), y.slice(from, to + 1)], tolerance).map((i) => i + from);
  if (!far) return [0];
  return half(0, far).slice(0, -1).concat(half(far, x.length - 1).slice(0, -1));
}
