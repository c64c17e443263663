// Outlines of strokes as smooth cubics, as outline.py makes them; and the texture's
// tones as paths.

const { FIT_STEP } = CONSTANTS.outline;

/**
 * The offset of a closed walk p with radii r to the side (-t_y, t_x): {x, y, hard}, a polygon and
 * its corners.
 */
function offsetRing(px, py, r, turn, tolerance) {
  const n = px.length;
  const out = { x: [], y: [], hard: [] };
  const next = (k) => (k + 1) % n;
  const wrap = (angle) => angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
  const heading = [];
  const lean = [];
  const seg = [];
  for (let k = 0; k < n; k++) {
    const j = next(k);
    const [dx, dy] = [px[j] - px[k], py[j] - py[k]];
    heading.push(Math.atan2(dy, dx));
    // the envelope of the discs leans away from the normal by the slope of the radius
    lean.push(Math.asin(Math.min(Math.max((r[j] - r[k]) / Math.hypot(dx, dy), -1), 1)));
    const angle = heading[k] + Math.PI / 2 + lean[k];
    const [mx, my] = [Math.cos(angle), Math.sin(angle)];
    // by the other's disc: corners, else there are slits
    const held = Math.abs(r[j] - r[k]) >= Math.hypot(dx, dy);
    const [ax, ay, bx, by] = [
      px[k] + r[k] * mx,
      py[k] + r[k] * my,
      px[j] + r[j] * mx,
      py[j] + r[j] * my,
    ];
    seg.push({ ax, ay, bx, by, angle, held });
  }
  const bend = heading.map((h, k) => wrap(h - heading[(k + n - 1) % n]));
  if (turn) {
    // there and back: what is a left turn one way is a right turn the other way, to the last bit
    bend[0] = bend[turn] = -Math.PI;
    for (let k = turn + 1; k < n; k++) bend[k] = -bend[2 * turn - k];
  }
  // inside of a bend the two offset segments are cut where they meet; where they do not, by way of
  // the centre
  const joint = [];
  for (let k = 0; k < n; k++) {
    const before = (k + n - 1) % n;
    const swing = bend[k] + lean[k] - lean[before];
    const [a, b] = [seg[before], seg[k]];
    const [ux, uy, wx, wy] = [a.bx - a.ax, a.by - a.ay, b.bx - b.ax, b.by - b.ay];
    const cross = ux * wy - uy * wx;
    const [gx, gy] = [b.ax - a.ax, b.ay - a.ay];
    const s = (gx * wy - gy * wx) / cross;
    const t = (gx * uy - gy * ux) / cross;
    const meet = swing > 1e-9 && Math.abs(cross) > 1e-12 && s >= 0 && s <= 1 && t >= 0 && t <= 1;
    joint.push({ swing, s, t, meet, x: a.ax + s * ux, y: a.ay + s * uy });
  }
  for (let lost = true; lost;) {
    // a segment cut at both ends must keep something: else the bend is tighter than the stroke is
    // wide
    lost = false;
    for (let k = 0; k < n; k++) {
      const after = joint[next(k)];
      if (joint[k].meet && after.meet && joint[k].t > after.s) {
        joint[k].meet = after.meet = false;
        lost = true;
      }
    }
  }
  const put = (x, y, hard) => {
    const last = out.x.length - 1;
    if (last >= 0 && Math.hypot(x - out.x[last], y - out.y[last]) < 1e-6) {
      out.hard[last] ||= hard;
      return;
    }
    out.x.push(x);
    out.y.push(y);
    out.hard.push(hard);
  };
  for (let k = 0; k < n; k++) {
    const before = seg[(k + n - 1) % n];
    const { swing, meet, x, y } = joint[k];
    const kink = Math.abs(swing) > 0.5 || before.held || seg[k].held;
    if (meet) put(x, y, kink);
    else if (swing > 1e-9) {
      put(before.bx, before.by, true);
      put(px[k], py[k], true);
      put(seg[k].ax, seg[k].ay, true);
    } else if (Math.abs(swing) > 1e-9 && r[k] > 1e-3) {
      const chord = 2 * Math.acos(Math.min(Math.max(1 - tolerance / r[k], 0.5), 1 - 1e-6));
      const steps = Math.ceil(Math.abs(swing) / chord);
      for (let j = 0; j <= steps; j++) {
        const angle = before.angle + (swing * j) / steps;
        const hard = (j === 0 && before.held) || (j === steps && seg[k].held);
        put(px[k] + r[k] * Math.cos(angle), py[k] + r[k] * Math.sin(angle), hard);
      }
    } else put(seg[k].ax, seg[k].ay, kink);
  }
  return out;
}

