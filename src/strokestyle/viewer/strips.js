// Textures carried from a stroke to what an edit made of it, as strip.py does it.

const { MAX_COLUMNS, MAX_STRETCH, TONE_BLUR, TONE_LEVELS } = CONSTANTS.strip;
const SAME = 0.01; // px of half width: less is no change

/** Arc length, half width of the ribbon and width at the points of a line. */
function profileOf(line, margin) {
  const s = arcLength(line.x, line.y);
  const half = halfWidths(line, s, margin);
  let widest = 0;
  for (const h of half) if (h > widest) widest = h;
  const total = s[s.length - 1];
  const caps = line.closed ? [0, 0] : [half[0], half[half.length - 1]];
  return {
    s,
    half,
    width: line.width,
    widest,
    total,
    caps,
    length: Math.max(total + caps[0] + caps[1], 1e-6),
  };
}

/** The profile of a stroke's own line, kept. */
function ownProfile(stroke) {
  if (!stroke.profile) {
    const { s, half, ...rest } = profileOf(stroke.line, stroke.margin);
    stroke.profile = { ...rest, s: s.slice(), half: half.slice() };
  }
  return stroke.profile;
}

/**
 * Strips (rows, columns) of a drawing as its reader has them: all on as many columns, bilinearly.
 */
function wider({ rows, columns: a, alpha, data }, columns) {
  const [channels, texels] = [alpha ? 1 : 4, alpha ?? data];
  const out = new Uint8Array(channels * rows * columns);
  for (let c = 0; c < columns; c++) {
    const place = Math.min(Math.max(((c + 0.5) / columns) * a - 0.5, 0), a - 1);
    const c0 = Math.min(Math.floor(place), Math.max(a - 2, 0));
    const [c1, right] = [Math.min(c0 + 1, a - 1), place - c0];
    for (let r = 0; r < rows; r++) {
      for (let k = 0; k < channels; k++) {
        const [low, high] = [
          texels[channels * (r * a + c0) + k],
          texels[channels * (r * a + c1) + k],
        ];
        out[channels * (r * columns + c) + k] = low + right * (high - low) + 0.5;
      }
    }
  }
  return { rows, columns, alpha: alpha && out, data: data && out };
}

/**
 * The strip of a stroke on `line`, which was made of it, of the profile `now`; `thickness` is the
 * factor by which it grew.
 *
 * Along, tone and ink lie by the point where they lay; across, they are stretched with the
 * thickness, but for the soft edge beyond it. Grain keeps its own scale: where it would be
 * stretched by more than MAX_STRETCH, it is laid anew. There are no more texels than about
 * `density` a px; as long as it is not Infinity, grain that nobody had time to look at yet may be
 * stretched.
 */
