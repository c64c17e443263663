// The raster of a drawing, as raster.py makes it: every pixel finds its place in the ribbon and
// reads the texture there.
//
// A mark is one stroke ready to be painted: {line, band, strip, color}, lengths in pixels of the
// drawing; without a strip it is flat ink. `view` is {scale, x, y}: a point p of the drawing lies
// at scale * p + (x, y) on the canvas.

/**
 * Working memory for one stroke: `slot` by pixel of its box, and by slot, in the order in which
 * pixels were met, their place on the canvas and premultiplied colour. Slots count on from stroke
 * to stroke, from `base`, so that nothing need be cleared.
 */
const scratch = { size: 0, base: 1 };

function reserve(size) {
  if (size > scratch.size) {
    scratch.size = Math.ceil(size * 1.3);
    scratch.base = 1;
    for (const name of ["slot", "place"]) scratch[name] = new Int32Array(scratch.size);
    for (const name of ["r", "g", "b", "a"]) scratch[name] = new Float32Array(scratch.size);
  }
  if (scratch.base > 2 ** 30) {
    scratch.slot.fill(0);
    scratch.base = 1;
  }
  return scratch;
}

/**
 * What of a mark does not change with the view: its segments' lengths and directions, and the
 * directions (nx, ny) across which one segment's pixels end and the next one's begin: those
 * half-way between theirs; 0 where it turns back.
 */
function prepared(mark) {
  if (mark.ready) return mark.ready;
  const { x, y, closed } = mark.strip ? mark.band : mark.line;
  const radius = mark.strip ? mark.band.half : mark.line.width.map((w) => w / 2);
  const n = x.length - 1;
  const room = new Float64Array(5 * (n + 1)); // one array is sooner had than five
  const [tx, ty, length, nx, ny] = [0, 1, 2, 3, 4].map((k) =>
    room.subarray(k * (n + 1), (k + 1) * (n + 1)),
  );
  let [left, top, right, bottom, widest] = [x[0], y[0], x[0], y[0], radius[0]];
  for (let k = 0; k < n; k++) {
    const [dx, dy] = [x[k + 1] - x[k], y[k + 1] - y[k]];
    length[k] = Math.sqrt(dx * dx + dy * dy);
    tx[k] = length[k] > 1e-9 ? dx / length[k] : k ? tx[k - 1] : 1;
    ty[k] = length[k] > 1e-9 ? dy / length[k] : k ? ty[k - 1] : 0;
    if (x[k + 1] < left) left = x[k + 1];
    if (y[k + 1] < top) top = y[k + 1];
    if (x[k + 1] > right) right = x[k + 1];
    if (y[k + 1] > bottom) bottom = y[k + 1];
    if (radius[k + 1] > widest) widest = radius[k + 1];
  }
  for (let k = 0; k <= n; k++) {
    const [a, b] = [k ? k - 1 : closed ? n - 1 : 0, k < n ? k : closed ? 0 : n - 1];
    const [sx, sy] = [tx[a] + tx[b], ty[a] + ty[b]];
    if (sx * sx + sy * sy > 0.1) [nx[k], ny[k]] = [sx, sy];
  }
  const extent = [left - widest, top - widest, right + widest, bottom + widest];
  return (mark.ready = { x, y, radius, tx, ty, length, nx, ny, extent });
}

/** The pixels [x0, y0, x1, y1) of a canvas that a mark may touch. */
function boxOf(mark, view) {
  const [x0, y0, x1, y1] = prepared(mark).extent;
  return [
    Math.floor(view.scale * x0 + view.x - 1),
    Math.floor(view.scale * y0 + view.y - 1),
    Math.ceil(view.scale * x1 + view.x + 1),
    Math.ceil(view.scale * y1 + view.y + 1),
  ];
}

/**
 * One mark's pixels within `clip` [x0, y0, x1, y1): {x0, y0, w, h, count, place, a, r, g, b};
 * place[k] for k < count is (y - clip y0) * clip width + x - clip x0, and a[k], r[k], g[k], b[k]
 * its colour, premultiplied. A mark of one ink has `ink` in place of r, g and b. Valid until the
 * next call; null where there is nothing.
 */
function pixelsOf(mark, view, clip) {
  const box = boxOf(mark, view);
  const x0 = Math.max(box[0], clip[0]);
  const y0 = Math.max(box[1], clip[1]);
  const w = Math.min(box[2], clip[2]) - x0;
  const h = Math.min(box[3], clip[3]) - y0;
  if (!(w > 0 && h > 0)) return null;
  const { place, r, g, b, a } = reserve(w * h);
  const count = scan(
    mark,
    view,
    { x0, y0, w, h },
    (y0 - clip[1]) * (clip[2] - clip[0]) + x0 - clip[0],
    clip[2] - clip[0],
  );
  scratch.base += count;
  return {
    x0,
    y0,
    w,
    h,
    count,
    place,
    r,
    g,
    b,
    a,
    ink: !mark.strip || mark.strip.alpha ? mark.color : null,
  };
}

