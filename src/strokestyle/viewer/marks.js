// Strokes under an edit, as marks to be painted; all that a painter needs to know, on the page or
// in a worker of its own.
//
// An edit is {thickness, wiggle, wavelength, hidden: [layer], strokes: {number: {thickness, wiggle,
// moves, removed}}} and is never changed in place: undo goes back to an older one.

const PLAIN = { thickness: 1, wiggle: 0, moves: [], removed: false };
const UNEDITED = { thickness: 1, wiggle: 0, wavelength: 40, hidden: [], strokes: {} };
// of its thickness: less stretches a texture, and changes how stiff a ribbon is, so little that
// nobody sees it while things move
const NEAR = 0.25;
const REHEARSED = [1, 0.9, 0.8, 0.7, 0.6, 0.9, 1.1, 1.2, 1.3, 1.5, 1.8, 2.1]; // thicknesses
const PAUSE = 300; // ms after a job until a painter gets ready for the next
const COARSE = 0.2; // px of a canvas that a ribbon may lie off while things move

function strokeEdit(edit, number) {
  return edit.strokes[number] ?? PLAIN;
}

function visible(edit, stroke) {
  return (
    !strokeEdit(edit, stroke.number).removed &&
    !(edit.hidden.length && hiddenBy(edit.hidden, stroke))
  );
}

/** Layers that are off: kinds "contour", parts "/wheel", a kind's part "contour/wheel". */
function hiddenBy(hidden, { kind, part }) {
  return hidden.includes(kind) || hidden.includes(`/${part}`) || hidden.includes(`${kind}/${part}`);
}

/** Everything that a stroke's shape depends on. */
function effective(edit, stroke) {
  const own = strokeEdit(edit, stroke.number);
  const wiggle = edit.wiggle + own.wiggle;
  return {
    thickness: edit.thickness * own.thickness,
    wiggle,
    wavelength: wiggle ? edit.wavelength : 0,
    moves: own.moves,
  };
}

function sameShape(a, b) {
  if (a.thickness !== b.thickness || a.wiggle !== b.wiggle || a.wavelength !== b.wavelength)
    return false;
  return a.moves === b.moves || (!a.moves.length && !b.moves.length);
}

/**
 * The mark of a stroke under an edit, made anew where another edit was made since, or where it was
 * made too coarse.
 */
function markNow(sheet, stroke, edit, density = Infinity) {
  const wanted = effective(edit, stroke);
  const cached = sheet.marks[stroke.number];
  if (cached && cached.density >= density) {
    if (sameShape(cached.wanted, wanted)) return cached.mark;
    if (density < Infinity && rethickened(cached, stroke, wanted)) return cached.mark;
  }
  const mark = markOf(stroke, wanted, density);
  sheet.marks[stroke.number] = { wanted, mark, density };
  return mark;
}

/**
 * A stroke under an edit, as a mark; as coarse as a canvas of `density` pixels a pixel of the
 * drawing lets it be: then its texture is the one that its thickness alone gives it, bent along
 * with it, and lasts as long as only the line moves.
 */
function markOf(stroke, wanted, density = Infinity) {
  const line = edited(stroke, wanted);
  const changed = line !== stroke.line;
  const mark = { stroke, line, color: stroke.color, strip: stroke.strip, changed };
  if (mark.strip) inSpare(() => dressed(mark, wanted, density));
  return mark;
}

/** Give a mark its ribbon, and the texture on it. */
function dressed(mark, { thickness }, density) {
  const { stroke, line, changed } = mark;
  const now = profileOf(line, stroke.margin);
  if (density === Infinity) {
    mark.band = ribbonOf(line, now.half, THIN, 1);
    if (changed) mark.strip = carried(stroke, line, now, thickness, density);
  } else {
    mark.band = ribbonOf(
      line,
      now.half,
      Math.max(COARSE / density, THIN),
      STEP / Math.min(density, 1),
    );
    if (thickness !== 1) mark.strip = thickened(stroke, thickness, density);
    if (line.was !== stroke.line.was) {
      const { margin } = stroke;
      const old =
        thickness === 1 ? ownProfile(stroke) : profileOf(thickLine(stroke.line, thickness), margin);
      mark.band.row = rowsOf(mark, old, now);
    }
  }
  const { band, strip } = mark;
  band.row ??= band.along.map((at) => (at / band.length) * strip.rows - 0.5);
}

