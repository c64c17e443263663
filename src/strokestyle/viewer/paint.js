// The raster of a drawing, as painting.py makes it: every pixel finds its place in the ribbon and reads the texture there.
//
// A mark is one stroke ready to be painted: {line, band, strip, color}, lengths in pixels of the drawing; without a strip
// it is flat ink. `view` is {scale, x, y}: a point p of the drawing lies at scale * p + (x, y) on the canvas.

const HALF_TURN = (150 * Math.PI) / 180; // a ribbon that turns further may overlap itself

/** Working memory for one stroke's pixels, grown where needed; stamps save clearing it. */
const scratch = { size: 0, stamp: 0 };

function reserve(size) {
  if (size > scratch.size) {
    scratch.size = Math.ceil(size * 1.3);
    scratch.stamp = 0;
    for (const name of ["arm", "stroke", "taken", "touched", "pixels"]) scratch[name] = new Int32Array(scratch.size);
    for (const name of ["distance", "u", "v", "r", "g", "b", "a"]) scratch[name] = new Float32Array(scratch.size);
    scratch.past = new Uint8Array(scratch.size);
  }
  return scratch;
}

/** What of a mark does not change with the view: segments' lengths and directions, and where it may overlap itself. */
function prepared(mark) {
  if (mark.ready) return mark.ready;
  const { x, y } = mark.strip ? mark.band : mark.line;
  const radius = mark.strip ? mark.band.half : mark.line.width.map((w) => w / 2);
  const n = x.length - 1;
  const [tx, ty, length, over] = [
    new Float64Array(n),
    new Float64Array(n),
    new Float64Array(n),
    new Float64Array(n + 1),
  ];
  const arms = [0];
  let [heading, low, high] = [0, 0, 0];
  const box = [x[0], y[0], x[0], y[0]];
  let widest = radius[0];
  for (let k = 0; k < n; k++) {
    const [dx, dy] = [x[k + 1] - x[k], y[k + 1] - y[k]];
    length[k] = Math.sqrt(dx * dx + dy * dy);
    tx[k] = length[k] > 1e-9 ? dx / length[k] : k ? tx[k - 1] : 1;
    ty[k] = length[k] > 1e-9 ? dy / length[k] : k ? ty[k - 1] : 0;
    if (x[k + 1] < box[0]) box[0] = x[k + 1];
    if (y[k + 1] < box[1]) box[1] = y[k + 1];
    if (x[k + 1] > box[2]) box[2] = x[k + 1];
    if (y[k + 1] > box[3]) box[3] = y[k + 1];
    if (radius[k + 1] > widest) widest = radius[k + 1];
    if (!k) continue;
    const [sine, cosine] = [tx[k - 1] * ty[k] - ty[k - 1] * tx[k], tx[k - 1] * tx[k] + ty[k - 1] * ty[k]];
    over[k] = cosine > 0 ? Math.abs(sine) : 1; // how far past a segment's end, in radii, pixels still are closest to it
    heading += cosine > 0.95 ? sine : Math.atan2(sine, cosine);
    if (heading < low) low = heading;
    if (heading > high) high = heading;
    if (high - low > HALF_TURN && k > arms[arms.length - 1]) {
      arms.push(k);
      low = high = heading;
    }
  }
  over[0] = over[n] = 1;
  arms.push(n);
  const extent = [box[0] - widest, box[1] - widest, box[2] + widest, box[3] + widest];
  return (mark.ready = { x, y, radius, tx, ty, length, over, arms, extent });
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
 * One mark's pixels within `clip` [x0, y0, x1, y1): {x0, y0, w, h, count, pixels, a, r, g, b}. pixels[k] for k < count is
 * (y - y0) * w + x - x0, an index into a, r, g and b, premultiplied. A mark of one ink has `ink` in place of r, g and b.
 * Valid until the next call; null where there is nothing.
 */
function pixelsOf(mark, view, clip) {
  const box = boxOf(mark, view);
  const x0 = Math.max(box[0], clip[0]);
  const y0 = Math.max(box[1], clip[1]);
  const w = Math.min(box[2], clip[2]) - x0;
  const h = Math.min(box[3], clip[3]) - y0;
  if (!(w > 0 && h > 0)) return null;
  const area = { x0, y0, w, h };
  reserve(w * h);
  const count = mark.strip ? texturePixels(mark, view, area) : flatPixels(mark, view, area);
  const { pixels, r, g, b, a } = scratch;
  return { ...area, count, pixels, r, g, b, a, ink: !mark.strip || mark.strip.alpha ? mark.color : null };
}

/**
 * The band round a segment along (tx, ty), at most `reach` off its line and t0 .. t1 along it, as rows cut it: a row at ry
 * from the segment's beginning, up <= ry <= down, meets it at rx from max(ry cot - wide, low - ry tan) to
 * min(ry cot + wide, high - ry tan).
 */
const slant = { cot: 0, wide: 0, tan: 0, low: 0, high: 0, up: 0, down: 0 };

function slantOf(tx, ty, reach, t0, t1) {
  const [steep, flat] = [Math.abs(ty) > 1e-4, Math.abs(tx) > 1e-4];
  slant.cot = steep ? tx / ty : 0;
  slant.wide = steep ? reach / Math.abs(ty) : 1e9;
  slant.tan = flat ? ty / tx : 0;
  slant.low = flat ? Math.min(t0 / tx, t1 / tx) : -1e9;
  slant.high = flat ? Math.max(t0 / tx, t1 / tx) : 1e9;
  const bend = Math.abs(tx) * reach;
  slant.up = Math.min(t0 * ty, t1 * ty) - bend;
  slant.down = Math.max(t0 * ty, t1 * ty) + bend;
}

/** Coverage of a stroke in flat ink, the union of the round cones of its segments, into scratch: the number of pixels. */
function flatPixels(mark, view, { x0, y0, w, h }) {
  const { scale } = view;
  const { x, y, radius, tx: txs, ty: tys, length: lengths, over } = prepared(mark);
  const { stroke, pixels, a: cover } = scratch;
  const stamp = ++scratch.stamp;
  let count = 0;
  for (let k = 0; k < lengths.length; k++) {
    const [tx, ty] = [txs[k], tys[k]];
    const length = scale * lengths[k];
    if (length < 1e-6 && lengths.length > 1) continue;
    const [ax, ay] = [scale * x[k] + view.x, scale * y[k] + view.y];
    const [ra, rb] = [scale * radius[k], scale * radius[k + 1]];
    const slope = length > 1e-9 ? Math.min(Math.max((ra - rb) / length, -1 + 1e-9), 1 - 1e-9) : 0;
    const lean = slope / Math.sqrt(1 - slope * slope);
    const wide = 2 * Math.max(ra, rb);
    const reach = Math.max(ra, rb) + 1;
    const t0 = -reach * Math.min(1, over[k] + 2 * Math.abs(slope) + 0.2);
    const t1 = length + reach * Math.min(1, over[k + 1] + 2 * Math.abs(slope) + 0.2);
    slantOf(tx, ty, reach, t0, t1);
    const { cot, wide: across, tan, low, high, up, down } = slant;
    const [rx0, ry0] = [x0 + 0.5 - ax, y0 + 0.5 - ay];
    const last = Math.min(h - 1, Math.floor(down - ry0));
    for (let row = Math.max(0, Math.ceil(up - ry0)); row <= last; row++) {
      const ry = ry0 + row;
      const end = Math.min(w - 1, Math.floor(Math.min(ry * cot + across, high - ry * tan) - rx0));
      for (
        let column = Math.max(0, Math.ceil(Math.max(ry * cot - across, low - ry * tan) - rx0));
        column <= end;
        column++
      ) {
        const rx = rx0 + column;
        const t = rx * tx + ry * ty;
        const side = Math.abs(ry * tx - rx * ty);
        let foot = t - side * lean;
        foot = foot < 0 ? 0 : foot > length ? length : foot;
        const distance = Math.sqrt((t - foot) * (t - foot) + side * side) - ra + slope * foot;
        let part = distance < -0.5 ? 1 : 0.5 - distance;
        if (distance + wide < 0.5) part -= Math.min(0.5 - distance - wide, 1);
        if (part <= 0) continue;
        const pixel = row * w + column;
        if (stroke[pixel] !== stamp) {
          stroke[pixel] = stamp;
          cover[pixel] = part;
          pixels[count++] = pixel;
        } else if (part > cover[pixel]) cover[pixel] = part;
      }
    }
  }
  const alpha = mark.color[3];
  for (let k = 0; k < count; k++) cover[pixels[k]] *= alpha;
  return count;
}

/** The pixels of a ribbon, read off its texture, into scratch; where it crosses itself the stronger one is seen. */
function texturePixels(mark, view, { x0, y0, w, h }) {
  const { scale } = view;
  const { band } = mark;
  const { x, y, radius, tx: txs, ty: tys, length: lengths, over, arms } = prepared(mark);
  const { arm: inArm, taken, touched, distance: nearest, u: us, v: vs, past } = scratch;
  const stroke = ++scratch.stamp;
  const spare = [];
  let count = 0;
  for (let arm = 0; arm + 1 < arms.length; arm++) {
    const [first, end] = [arms[arm], arms[arm + 1]];
    const stamp = ++scratch.stamp;
    let found = 0;
    for (let k = first; k < end; k++) {
      const length = scale * lengths[k];
      if (length < 1e-9) continue;
      const [tx, ty] = [txs[k], tys[k]];
      const [ax, ay] = [scale * x[k] + view.x, scale * y[k] + view.y];
      const ha = scale * radius[k];
      const rise = (scale * radius[k + 1] - ha) / length;
      const [ua, us_] = [band.u[k], (band.u[k + 1] - band.u[k]) / length];
      const [qa, qs] = [band.ratio[k], (band.ratio[k + 1] - band.ratio[k]) / length];
      const reach = Math.max(ha, scale * radius[k + 1]);
      // beyond the ends of an open ribbon there is nothing; where an arm was cut another one takes over
      const t0 = k > first ? -reach * over[k] : k || band.closed ? -reach : 0;
      const t1 = length + (k < end - 1 ? reach * over[k + 1] : k < lengths.length - 1 || band.closed ? reach : 0);
      slantOf(tx, ty, reach, t0, t1);
      const { cot, wide, tan, low, high, up, down } = slant;
      const [rx0, ry0] = [x0 + 0.5 - ax, y0 + 0.5 - ay];
      const last = Math.min(h - 1, Math.floor(down - ry0));
      for (let row = Math.max(0, Math.ceil(up - ry0)); row <= last; row++) {
        const ry = ry0 + row;
        const stop = Math.min(w - 1, Math.floor(Math.min(ry * cot + wide, high - ry * tan) - rx0));
        for (
          let column = Math.max(0, Math.ceil(Math.max(ry * cot - wide, low - ry * tan) - rx0));
          column <= stop;
          column++
        ) {
          const rx = rx0 + column;
          const t = rx * tx + ry * ty;
          const side = ry * tx - rx * ty;
          const foot = t < 0 ? 0 : t > length ? length : t;
          const square = (t - foot) * (t - foot) + side * side;
          const half = ha + foot * rise;
          if (square > half * half) continue;
          const pixel = row * w + column;
          if (inArm[pixel] !== stamp) {
            inArm[pixel] = stamp;
            touched[found++] = pixel;
          } else if (square >= nearest[pixel]) continue;
          nearest[pixel] = square;
          us[pixel] = ua + foot * us_;
          const v = (Math.sqrt(square) / (half > 1e-9 ? half : 1e-9)) * (qa + foot * qs);
          vs[pixel] = side < 0 ? -v : v;
          past[pixel] = (t < 0 && k === first) || (t > length && k === end - 1) ? 1 : 0;
        }
      }
    }
    for (let i = 0; i < found; i++) {
      const pixel = touched[i];
      if (past[pixel]) spare.push(pixel, us[pixel], vs[pixel]);
      else {
        taken[pixel] = stroke;
        count = lay(mark.strip, pixel, us[pixel], vs[pixel], band.closed, stroke, count);
      }
    }
  }
  // where arms meet, what only reaches an arm's cut end belongs to the other arm
  for (let i = 0; i < spare.length; i += 3) {
    const pixel = spare[i];
    if (taken[pixel] !== stroke) count = lay(mark.strip, pixel, spare[i + 1], spare[i + 2], band.closed, stroke, count);
  }
  return count;
}

/** Read a texture at u in [0, 1] and v, and put it on a pixel unless something stronger is there; the new count. */
function lay(strip, pixel, u, v, wrap, stamp, count) {
  const { stroke, pixels, a } = scratch;
  const alpha = sample(strip, u, v, wrap);
  if (stroke[pixel] !== stamp) {
    if (alpha <= 0) return count;
    stroke[pixel] = stamp;
    pixels[count++] = pixel;
  } else if (alpha <= a[pixel]) return count;
  a[pixel] = alpha;
  if (!strip.alpha) {
    scratch.r[pixel] = texel.r;
    scratch.g[pixel] = texel.g;
    scratch.b[pixel] = texel.b;
  }
  return count;
}

const texel = { r: 0, g: 0, b: 0 };

/** The opacity of a texture at u in [0, 1] and v in [-1, 1], bilinear, 0 outside; its colours go to `texel`. */
function sample(strip, u, v, wrap) {
  if (v > 1 || v < -1) return 0;
  const { rows, columns, alpha } = strip;
  const row = u * rows - 0.5;
  let r0 = Math.floor(row);
  let r1 = r0 + 1;
  const down = row - r0;
  if (r0 < 0) r0 = wrap ? rows - 1 : 0;
  if (r1 >= rows) r1 = wrap ? 0 : rows - 1;
  const column = (v + 1) * 0.5 * columns - 0.5;
  let c0 = Math.floor(column);
  let c1 = c0 + 1;
  const right = column - c0;
  if (c0 < 0) c0 = 0;
  if (c1 >= columns) c1 = columns - 1;
  r0 *= columns;
  r1 *= columns;
  if (alpha) {
    const top = alpha[r0 + c0] + right * (alpha[r0 + c1] - alpha[r0 + c0]);
    const bottom = alpha[r1 + c0] + right * (alpha[r1 + c1] - alpha[r1 + c0]);
    return (top + down * (bottom - top)) * (1 / 255);
  }
  const { data } = strip;
  const [i00, i01, i10, i11] = [4 * (r0 + c0), 4 * (r0 + c1), 4 * (r1 + c0), 4 * (r1 + c1)];
  const channel = (k) => {
    const top = data[i00 + k] + right * (data[i01 + k] - data[i00 + k]);
    const bottom = data[i10 + k] + right * (data[i11 + k] - data[i10 + k]);
    return (top + down * (bottom - top)) * (1 / 255);
  };
  texel.r = channel(0);
  texel.g = channel(1);
  texel.b = channel(2);
  return channel(3);
}

/** Paint marks, first to last, over opaque pixels: `image` is an ImageData whose corner lies at (x0, y0) of the canvas. */
function paintMarks(marks, view, image, x0 = 0, y0 = 0) {
  const { width, height } = image;
  const data = new Uint8Array(image.data.buffer, image.data.byteOffset, image.data.length);
  const clip = [x0, y0, x0 + width, y0 + height];
  for (const mark of marks) {
    const made = pixelsOf(mark, view, clip);
    if (!made) continue;
    const { pixels, a, r, g, b, ink, count, w } = made;
    const [red, green, blue] = ink ? ink.map((c) => 255 * c) : [0, 0, 0];
    const corner = (made.y0 - y0) * width + made.x0 - x0;
    for (let k = 0; k < count; k++) {
      const pixel = pixels[k];
      const row = (pixel / w) | 0;
      const at = 4 * (corner + row * width + pixel - row * w);
      const alpha = a[pixel];
      const rest = 1 - alpha;
      if (ink) {
        data[at] = (alpha * red + rest * data[at] + 0.5) | 0;
        data[at + 1] = (alpha * green + rest * data[at + 1] + 0.5) | 0;
        data[at + 2] = (alpha * blue + rest * data[at + 2] + 0.5) | 0;
      } else {
        data[at] = (255 * r[pixel] + rest * data[at] + 0.5) | 0;
        data[at + 1] = (255 * g[pixel] + rest * data[at + 1] + 0.5) | 0;
        data[at + 2] = (255 * b[pixel] + rest * data[at + 2] + 0.5) | 0;
      }
    }
  }
}