/**
 * Four half-planes, a x + b y <= c: where a row at y meets side i, and whether from there on or up
 * to there.
 */
const sides = { at: new Float64Array(4), lean: new Float64Array(4), upTo: new Uint8Array(4) };

function setSide(i, a, b, c) {
  const steep = Math.abs(a) > 1e-9 ? a : 1e-9;
  sides.at[i] = c / steep;
  sides.lean[i] = -b / steep;
  sides.upTo[i] = steep > 0 ? 1 : 0;
}

/**
 * Every pixel of a box that a mark touches, into scratch; the number of them. The box's corner is
 * at `corner` on a canvas of rows of `stride` pixels.
 *
 * Flat ink covers the union of the round cones of its segments. A ribbon's pixels lie each in the
 * segment nearest to them, whose neighbours begin half-way round the bend; where the ribbon crosses
 * itself the stronger ink is seen.
 */
function scan(mark, view, { x0, y0, w, h }, corner, stride) {
  const { scale } = view;
  const { strip, band } = mark;
  const { x, y, radius, tx: txs, ty: tys, length: lengths, nx, ny } = prepared(mark);
  const { base, slot, place, r, g, b, a } = scratch;
  const { at: meets, lean: leans, upTo } = sides;
  const opaque = mark.color[3];
  const texels = strip ? (strip.alpha ?? strip.data) : null;
  const [rows, columns] = strip ? [strip.rows, strip.columns] : [0, 0];
  let count = 0;
  for (let k = 0; k < x.length - 1; k++) {
    const length = scale * lengths[k];
    if (length < 1e-6 && (strip || x.length > 2)) continue;
    const [tx, ty] = [txs[k], tys[k]];
    const [ra, rb] = [scale * radius[k], scale * radius[k + 1]];
    let reach = Math.max(ra, rb);
    let fall = length > 1e-9 ? (ra - rb) / length : 0;
    let [lean, u, climb] = [0, 0, 0];
    if (strip) {
      u = band.row[k];
      climb = (band.row[k + 1] - u) / length;
      const [sharp, blunt] = [!nx[k] && !ny[k], !nx[k + 1] && !ny[k + 1]];
      if (sharp) setSide(0, -tx, -ty, reach);
      else setSide(0, -nx[k], -ny[k], 0);
      if (blunt) setSide(1, tx, ty, length + reach);
      else setSide(1, nx[k + 1], ny[k + 1], length * (nx[k + 1] * tx + ny[k + 1] * ty));
      setSide(2, fall * tx - ty, tx + fall * ty, ra);
      setSide(3, fall * tx + ty, fall * ty - tx, ra);
    } else {
      fall = Math.min(Math.max(fall, -1 + 1e-9), 1 - 1e-9);
      // a cone's nearest point lies ahead of the foot of the perpendicular
      lean = fall / Math.sqrt(1 - fall * fall);
      reach += 1;
      setSide(0, -tx, -ty, reach);
      setSide(1, tx, ty, length + reach);
      setSide(2, -ty, tx, reach);
      setSide(3, ty, -tx, reach);
    }
    const thick = 2 * Math.max(ra, rb);
    const [rx0, ry0] = [x0 + 0.5 - (scale * x[k] + view.x), y0 + 0.5 - (scale * y[k] + view.y)];
    const last = Math.min(h - 1, Math.floor(Math.max(0, length * ty) + reach - ry0));
    for (
      let row = Math.max(0, Math.ceil(Math.min(0, length * ty) - reach - ry0));
      row <= last;
      row++
    ) {
      const ry = ry0 + row;
      let [from, to] = [rx0 - 0.5, rx0 + w - 1];
      for (let i = 0; i < 4; i++) {
        const meet = meets[i] + leans[i] * ry;
        if (upTo[i]) {
          if (meet < to) to = meet;
        } else if (meet > from) from = meet;
      }
      const end = Math.floor(to - rx0);
      let column = Math.ceil(from - rx0);
      let t = (rx0 + column) * tx + ry * ty;
      let side = ry * tx - (rx0 + column) * ty;
      for (; column <= end; column++, t += tx, side -= ty) {
        const pixel = row * w + column;
        let foot = t;
        if (lean) foot -= Math.abs(side) * lean;
        foot = foot < 0 ? 0 : foot > length ? length : foot;
        const half = ra - foot * fall;
        const ahead = t - foot;
        let alpha;
        if (strip) {
          let v = side / half;
          if (ahead !== 0) {
            // off the end of the segment, round its point
            const square = ahead * ahead + side * side;
            if (square > half * half) continue;
            v = (side < 0 ? -Math.sqrt(square) : Math.sqrt(square)) / half;
          }
          alpha = strip.alpha
            ? opacityAt(texels, rows, columns, u + foot * climb, v, band.closed)
            : colorAt(texels, rows, columns, u + foot * climb, v, band.closed);
        } else {
          // the pixel's part within a band: what the near edge lets in less what the far edge shuts
          // out
          const distance = Math.sqrt(ahead * ahead + side * side) - half;
          let part = distance < -0.5 ? 1 : 0.5 - distance;
          if (distance + thick < 0.5) part -= Math.min(0.5 - distance - thick, 1);
          if (part <= 0) continue;
          alpha = part * opaque;
        }
        let at = slot[pixel] - base;
        if (at < 0) {
          at = count++;
          slot[pixel] = base + at;
          place[at] = corner + row * stride + column;
        } else if (alpha <= a[at]) continue;
        a[at] = alpha;
        if (strip && !strip.alpha) {
          r[at] = tint.r;
          g[at] = tint.g;
          b[at] = tint.b;
        }
      }
    }
  }
  return count;
}