function carried(stroke, line, now, thickness, density) {
  const { strip, margin, stout } = stroke;
  const { rows: n, columns: a } = strip;
  const { closed } = line;
  const old = ownProfile(stroke);
  const growth = (thickness * stout + 1) / (stout + 1); // of the drawing's ribbons, at most
  const most = growth < MAX_STRETCH ? a : Math.min(Math.ceil(a * growth), MAX_COLUMNS);
  const few = Math.max(4, Math.ceil(2 * now.widest * density));
  const columns = 1.5 * few < most ? few : most;
  const rows = Math.max(2, Math.round((Math.min(density, 1) * n * now.length) / old.length));
  const lie = rowsCarried(stroke, line, old, now, rows);
  const along = grainRows(lie, now.length / rows / (old.length / n));
  const grain = along && (density < Infinity ? stroke.grain : grainOf(stroke));
  const channels = strip.alpha ? 1 : 4;
  const out = new Uint8Array(channels * rows * columns);
  const [ink, tone] = [new Float32Array(channels * a), new Float32Array(a)]; // of one row
  const middle = (a - 1) / 2;
  for (let r = 0; r < rows; r++) {
    const [ratio, half, oldHalf] = [lie.ratio[r], lie.half[r], Math.max(lie.oldHalf[r], 1e-9)];
    rowOf(ink, grain?.ink ?? strip.alpha ?? strip.data, lie.row[r], n, closed);
    if (!grain && columns === a && Math.abs(half - oldHalf) + Math.abs(ratio - 1) < SAME) {
      for (let i = 0; i < ink.length; i++) out[r * ink.length + i] = ink[i] + 0.5;
      for (let c = 0; 2 * oldHalf * (c + 1) < a && 2 * c < a; c++) {
        const seen = (2 * oldHalf * (c + 1)) / a;
        for (let i = 0; i < channels; i++) {
          for (const at of [channels * (r * a + c) + i, channels * (r * a + a - 1 - c) + i])
            out[at] = seen * out[at] + 0.5;
        }
      }
      continue;
    }
    if (grain) rowOf(tone, grain.tone, lie.row[r], n, closed);
    const ranks = grain ? a * Math.round(mirrored(along[r], n)) : 0;
    const core = Math.max(oldHalf - margin, 0);
    const thin = 1 / Math.max(ratio, 1e-9);
    const texels = a / (2 * oldHalf); // a px
    const kept = texels / Math.min(Math.max(ratio, 1 / MAX_STRETCH), MAX_STRETCH);
    // from both edges to the middle, on either side alike
    for (let c = 0; 2 * c < columns; c++) {
      const away = (1 - (2 * c + 1) / columns) * half;
      // across: ink stretched by how much thicker the stroke became, its soft edge as wide as it
      // was
      const source = away <= core * ratio ? away * thin : core + away - core * ratio;
      // past the old ribbon's edge there is nothing
      const seen = lie.faint[r] * Math.min(oldHalf - source + oldHalf / a, 1);
      if (seen <= 0) continue;
      const place = Math.max(middle - source * texels, 0);
      const low = Math.floor(place);
      const right = place - low;
      const high = low + 1 < a ? low + 1 : low;
      const [left, other] = [r * columns + c, (r + 1) * columns - 1 - c];
      if (!grain) {
        put(out, other, channels, ink, a - 1 - low, a - 1 - high, right, seen);
        put(out, left, channels, ink, low, high, right, seen);
        continue;
      }
      const beside = Math.round(mirrored(middle - away * kept, a));
      let opacity = grainAt(
        grain,
        between(tone, a - 1 - low, a - 1 - high, right),
        grain.rank[ranks + a - 1 - beside],
      );
      regrain(out, other, channels, ink, a - 1 - low, a - 1 - high, right, seen, opacity);
      opacity = grainAt(grain, between(tone, low, high, right), grain.rank[ranks + beside]);
      regrain(out, left, channels, ink, low, high, right, seen, opacity);
    }
  }
  return { rows, columns, alpha: strip.alpha && out, data: strip.data && out };
}

function between(values, low, high, share) {
  return values[low] + share * (values[high] - values[low]);
}

/** A texel of as many channels, between two of a row, made as faint as is said. */
function put(out, at, channels, ink, low, high, share, seen) {
  for (let i = 0; i < channels; i++) {
    out[channels * at + i] =
      seen * between(ink, channels * low + i, channels * high + i, share) + 0.5;
  }
}

/** The same, of another opacity (0 .. 255): that of its grain. */
function regrain(out, at, channels, ink, low, high, share, seen, opacity) {
  if (channels === 1) out[at] = seen * opacity + 0.5;
  else
    put(
      out,
      at,
      4,
      ink,
      low,
      high,
      share,
      (seen * opacity) / Math.max(between(ink, 4 * low + 3, 4 * high + 3, share), 1e-6),
    );
}

/** A row of n rows of texels, read between two of them, into `out`. */
function rowOf(out, texels, row, n, closed) {
  const low = Math.floor(row);
  const down = row - low;
  const a = out.length * (low >= 0 ? Math.min(low, n - 1) : closed ? n - 1 : 0);
  const b = out.length * (low + 1 < n ? low + 1 : closed ? 0 : n - 1);
  for (let i = 0; i < out.length; i++)
    out[i] = texels[a + i] + down * (texels[b + i] - texels[a + i]);
}

/**
 * Where the rows of a new strip lay, each (rows,): `row` of the old strip, `half` width of the
 * ribbon and `oldHalf`, `ratio` of the new width to the old one, and how `faint` the stroke became
 * as it became a hair.
 */