/**
 * Whether a cached mark was made, in place and without new memory, that of an edit which changes
 * its thickness alone, and that a little: most of what a mark costs is its ribbon.
 */
function rethickened(cached, stroke, wanted) {
  const { mark, density } = cached;
  const { thickness } = wanted;
  if (density === Infinity || !mark.strip || !sameShape({ ...cached.wanted, thickness }, wanted))
    return false;
  const { band } = mark;
  const { tx, ty, length, extent } = prepared(mark);
  const first = (mark.first ??= {
    thickness: cached.wanted.thickness,
    width: mark.line.width,
    half: band.half.slice(),
    extent: extent.slice(),
  });
  if (mark.line.width === first.width)
    mark.line = { ...mark.line, width: new Float64Array(first.width.length) };
  const factor = thickness / first.thickness;
  if (!(Math.abs(factor - 1) < nearOf(stroke))) return false;
  const { x, y, half, along, row } = band;
  const n = half.length - 1;
  const { margin } = stroke;
  for (let i = 0; i < first.width.length; i++) mark.line.width[i] = factor * first.width[i];
  const [head, tail] = [half[0], half[n]];
  let most = 0;
  for (let i = 0; i <= n; i++) {
    half[i] = margin + factor * (first.half[i] - margin);
    if (half[i] > most) most = half[i];
  }
  if (!band.closed) {
    // it runs on past its ends by its half width there
    const [more, further] = [half[0] - head, half[n] - tail];
    [x[0], y[0]] = [x[0] - more * tx[0], y[0] - more * ty[0]];
    [x[n], y[n]] = [x[n] + further * tx[n - 1], y[n] + further * ty[n - 1]];
    length[0] += more;
    length[n - 1] += further;
    for (let i = 1; i <= n; i++) along[i] += more;
    along[n] += further;
    band.length += more + further;
  }
  const grown = Math.max(2 * (factor - 1), 0) * most; // its caps as well
  for (let i = 0; i < 4; i++) extent[i] = first.extent[i] + (i < 2 ? -grown : grown);
  const { rows } = mark.strip;
  mark.strip = thickened(stroke, thickness, density);
  for (let i = 0; i <= n; i++) {
    if (mark.line.was === stroke.line.was) row[i] = (along[i] / band.length) * mark.strip.rows - 0.5;
    else row[i] = ((row[i] + 0.5) / rows) * mark.strip.rows - 0.5;
  }
  cached.wanted = wanted;
  return true;
}

/** How much of its thickness a stroke may change until it is made anew: not all at once. */
function nearOf({ number }) {
  return (NEAR * (2 + (number % 4))) / 5;
}

/**
 * The strip of a stroke whose thickness alone changed, made coarsely; its own or the last one that
 * was made will do for a little change.
 */
function thickened(stroke, thickness, density) {
  const { last } = stroke;
  if (Math.abs(thickness - 1) < nearOf(stroke)) return stroke.strip;
  if (last?.density >= density && Math.abs(thickness / last.thickness - 1) < nearOf(stroke))
    return last.strip;
  const line = thickLine(stroke.line, thickness);
  const strip = carried(stroke, line, profileOf(line, stroke.margin), thickness, density);
  stroke.last = { thickness, density, strip };
  return strip;
}

function thickLine(line, thickness) {
  if (thickness === 1) return line;
  const width = new Float64Array(line.width.length);
  for (let i = 0; i < width.length; i++) width[i] = thickness * line.width[i];
  return { ...line, width };
}

/** A stroke's line with an edit made: points moved one after another, wiggle, thickness. */
function edited(stroke, { thickness, wiggle, wavelength, moves }) {
  let line = moves.reduce(moved, stroke.line);
  if (wiggle > 0 && line.x.some((x, i) => x !== line.x[0] || line.y[i] !== line.y[0])) {
    const { waves } = stroke;
    if (waves?.moves !== moves || waves.wavelength !== wavelength) {
      stroke.waves = { moves, wavelength, ...wavesOf(line, wavelength, stroke.number) };
    }
    line = wiggled(stroke.waves, wiggle);
  }
  return thickLine(line, thickness);
}