/**
 * The outline of a line as rings of cubics [[x0, y0, x1, y1, x2, y2, x3, y3], ...], to be filled by
 * the nonzero rule. Unlike outline.py's they cross where the line does.
 */
function outlineOf(line, tolerance) {
  let [x, y, r] = distinct(
    line.x,
    line.y,
    line.width.map((w) => w / 2),
  );
  let n = x.length;
  const walks = [];
  let closed = line.closed && n > 3;
  if (n === 1) {
    [x, y, r, n] = [
      Float64Array.of(x[0] - 5e-4, x[0] + 5e-4),
      Float64Array.of(y[0], y[0]),
      Float64Array.of(r[0], r[0]),
      2,
    ];
  }
  const forth = Array.from({ length: n }, (_, i) => i);
  if (closed) {
    if (Math.hypot(x[0] - x[n - 1], y[0] - y[n - 1]) < 1e-6) forth.pop();
    walks.push(forth, forth.slice().reverse());
  } else walks.push([...forth, ...forth.slice(1, -1).reverse()]);
  return walks.map((walk) => {
    const take = (values) => walk.map((i) => values[i]);
    return fitRing(
      spread(offsetRing(take(x), take(y), take(r), closed ? 0 : n - 1, 0.2 * tolerance)),
      0.8 * tolerance,
    );
  });
}

/** A ring with points added on its long edges, so that a fit is held there too. */
function spread({ x, y, hard }) {
  const out = { x: [], y: [], hard: [] };
  for (let k = 0; k < x.length; k++) {
    const j = (k + 1) % x.length;
    const pieces = Math.max(1, Math.ceil(Math.hypot(x[j] - x[k], y[j] - y[k]) / FIT_STEP));
    for (let i = 0; i < pieces; i++) {
      out.x.push(x[k] + ((x[j] - x[k]) * i) / pieces);
      out.y.push(y[k] + ((y[j] - y[k]) * i) / pieces);
      out.hard.push(hard[k] && i === 0);
    }
  }
  return out;
}

/** Smooth cubics through a closed polygon, within `tolerance` of it (Schneider 1990). */
function fitRing({ x, y, hard }, tolerance) {
  const n = x.length;
  if (n < 3) return [];
  const start = Math.max(hard.indexOf(true), 0);
  const at = (k) => (start + k) % n;
  const [qx, qy] = [[], []];
  for (let k = 0; k <= n; k++) {
    qx.push(x[at(k)]);
    qy.push(y[at(k)]);
  }
  const unit = (dx, dy) => {
    const size = Math.hypot(dx, dy) || 1;
    return [dx / size, dy / size];
  };
  const leave = (k) => unit(qx[(k % n) + 1] - qx[k % n], qy[(k % n) + 1] - qy[k % n]);
  const arrive = (k) => leave((k + n - 1) % n);
  const tangent = (k, ahead) => {
    const [a, b] = [arrive(k), leave(k)];
    const sum = Math.hypot(a[0] + b[0], a[1] + b[1]);
    if (hard[at(k)] || sum <= 0.2) return ahead ? b : a;
    return unit(a[0] + b[0], a[1] + b[1]);
  };
  const cuts = [];
  for (let k = 0; k <= n; k++) if (k === 0 || k === n || hard[at(k)]) cuts.push(k);
  const cubics = [];
  const fit = (begin, end) => {
    const back = tangent(end, false);
    const { cubic, error, worst } = fitSpan(
      qx,
      qy,
      begin,
      end,
      tangent(begin, true),
      [-back[0], -back[1]],
      tolerance,
    );
    if (error <= tolerance || end - begin < 2) cubics.push(cubic);
    else {
      fit(begin, worst);
      fit(worst, end);
    }
  };
  for (let k = 0; k + 1 < cuts.length; k++) fit(cuts[k], cuts[k + 1]);
  return cubics;
}

/**
 * One cubic for the points begin .. end with its end tangents held: {cubic, error, worst: where to
 * cut}.
 */