function rowsCarried(stroke, line, old, now, rows) {
  const u = floats(rows);
  for (let r = 0; r < rows; r++) u[r] = ((r + 0.5) / rows) * now.length - now.caps[0];
  const before = placesBefore(u, line, old, now);
  const [width, half] = interp(u, now.s, line.width, now.half);
  const [oldWidth, oldHalf] = interp(before, old.s, stroke.line.width, old.half);
  const [row, ratio, faint] = [floats(rows), floats(rows), floats(rows)];
  for (let r = 0; r < rows; r++) {
    row[r] = ((before[r] + old.caps[0]) / old.length) * stroke.strip.rows - 0.5;
    ratio[r] = oldWidth[r] > 1e-6 ? width[r] / oldWidth[r] : 1;
    faint[r] = Math.min(width[r] / Math.max(Math.min(oldWidth[r], 1), 1e-6), 1);
  }
  return { row, ratio, faint, half, oldHalf, oldWidth };
}

/**
 * Where points at arc lengths u of a line lay, in px of the line that it was: the same point; in a
 * cap, the same share.
 */
function placesBefore(u, line, old, now) {
  const [before] = interp(u, now.s, atIndex(old.s, line.was));
  for (let i = 0; i < u.length; i++) {
    if (u[i] < 0) before[i] = (u[i] / Math.max(now.caps[0], 1e-9)) * old.caps[0];
    else if (u[i] > now.total)
      before[i] = old.total + ((u[i] - now.total) / Math.max(now.caps[1], 1e-9)) * old.caps[1];
  }
  return before;
}

/**
 * The rows of a mark's strip at the points of its ribbon, the strip being that of a stroke that was
 * not bent.
 */
function rowsOf({ line, band, strip }, old, now) {
  const u = floats(band.along.length);
  for (let i = 0; i < u.length; i++)
    u[i] = (band.along[i] / band.length) * now.length - now.caps[0];
  const before = placesBefore(u, line, old, now);
  const row = new Float64Array(u.length);
  for (let i = 0; i < u.length; i++)
    row[i] = ((before[i] + old.caps[0]) / old.length) * strip.rows - 0.5;
  return row;
}

/**
 * Where grain that is not stretched lies along the old strip, in rows of it; null where it may be
 * stretched as it is.
 */
function grainRows({ row, ratio, oldWidth }, texel) {
  const rows = row.length;
  const along = floats(rows);
  let [sum, stretched] = [0, false];
  for (let r = 0; r < rows; r++) {
    const a = r > 0 ? r - 1 : 0;
    const b = r < rows - 1 ? r + 1 : r;
    const rate = rows > 2 ? (row[b] - row[a]) / (b - a) / texel : 1;
    stretched ||= much(rate) || (oldWidth[r] > 0.5 && much(ratio[r]));
    along[r] = sum += Math.min(Math.max(rate, 1 / MAX_STRETCH), MAX_STRETCH) * texel;
  }
  return stretched ? along : null;
}

function much(factor) {
  return factor < 1 / MAX_STRETCH || factor > MAX_STRETCH;
}

/**
 * A stroke's strip as tone, the mean opacity along it, and grain, a texel's rank among those of
 * about its tone: {tone, rank, sorted: opacities by tone and rank, first, count: of each level of
 * tone, nearest: level that there is, ink: its colours, without gaps}. Made once.
 */
function grainOf(stroke) {
  return (stroke.grain ??= grainMade(stroke));
}

function grainMade(stroke) {
  const { strip } = stroke;
  const { closed } = stroke.line;
  const sigma = (TONE_BLUR * strip.rows) / ownProfile(stroke).length;
  const { rows, columns, data } = strip;
  const size = rows * columns;
  const bytes = strip.alpha ?? channelOf(data, 3);
  const tone = spreadOut(bytes, rows, columns, sigma, 1, closed);
  const level = new Uint8Array(size);
  for (let i = 0; i < size; i++)
    level[i] = Math.min(Math.floor((tone[i] * TONE_LEVELS) / 255), TONE_LEVELS - 1);
  // sorted by tone, then opacity, by counting
  const place = new Int32Array(256 * TONE_LEVELS + 1);
  for (let i = 0; i < size; i++) place[256 * level[i] + bytes[i] + 1]++;
  for (let i = 0; i < 256 * TONE_LEVELS; i++) place[i + 1] += place[i];
  const first = Int32Array.from({ length: TONE_LEVELS }, (_, k) => place[256 * k]);
  const count = Array.from(first, (from, k) => (k < TONE_LEVELS - 1 ? first[k + 1] : size) - from);
  const [rank, sorted] = [new Float32Array(size), new Uint8Array(size)];
  for (let i = 0; i < size; i++) {
    const at = place[256 * level[i] + bytes[i]]++;
    sorted[at] = bytes[i];
    rank[i] = (at - first[level[i]] + 0.5) / count[level[i]];
  }
  const filled = Array.from(count.keys()).filter((k) => count[k]);
  const nearest = count.map((_, k) =>
    filled.reduce((best, f) => (Math.abs(f - k) < Math.abs(best - k) ? f : best)),
  );
  const ink = data && inkAround(strip, (2 * sigma) / TONE_BLUR, closed);
  return {
    tone,
    rank,
    sorted,
    first,
    count: Int32Array.from(count),
    nearest: Uint8Array.from(nearest),
    ink,
  };
}