/** The part [x0, y0, x1, y1] of the drawing that a line and its soft edge may touch. */
function extentOf({ x, y, width }, margin) {
  let [left, top, right, bottom, widest] = [x[0], y[0], x[0], y[0], width[0]];
  for (let i = 1; i < x.length; i++) {
    if (x[i] < left) left = x[i];
    if (y[i] < top) top = y[i];
    if (x[i] > right) right = x[i];
    if (y[i] > bottom) bottom = y[i];
    if (width[i] > widest) widest = width[i];
  }
  const reach = widest / 2 + margin;
  return [left - reach, top - reach, right + reach, bottom + reach];
}

/** Whether a stroke under an edit surely lies outside of a clip [x0, y0, x1, y1] of the canvas. */
function outside(stroke, { thickness, wiggle, moves }, { scale, x, y }, clip) {
  const [left, top, right, bottom] = (stroke.extent ??= extentOf(stroke.line, stroke.margin));
  const widest = (stroke.widest ??= stroke.line.width.reduce((most, w) => Math.max(most, w), 0));
  let far = wiggle + (Math.max(thickness - 1, 0) * widest) / 2 + 1;
  for (const { dx, dy } of moves) far += Math.hypot(dx, dy);
  return (
    scale * (right + far) + x < clip[0] ||
    scale * (bottom + far) + y < clip[1] ||
    scale * (left - far) + x > clip[2] ||
    scale * (top - far) + y > clip[3]
  );
}

/**
 * Paint a sheet's strokes under an edit over `image`, whose corner lies at (x0, y0) of the canvas.
 */
function paintStrokes(sheet, edit, view, density, image, x0 = 0, y0 = 0) {
  const clip = [x0, y0, x0 + image.width, y0 + image.height];
  for (const stroke of sheet.strokes) {
    if (!visible(edit, stroke) || outside(stroke, effective(edit, stroke), view, clip)) continue;
    paintMark(markNow(sheet, stroke, edit, density), view, image, clip);
  }
}

/**
 * A painter's job done: {sheet: its number, edit, view, density, background, x0, y0, width, height}
 * -> RGBA bytes.
 */
function painted(sheet, { edit, view, density, background, x0, y0, width, height }) {
  const data = new Uint8ClampedArray(4 * width * height);
  new Uint32Array(data.buffer).fill(background);
  paintStrokes(sheet, edit, view, density, { data, width, height }, x0, y0);
  return data;
}

// in a worker: strokes are told once, then jobs come
if (typeof document === "undefined") {
  const sheets = [];
  let [worked, rehearsed] = [-Infinity, 0]; // when the last job was done; how often it was rehearsed
  onmessage = ({ data: { strokes, job } }) => {
    if (strokes) {
      sheets.push({ strokes, marks: [] });
      setTimeout(getReady);
    } else {
      const data = painted(sheets[job.sheet], job);
      postMessage(data, [data.buffer]);
      worked = performance.now();
    }
  };
  // the first change shall not have to wait for what can be made beforehand, nor for the compiler:
  // while nobody asks for anything, the first drawing is painted small a few times, thinner, once
  // bent, then textures are looked at, then it is painted thicker
  const getReady = () => {
    if (performance.now() - worked < PAUSE) {
      setTimeout(getReady, PAUSE);
      return;
    }
    const waiting = sheets.flatMap(({ strokes }) => strokes.filter(({ ready }) => !ready));
    const enough = waiting.length ? REHEARSED.length / 2 : REHEARSED.length;
    if (rehearsed < enough) rehearse(REHEARSED[rehearsed++]);
    else {
      for (const stroke of waiting.slice(0, 4)) {
        stroke.ready = true;
        if (stroke.strip) grainOf(stroke);
      }
    }
    if (waiting.length || rehearsed < REHEARSED.length) setTimeout(getReady);
  };
  const rehearsal = { strokes: [], marks: [] };
  const rehearse = (thickness) => {
    rehearsal.strokes = sheets[0].strokes;
    const edit = { ...UNEDITED, thickness, wiggle: thickness === 1 ? 2.5 : 0 };
    const view = { scale: 0.37, x: 20.3, y: 10.6 };
    const box = { x0: 20, y0: 10, width: 256, height: 256 };
    painted(rehearsal, { edit, view, density: 0.42, background: 0xffffffff, ...box });
    if (rehearsed === REHEARSED.length) rehearsal.marks = [];
  };
}
