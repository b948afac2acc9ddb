const AXES = ["x", "y", "z"];
const TRIAD_PIXELS = 28;
const MARK_PIXELS = 9;
const SAME_PLACE = 1e-3; // metres
const GHOSTS = 12;
const COLOUR_STEPS = 64;
const LABEL_HEIGHT = 14;

/** Draws one state of a run on a canvas. */
class Scene {
  constructor(canvas, run, camera) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.run = run;
    this.camera = camera;
    this.options = { names: true, frames: true, ghosts: false, follow: false };
    this.box = runBox(run);
    this.reach = largestReach(run);
    this.readColours();
  }

  /** Whether the run travels so far that following the cable shows more. */
  get travels() {
    const size = (box) => Math.max(...AXES.map((_, k) => box[1][k] - box[0][k]));
    return size(this.box) > 2.5 * Math.max(...this.reach);
  }

  /** Take the colours from the style sheet, which knows the light and the dark scheme. */
  readColours() {
    const style = getComputedStyle(this.canvas);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["surface", "grid", "muted", "ink", "buoy", "ballast", "body", "cable", "t", "n", "b"];
    this.colours = Object.fromEntries(names.map((name) => [name, colour(name)]));
    this.ramp = rampColours(colour("ramp").split(/\s*,\s*/));
    this.font = style.fontFamily;
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    const density = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(clientWidth * density);
    this.canvas.height = Math.round(clientHeight * density);
    this.pen.setTransform(density, 0, 0, density, 0, 0);
    this.camera.resize(clientWidth, clientHeight);
  }

  draw(state) {
    const box = this.options.follow ? this.boxAround(state) : this.box;
    const view = this.camera.view(box);
    this.taken = [];
    this.pen.clearRect(0, 0, ...this.camera.size);
    this.drawBox(box, view);
    const shape = this.run.shape(state);
    this.drawShadow(shape, box, view);
    if (this.options.ghosts) this.drawGhosts(state, view);
    this.drawCable(state, shape, view);
    if (this.options.frames) this.drawImus(state, view);
    this.drawBodies(state, shape, view);
    this.drawEnds(shape, view);
    if (this.options.names) this.drawNames(state, view);
    this.drawScale(view);
  }

  /** A box of constant size around a state. */
  boxAround(state) {
    const [low, high] = boxOf(this.run.shape(state).map(({ place }) => place));
    const half = padded(this.reach);
    const centre = AXES.map((_, k) => (low[k] + high[k]) / 2);
    return [AXES.map((_, k) => centre[k] - half[k]), AXES.map((_, k) => centre[k] + half[k])];
  }

  // The box and its numbers

  drawBox(box, view) {
    const marks = AXES.map((_, k) => ticks([box[0][k], box[1][k]], tickCount(box, k, view)));
    for (let k = 0; k < 3; k += 1) {
      if (Math.abs(view.toEye[k]) > 0.02) this.drawWall(box, k, marks, view);
    }
    for (let k = 0; k < 3; k += 1) this.drawNumbers(box, k, marks[k], view);
  }

  /** Grid on the wall across axis k that is behind the scene. */
  drawWall(box, k, marks, view) {
    const behind = box[view.toEye[k] > 0 ? 0 : 1][k];
    this.stroke(this.colours.grid, 1);
    for (const [along, across] of [[(k + 1) % 3, (k + 2) % 3], [(k + 2) % 3, (k + 1) % 3]]) {
      for (const mark of [box[0][along], ...marks[along], box[1][along]]) {
        const line = [0, 1].map((side) => place3([k, behind], [along, mark], [across, box[side][across]]));
        this.polyline(line.map(view.project));
      }
    }
  }

  /** Numbers along the edge parallel to axis k that is on the rim of the picture. */
  drawNumbers(box, k, marks, view) {
    const edge = rimEdge(box, k, view);
    const length = Math.hypot(dot(unit(k), view.right), dot(unit(k), view.up)) * view.scale;
    if (!edge || length * (box[1][k] - box[0][k]) < 40) return;
    const [i, j] = [(k + 1) % 3, (k + 2) % 3];
    const at = (value) => view.project(place3([k, value], [i, edge[0]], [j, edge[1]]));
    const middle = view.project(AXES.map((_, axis) => (box[0][axis] + box[1][axis]) / 2));
    const outward = awayFrom(middle, at(box[0][k]), at(box[1][k]));
    for (const mark of marks) {
      const [x, y] = at(mark);
      this.stroke(this.colours.muted, 1);
      this.polyline([[x, y], [x + 4 * outward[0], y + 4 * outward[1]]]);
      this.text(readable(mark), [x + 14 * outward[0], y + 12 * outward[1]], this.colours.muted, outward);
    }
    this.drawTitle(k, box, at, outward);
  }

  /** Name of an axis: z above its numbers, where a narrow picture has room, others beside them. */
  drawTitle(k, box, at, outward) {
    const upright = Math.abs(outward[0]) > 0.7;
    const [x, y] = at(upright ? box[1][k] : (box[0][k] + box[1][k]) / 2);
    const title = upright ? [x, y - 14] : [x + 30 * outward[0], y + 30 * outward[1]];
    this.text(`${AXES[k]} [m]`, title, this.colours.ink, upright ? [0, 0] : outward);
  }

  /** A bar of round length. */
  drawScale({ scale }) {
    const length = roundBelow(130 / scale);
    const [left, bottom] = [16, this.camera.size[1] - 16];
    const right = left + length * scale;
    this.stroke(this.colours.ink, 1.5);
    this.polyline([[left, bottom - 4], [left, bottom], [right, bottom], [right, bottom - 4]]);
    this.text(`${readable(length)} m`, [(left + right) / 2, bottom - 9], this.colours.ink, [0, 0]);
  }

  // The cable

  drawShadow(shape, box, view) {
    const floor = box[0][2];
    this.stroke(this.colours.muted, 1.5, 0.35);
    this.polyline(shape.map(({ place }) => view.project([place[0], place[1], floor])));
  }

  /** Shapes before this state, evenly spread over the run. */
  drawGhosts(state, view) {
    for (let i = 0; i <= GHOSTS; i += 1) {
      const ghost = Math.round((i * (this.run.states - 1)) / GHOSTS);
      if (ghost >= state) return;
      this.stroke(this.colours.cable, 1.2, 0.35);
      this.polyline(this.run.shape(ghost).map(({ place }) => view.project(place)));
    }
  }

  drawCable(state, shape, view) {
    const points = shape.map(({ place }) => view.project(place));
    this.stroke(this.colours.surface, 6, 0.8);
    this.polyline(points);
    for (let i = 1; i < shape.length; i += 1) {
      const tension = this.run.pieceTension(state, shape[i - 1].node, shape[i].node);
      this.stroke(this.tensionColour(tension), 3);
      this.polyline([points[i - 1], points[i]]);
    }
  }

  tensionColour(tension) {
    if (!Number.isFinite(tension)) return this.colours.cable;
    const [low, high] = this.run.tensionRange;
    const share = high > low ? (tension - low) / (high - low) : 0;
    return this.ramp[Math.round(Math.min(1, Math.max(0, share)) * (COLOUR_STEPS - 1))];
  }

  // What is on it

  drawImus(state, view) {
    for (const { place, axes } of this.run.imusAt(state)) {
      const from = view.project(place);
      axes.forEach((axis, k) => {
        if (!axis) return;
        const [right, up] = [dot(axis, view.right), dot(axis, view.up)];
        const to = [from[0] + right * TRIAD_PIXELS, from[1] - up * TRIAD_PIXELS];
        this.stroke(this.colours.surface, 4.5, 0.8);
        this.polyline([from, to]);
        this.stroke(this.colours["tnb"[k]], 2.2);
        this.polyline([from, to]);
      });
    }
  }

  /** Attachments, the farthest first; one at an end is larger, so that its rim shows around the letter. */
  drawBodies(state, shape, view) {
    const ends = [shape[0], shape.at(-1)].filter(Boolean);
    const bodies = this.run.bodiesAt(state);
    bodies.sort((one, other) => dot(one.place, view.toEye) - dot(other.place, view.toEye));
    for (const { kind, place } of bodies) {
      const atEnd = ends.some((end) => distance(end.place, place) < SAME_PLACE);
      this.drawBody(kind, view.project(place), atEnd ? 2 : 1);
    }
  }

  /** Names of attachments and IMUs; an IMU on an attachment shares its label. */
  drawNames(state, view) {
    const marks = this.run.bodiesAt(state);
    for (const imu of this.options.frames ? this.run.imusAt(state) : []) {
      const host = marks.find(({ place }) => distance(place, imu.place) < SAME_PLACE);
      if (host) host.name += ` \u00b7 ${imu.name}`;
      else marks.push({ ...imu, kind: "imu" });
    }
    for (const { place } of marks) this.keepFree(view.project(place));
    for (const { name, place, kind } of marks) {
      this.name(name, view.project(place), kind === "imu" ? this.colours.muted : this.colours.ink);
    }
  }

  keepFree([x, y]) {
    this.taken.push([x - MARK_PIXELS, y - MARK_PIXELS, 2 * MARK_PIXELS, 2 * MARK_PIXELS]);
  }

  drawBody(kind, [x, y], size) {
    const radius = size * (kind === "buoy" ? 7.5 : 6);
    this.pen.beginPath();
    if (kind === "ballast") this.pen.rect(x - radius, y - radius, 2 * radius, 2 * radius);
    else this.pen.arc(x, y, radius, 0, 2 * Math.PI);
    this.fill(this.colours[kind]);
  }

  drawEnds(shape, view) {
    if (shape.length === 0) return;
    for (const [letter, { place }] of [["A", shape[0]], ["B", shape.at(-1)]]) {
      const [x, y] = view.project(place);
      this.keepFree([x, y]);
      this.pen.beginPath();
      this.pen.roundRect(x - 8, y - 8, 16, 16, 3);
      this.fill(this.colours.ink);
      this.pen.fillStyle = this.colours.surface;
      this.pen.font = `600 11px ${this.font}`;
      this.pen.textAlign = "center";
      this.pen.textBaseline = "middle";
      this.pen.fillText(letter, x, y + 0.5);
    }
  }

  // Strokes and letters

  stroke(colour, width, opacity = 1) {
    Object.assign(this.pen, { strokeStyle: colour, lineWidth: width, globalAlpha: opacity });
    Object.assign(this.pen, { lineCap: "round", lineJoin: "round" });
  }

  /** A line in the stroke set before; the next one is opaque again. */
  polyline(points) {
    this.pen.beginPath();
    for (const [x, y] of points) this.pen.lineTo(x, y);
    this.pen.stroke();
    this.pen.globalAlpha = 1;
  }

  fill(colour) {
    this.pen.fillStyle = colour;
    this.pen.fill();
    this.stroke(this.colours.surface, 1.5);
    this.pen.stroke();
  }

  text(words, [x, y], colour, outward) {
    this.pen.font = `12px ${this.font}`;
    this.pen.textAlign = outward[0] > 0.5 ? "left" : outward[0] < -0.5 ? "right" : "center";
    this.pen.textBaseline = "middle";
    this.stroke(this.colours.surface, 3);
    this.pen.strokeText(words, x, y);
    this.pen.fillStyle = colour;
    this.pen.fillText(words, x, y);
  }

  /** A name beside a mark, at the first side that is free; none when no side is. */
  name(words, [x, y], colour) {
    this.pen.font = `12px ${this.font}`;
    const width = this.pen.measureText(words).width;
    const sides = [[14, 0, 0], [-14, 0, -width], [0, -20, -width / 2], [0, 20, -width / 2], [36, -24, 0]];
    for (const [right, down, shift] of sides) {
      const rectangle = [x + right + shift, y + down - LABEL_HEIGHT / 2, width, LABEL_HEIGHT];
      if (this.taken.some((other) => overlap(other, rectangle))) continue;
      this.taken.push(rectangle);
      this.text(words, [x + right + shift, y + down], colour, [1, 0]);
      return;
    }
  }
}

