/** A list of numbers with its shape, from base64 of little-endian 32-bit floats. */
function decode({ shape, data }) {
  const letters = atob(data);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i += 1) bytes[i] = letters.charCodeAt(i);
  return { shape, values: new Float32Array(bytes.buffer) };
}

/** The run as the page carries it; places are [x, y, z] in metres, z up. */
class Run {
  constructor(text) {
    const data = JSON.parse(text);
    this.time = decode(data.time).values;
    this.states = this.time.length;
    this.position = decode(data.position);
    this.nodes = this.position.shape[1];
    this.s = decode(data.s).values;
    this.outlet = decode(data.outlet).values;
    this.bodies = data.bodies;
    this.bodyPosition = data.bodyPosition ? decode(data.bodyPosition) : null;
    this.imus = data.imus;
    this.imuPosition = decode(data.imuPosition);
    this.imuAxes = decode(data.imuAxes);
    this.tension = data.tension ? decode(data.tension) : null;
    this.tensionRange = data.tensionRange;
    this.seriesTime = decode(data.seriesTime).values;
    this.panels = data.panels.map(decodePanel);
    this.profile = decodePanel(data.profile);
    this.profileS = data.profileS ? decode(data.profileS).values : [];
  }

  /** The nodes of a state that are in the water: their numbers and places. */
  shape(state) {
    const shape = [];
    for (let node = 0; node < this.nodes; node += 1) {
      const place = placeAt(this.position, state * this.nodes + node);
      if (place) shape.push({ node, place });
    }
    return shape;
  }

  /** Tension of the piece of cable that ends at a node; on a winch the last piece ends at the outlet. */
  pieceTension(state, before, after) {
    if (!this.tension) return NaN;
    const pieces = this.nodes - 1;
    return this.tension.values[state * pieces + (after === this.nodes - 1 ? pieces - 1 : before)];
  }

  /** Material coordinate of a node; the last one is the outlet. */
  coordinate(state, node) {
    return node === this.nodes - 1 ? this.outlet[state] : this.s[node];
  }

  /** Attachments of a state that are in the water. */
  bodiesAt(state) {
    if (!this.bodyPosition) return [];
    return this.bodies
      .map((body, i) => ({ ...body, place: placeAt(this.bodyPosition, state * this.bodies.length + i) }))
      .filter((body) => body.place);
  }

  /** IMUs of a state that are in the water, with tangent, normal and binormal of the cable. */
  imusAt(state) {
    const count = this.imus.length;
    return this.imus
      .map((name, i) => ({
        name,
        place: placeAt(this.imuPosition, state * count + i),
        axes: [0, 1, 2].map((axis) => placeAt(this.imuAxes, (state * count + i) * 3 + axis)),
      }))
      .filter((imu) => imu.place);
  }

  /** State nearest to a time [s]. */
  stateAt(time) {
    return nearest(this.time, time);
  }
}

function decodePanel({ title, unit, lines, band, note }) {
  return {
    title,
    unit,
    note,
    lines: lines.map(({ label, values }) => ({ label, values: decode(values).values })),
    band: band.map((bound) => decode(bound).values),
  };
}

/** Three numbers of an array, or null where there is no place. */
function placeAt({ values }, index) {
  const place = [values[3 * index], values[3 * index + 1], values[3 * index + 2]];
  return place.every(Number.isFinite) ? place : null;
}

/** Index of the value in a rising list that is nearest to `wanted`. */
function nearest(rising, wanted) {
  const after = firstAbove(rising, wanted);
  if (after === 0) return 0;
  if (after === rising.length) return rising.length - 1;
  return wanted - rising[after - 1] <= rising[after] - wanted ? after - 1 : after;
}

/** Index of the first value of a rising list above `wanted`. */
function firstAbove(rising, wanted) {
  let [low, high] = [0, rising.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rising[middle] > wanted) high = middle;
    else low = middle + 1;
  }
  return low;
}

/** Smallest and largest finite number of some lists; [0, 1] when there is none. */
function extent(...lists) {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists) {
    for (const value of list) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 1];
}

/** Round numbers within a range, some `count` of them. */
function ticks([low, high], count) {
  const raw = (high - low) / Math.max(count, 1);
  if (!(raw > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

/** A number with four digits for people. */
function readable(number) {
  if (!Number.isFinite(number)) return "\u2013";
  const small = number !== 0 && Math.abs(number) < 1e-3;
  const digits = small ? number.toExponential(2) : String(Number(number.toPrecision(4)));
  return digits.replaceAll("-", "\u2212");
}