const tint = { r: 0, g: 0, b: 0 };
// what `find` found: no new object for every pixel
const spot = { i: 0, j: 0, k: 0, l: 0, right: 0, down: 0 };

/**
 * The four texels of a strip (rows, columns) round a row and v in [-1, 1], and how far right and
 * down between them.
 */
function find(rows, columns, row, v, wrap) {
  const column = (v + 1) * 0.5 * columns - 0.5;
  const [r, c] = [Math.floor(row), Math.floor(column)];
  const r0 = (r >= 0 ? r : wrap ? rows - 1 : 0) * columns;
  const r1 = (r + 1 < rows ? r + 1 : wrap ? 0 : rows - 1) * columns;
  const c0 = c < 0 ? 0 : c;
  const c1 = c + 1 < columns ? c + 1 : columns - 1;
  spot.right = column - c;
  spot.down = row - r;
  spot.i = r0 + c0;
  spot.j = r0 + c1;
  spot.k = r1 + c0;
  spot.l = r1 + c1;
}

/**
 * The opacity, 0 .. 1, of texels of one ink, bytes (rows, columns), at a row and v in [-1, 1],
 * bilinear.
 */
function opacityAt(alpha, rows, columns, row, v, wrap) {
  find(rows, columns, row, v, wrap);
  const { i, j, k, l, right, down } = spot;
  const top = alpha[i] + right * (alpha[j] - alpha[i]);
  const low = alpha[k] + right * (alpha[l] - alpha[k]);
  return (top + down * (low - top)) * (1 / 255);
}

/** The same of premultiplied RGBA texels; the colours go to `tint`. */
function colorAt(data, rows, columns, row, v, wrap) {
  find(rows, columns, row, v, wrap);
  const { right, down } = spot;
  const [i, j, k, l] = [4 * spot.i, 4 * spot.j, 4 * spot.k, 4 * spot.l];
  const w11 = (right * down) / 255;
  const [w01, w10] = [right / 255 - w11, down / 255 - w11];
  const w00 = 1 / 255 - w01 - w10 - w11;
  tint.r = w00 * data[i] + w01 * data[j] + w10 * data[k] + w11 * data[l];
  tint.g = w00 * data[i + 1] + w01 * data[j + 1] + w10 * data[k + 1] + w11 * data[l + 1];
  tint.b = w00 * data[i + 2] + w01 * data[j + 2] + w10 * data[k + 2] + w11 * data[l + 2];
  return w00 * data[i + 3] + w01 * data[j + 3] + w10 * data[k + 3] + w11 * data[l + 3];
}

/**
 * Paint a mark over opaque pixels: `image` is an ImageData that shows `clip` [x0, y0, x1, y1] of
 * the canvas.
 */
function paintMark(mark, view, image, clip) {
  const made = pixelsOf(mark, view, clip);
  if (!made) return;
  const data = new Uint8Array(image.data.buffer, image.data.byteOffset, image.data.length);
  const { place, a, r, g, b, ink, count } = made;
  const [red, green, blue] = ink ? ink.map((c) => 255 * c) : [0, 0, 0];
  for (let k = 0; k < count; k++) {
    const at = 4 * place[k];
    const alpha = a[k];
    const rest = 1 - alpha;
    if (ink) {
      data[at] = alpha * red + rest * data[at] + 0.5;
      data[at + 1] = alpha * green + rest * data[at + 1] + 0.5;
      data[at + 2] = alpha * blue + rest * data[at + 2] + 0.5;
    } else {
      data[at] = 255 * r[k] + rest * data[at] + 0.5;
      data[at + 1] = 255 * g[k] + rest * data[at + 1] + 0.5;
      data[at + 2] = 255 * b[k] + rest * data[at + 2] + 0.5;
    }
  }
}