const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
const unit = (k) => AXES.map((_, axis) => (axis === k ? 1 : 0));

/** A place from three [axis, value] pairs in any order. */
function place3(...parts) {
  const place = [0, 0, 0];
  for (const [axis, value] of parts) place[axis] = value;
  return place;
}

function overlap([x, y, width, height], [otherX, otherY, otherWidth, otherHeight]) {
  return x < otherX + otherWidth && otherX < x + width && y < otherY + otherHeight && otherY < y + height;
}

/** The box [low, high] of some places. */
function boxOf(places) {
  const ranges = AXES.map((_, k) => extent(places.map((place) => place[k])));
  return [ranges.map(([low]) => low), ranges.map(([, high]) => high)];
}

/** The box of a whole run, with room around it. */
function runBox(run) {
  const columns = AXES.map((_, k) => extent(everyThird(run.position.values, k)));
  const half = padded(columns.map(([low, high]) => (high - low) / 2));
  const centre = columns.map(([low, high]) => (low + high) / 2);
  return [AXES.map((_, k) => centre[k] - half[k]), AXES.map((_, k) => centre[k] + half[k])];
}

function* everyThird(values, first) {
  for (let i = first; i < values.length; i += 3) yield values[i];
}

/** Half sizes with some room, and none so flat that its walls merge. */
function padded(half) {
  const largest = Math.max(...half, 1e-3);
  return half.map((size) => Math.max(size * 1.06, largest * 0.12));
}