/**
 * Premultiplied colours of a strip, blurred so that there is ink everywhere, for grain that comes
 * to lie elsewhere.
 */
function inkAround({ rows, columns, data }, sigma, closed) {
  const out = new Float32Array(data.length);
  for (let k = 0; k < 4; k++) {
    const plane = channelOf(data, k);
    const mean = plane.reduce((sum, value) => sum + value, 0) / plane.length;
    const near = spreadOut(plane, rows, columns, sigma, 1, closed);
    for (let i = 0; i < near.length; i++) out[4 * i + k] = near[i] + 1e-4 * mean;
  }
  return out;
}

function channelOf(data, k) {
  const out = new Uint8Array(data.length / 4);
  for (let i = 0; i < out.length; i++) out[i] = data[4 * i + k];
  return out;
}

/**
 * Texels under a Gaussian, of `along` rows and `across` columns; beyond the strip's sides there is
 * nothing.
 */
function spreadOut(values, rows, columns, along, across, closed) {
  const size = values.length;
  const [down, aside] = [gaussian(along), gaussian(across)];
  const reach = down.length - 1;
  const padded = new Float32Array(size + 2 * reach * columns);
  for (let r = -reach; r < rows + reach; r++) {
    const from = closed ? (r + rows * reach) % rows : Math.min(Math.max(r, 0), rows - 1);
    for (let c = 0; c < columns; c++)
      padded[(r + reach) * columns + c] = values[from * columns + c];
  }
  const [half, out] = [new Float32Array(size), new Float32Array(size)];
  for (let k = -reach; k <= reach; k++) {
    const [weight, shift] = [down[Math.abs(k)], (k + reach) * columns];
    for (let i = 0; i < size; i++) half[i] += weight * padded[i + shift];
  }
  for (let k = 1 - aside.length; k < aside.length; k++) {
    const weight = aside[Math.abs(k)];
    for (let r = 0; r < rows; r++) {
      const end = r * columns + Math.min(columns, columns - k);
      for (let i = r * columns + Math.max(0, -k); i < end; i++) out[i] += weight * half[i + k];
    }
  }
  return out;
}

/** Half a Gaussian's weights, from its middle. */
function gaussian(sigma) {
  const weights = new Float64Array(Math.floor(4 * sigma + 0.5) + 1);
  let sum = 0;
  for (let k = 0; k < weights.length; k++) {
    weights[k] = Math.exp((-0.5 * k * k) / (sigma * sigma));
    sum += k ? 2 * weights[k] : weights[k];
  }
  return weights.map((w) => w / sum);
}

/** A place on 0 .. n - 1, mirrored at both ends as often as it takes. */
function mirrored(at, n) {
  const period = 2 * (n - 1) || 1;
  if (at >= 0 && at <= n - 1) return at;
  return n - 1 - Math.abs(at - period * Math.floor(at / period) - (n - 1));
}

/**
 * The opacity, 0 .. 255, of a tone where the grain has a rank: what is of that tone has at its
 * rank.
 */
function grainAt({ sorted, first, count, nearest }, tone, rank) {
  // between two levels of tone, texels take one or the other: a blend of two grains is grey
  const place = Math.min(Math.max((tone * TONE_LEVELS) / 255 - 0.5, 0), TONE_LEVELS - 1);
  const dither = rank * 7919;
  const k = nearest[Math.min(Math.floor(place + dither - Math.floor(dither)), TONE_LEVELS - 1)];
  return sorted[first[k] + Math.min(Math.floor(rank * count[k]), count[k] - 1)];
}