function fitSpan(qx, qy, begin, end, [ux, uy], [vx, vy], tolerance) {
  const count = end - begin + 1;
  const t = new Float64Array(count);
  for (let i = 1; i < count; i++) {
    const k = begin + i;
    t[i] = t[i - 1] + Math.hypot(qx[k] - qx[k - 1], qy[k] - qy[k - 1]);
  }
  const length = t[count - 1];
  for (let i = 0; i < count; i++) t[i] /= length || 1;
  const [ax, ay, dx, dy] = [qx[begin], qy[begin], qx[end], qy[end]];
  const chord = Math.hypot(dx - ax, dy - ay);
  let [bx, by, cx, cy, error, worst] = [0, 0, 0, 0, 0, begin];
  for (let attempt = 0; attempt < 3; attempt++) {
    let [c11, c12, c22, x1, x2] = [0, 0, 0, 0, 0];
    for (let i = 0; i < count; i++) {
      const [s, w] = [1 - t[i], t[i]];
      const [b0, b1, b2, b3] = [s * s * s, 3 * w * s * s, 3 * w * w * s, w * w * w];
      const rx = qx[begin + i] - (b0 + b1) * ax - (b2 + b3) * dx;
      const ry = qy[begin + i] - (b0 + b1) * ay - (b2 + b3) * dy;
      c11 += b1 * b1;
      c12 += b1 * b2;
      c22 += b2 * b2;
      x1 += b1 * (rx * ux + ry * uy);
      x2 += b2 * (rx * vx + ry * vy);
    }
    c12 *= ux * vx + uy * vy;
    const det = c11 * c22 - c12 * c12;
    let h1 = (x1 * c22 - x2 * c12) / det;
    let h2 = (c11 * x2 - c12 * x1) / det;
    // handles that point backwards or overtake each other make loops: then a third of the way
    const good =
      count > 2 &&
      det > 1e-9 * Math.max(c11 * c22, 1e-12) &&
      h1 > 0.01 * chord &&
      h2 > 0.01 * chord;
    if (!good || h1 + h2 >= 1.5 * length) h1 = h2 = length / 3;
    if (count === 2) {
      // without points between, its tangents are held to nothing: they must not carry the curve off
      // the chord
      const most = (x, y) =>
        (tolerance * chord) / Math.max(Math.abs(x * (dy - ay) - y * (dx - ax)), 1e-12);
      h1 = Math.min(h1, ux * (dx - ax) + uy * (dy - ay) > 0 ? most(ux, uy) : tolerance);
      h2 = Math.min(h2, vx * (dx - ax) + vy * (dy - ay) < 0 ? most(vx, vy) : tolerance);
    }
    [bx, by, cx, cy] = [ax + h1 * ux, ay + h1 * uy, dx + h2 * vx, dy + h2 * vy];
    [error, worst] = [0, begin + (count >> 1)];
    for (let i = 1; i < count - 1; i++) {
      const [s, w] = [1 - t[i], t[i]];
      const [b0, b1, b2, b3] = [s * s * s, 3 * w * s * s, 3 * w * w * s, w * w * w];
      const ox = b0 * ax + b1 * bx + b2 * cx + b3 * dx - qx[begin + i];
      const oy = b0 * ay + b1 * by + b2 * cy + b3 * dy - qy[begin + i];
      const off = Math.hypot(ox, oy);
      if (off > error) [error, worst] = [off, begin + i];
      if (attempt === 2) continue; // else one Newton step towards the nearest parameter
      const [e0, e1, e2] = [3 * s * s, 6 * s * w, 3 * w * w];
      const d1x = e0 * (bx - ax) + e1 * (cx - bx) + e2 * (dx - cx);
      const d1y = e0 * (by - ay) + e1 * (cy - by) + e2 * (dy - cy);
      const d2x = 6 * (s * (cx - 2 * bx + ax) + w * (dx - 2 * cx + bx));
      const d2y = 6 * (s * (cy - 2 * by + ay) + w * (dy - 2 * cy + by));
      const slope = d1x * d1x + d1y * d1y + ox * d2x + oy * d2y;
      if (slope > 1e-12) t[i] = Math.min(Math.max(w - (ox * d1x + oy * d1y) / slope, 0), 1);
    }
  }
  if (error > tolerance) return { cubic: [ax, ay, bx, by, cx, cy, dx, dy], error, worst };
  for (let i = 1; i < count && count > 2; i++) {
    // a curve that keeps to the points must keep to the polygon's edges between them too
    const w = 0.5 * (t[i - 1] + t[i]);
    const [b0, b1, b2, b3] = [(1 - w) ** 3, 3 * w * (1 - w) ** 2, 3 * w * w * (1 - w), w ** 3];
    const [fx, fy] = [qx[begin + i - 1], qy[begin + i - 1]];
    const [ex, ey] = [qx[begin + i] - fx, qy[begin + i] - fy];
    const [ox, oy] = [
      b0 * ax + b1 * bx + b2 * cx + b3 * dx - fx,
      b0 * ay + b1 * by + b2 * cy + b3 * dy - fy,
    ];
    const at = Math.min(Math.max((ox * ex + oy * ey) / Math.max(ex * ex + ey * ey, 1e-18), 0), 1);
    const off = Math.hypot(ox - at * ex, oy - at * ey);
    if (off > error) [error, worst] = [off, begin + Math.min(i, count - 2)];
  }
  return { cubic: [ax, ay, bx, by, cx, cy, dx, dy], error, worst };
}