/** Half sizes of the largest single shape. */
function largestReach(run) {
  const reach = [0, 0, 0];
  const step = Math.max(1, Math.floor(run.states / 200));
  for (let state = 0; state < run.states; state += step) {
    const [low, high] = boxOf(run.shape(state).map(({ place }) => place));
    for (let k = 0; k < 3; k += 1) reach[k] = Math.max(reach[k], (high[k] - low[k]) / 2);
  }
  return reach;
}

/** The largest of 1, 2 and 5 times a power of ten up to a length. */
function roundBelow(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return Number((power * [5, 2, 1].find((factor) => factor * power <= length * 1.001)).toPrecision(1));
}

function tickCount(box, k, view) {
  const seen = Math.hypot(dot(unit(k), view.right), dot(unit(k), view.up));
  return Math.min(8, Math.max(1, Math.floor(((box[1][k] - box[0][k]) * seen * view.scale) / 45)));
}

/** Of the edges parallel to axis k the one on the rim that is lowest, for z leftmost, on the screen. */
function rimEdge(box, k, view) {
  const [i, j] = [(k + 1) % 3, (k + 2) % 3];
  const edges = [];
  for (const first of [0, 1]) {
    for (const second of [0, 1]) {
      const facing = (view.toEye[i] > 0) === (first === 1);
      const otherFacing = (view.toEye[j] > 0) === (second === 1);
      if (facing !== otherFacing) edges.push([box[first][i], box[second][j]]);
    }
  }
  const rank = (edge) => {
    const [x, y] = view.project(place3([k, (box[0][k] + box[1][k]) / 2], [i, edge[0]], [j, edge[1]]));
    return k === 2 ? -x : y;
  };
  return edges.sort((one, other) => rank(other) - rank(one))[0];
}

/** Unit vector across a line on the screen, away from a point. */
function awayFrom(point, from, to) {
  const [x, y] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(x, y) || 1;
  const across = [-y / length, x / length];
  const middle = [(from[0] + to[0]) / 2 - point[0], (from[1] + to[1]) / 2 - point[1]];
  return across[0] * middle[0] + across[1] * middle[1] >= 0 ? across : across.map((value) => -value);
}

/** Colours between the given ones (#rrggbb). */
function rampColours(stops) {
  const parsed = stops.map((stop) => [1, 3, 5].map((at) => parseInt(stop.slice(at, at + 2), 16)));
  return Array.from({ length: COLOUR_STEPS }, (_, step) => {
    const share = (step / (COLOUR_STEPS - 1)) * (parsed.length - 1);
    const below = Math.min(Math.floor(share), parsed.length - 2);
    const mix = parsed[below].map((value, k) => value + (parsed[below + 1][k] - value) * (share - below));
    return `rgb(${mix.map(Math.round).join(" ")})`;
  });
}
