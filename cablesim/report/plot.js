const FRAME = { left: 54, right: 14, top: 8, bottom: 36 };
const PIXELS_PER_TICK = { x: 90, y: 42 };

/** Lines on a pair of axes (SVG), with a cursor; its lines may change. */
class Plot {
  /** `panel` has title, unit, lines of {label, values}, a band of none or two lists, and a note. */
  constructor(host, panel, { x, xName, label, cursor = true }) {
    this.panel = panel;
    this.hasCursor = cursor;
    this.x = x;
    this.xName = xName;
    this.figure = host.appendChild(document.createElement("figure"));
    this.figure.className = "plot";
    this.addCaption();
    this.paper = this.figure.appendChild(element("div", "", "paper"));
    this.svg = this.paper.appendChild(svgElement("svg", { role: "img", "aria-label": label }));
    if (panel.note) this.paper.replaceChildren(element("p", panel.note, "note"));
  }

  get empty() {
    return Boolean(this.panel.note);
  }

  addCaption() {
    const caption = this.figure.appendChild(document.createElement("figcaption"));
    caption.append(element("h3", `${this.panel.title} [${this.panel.unit}]`));
    const legend = caption.appendChild(document.createElement("ul"));
    this.readings = this.panel.lines.map(({ label }, i) => {
      const item = legend.appendChild(element("li", `${label} `, `key line-${i % 8}`));
      return this.hasCursor ? item.appendChild(element("output", "")) : item;
    });
    if (this.panel.band.length) legend.append(element("li", "smallest to largest", "key band"));
  }

  /** Draw all anew, as large as there is room. */
  render() {
    if (this.empty) return;
    this.width = Math.max(this.paper.clientWidth, 160);
    this.bottom = Math.max(this.paper.clientHeight, 80) - FRAME.bottom;
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.bottom + FRAME.bottom}`);
    this.setRanges();
    this.svg.replaceChildren(...this.grid(), ...this.bandPath(), ...this.paths(), ...this.marks());
  }

  setRanges() {
    const values = this.panel.lines.map((line) => line.values);
    this.xRange = extent(this.x);
    this.yRange = roomy(extent(...values, ...this.panel.band));
    this.toX = linear(this.xRange, [FRAME.left, this.width - FRAME.right]);
    this.toY = linear(this.yRange, [this.bottom, FRAME.top]);
  }

  grid() {
    const [left, right] = [FRAME.left, this.width - FRAME.right];
    const { bottom } = this;
    const parts = [];
    for (const value of ticks(this.yRange, Math.max(2, bottom / PIXELS_PER_TICK.y))) {
      const y = this.toY(value);
      parts.push(svgElement("line", { class: "grid", x1: left, x2: right, y1: y, y2: y }));
      parts.push(svgText(readable(value), { x: left - 6, y: y + 4, class: "number end" }));
    }
    for (const value of ticks(this.xRange, Math.max(2, (right - left) / PIXELS_PER_TICK.x))) {
      const x = this.toX(value);
      parts.push(svgElement("line", { class: "grid", x1: x, x2: x, y1: FRAME.top, y2: bottom }));
      parts.push(svgText(readable(value), { x, y: bottom + 14, class: "number" }));
    }
    parts.push(svgText(this.xName, { x: (left + right) / 2, y: bottom + 30, class: "name" }));
    return parts;
  }

  bandPath() {
    if (!this.panel.band.length) return [];
    const [low, high] = this.panel.band.map((values) => this.points(this.x, values));
    const around = [...low, ...high.reverse()].filter(Boolean);
    return [svgElement("path", { class: "band", d: pathOf(around) })];
  }

  paths() {
    this.lines = this.panel.lines.map(({ values }, i) =>
      svgElement("path", { class: `line line-${i % 8}`, d: pathOf(this.points(this.x, values)) }),
    );
    return this.lines;
  }

  marks() {
    if (!this.hasCursor) return [];
    this.cursor = svgElement("line", { class: "cursor", y1: FRAME.top, y2: this.bottom });
    this.dots = this.panel.lines.map((_, i) => svgElement("circle", { class: `dot line-${i % 8}`, r: 3.5 }));
    return [this.cursor, ...this.dots];
  }

  /** Points on the paper; null where a line has a gap. */
  points(xs, values) {
    const kept = thinned(xs, values, this.toX);
    return kept.map((i) => (Number.isFinite(values[i]) ? [this.toX(xs[i]), this.toY(values[i])] : null));
  }

  /** Put the cursor at the index-th value, and read the lines there. */
  setCursor(index) {
    if (this.empty || !this.hasCursor) return;
    const x = this.toX(this.x[index]);
    setAttributes(this.cursor, { x1: x, x2: x });
    this.panel.lines.forEach(({ values }, i) => {
      const there = Number.isFinite(values[index]);
      this.readings[i].textContent = readable(values[index]);
      setAttributes(this.dots[i], { cx: x, cy: there ? this.toY(values[index]) : 0 });
      this.dots[i].classList.toggle("gone", !there);
    });
  }

  /** Give the first line other values, at places of their own; the axes stay. */
  setLine(xs, values) {
    if (!this.empty) this.lines[0].setAttribute("d", pathOf(this.points(xs, values)));
  }

  /** Call back with the x under the pointer, while it is pressed. */
  onSeek(seek) {
    const report = (event) => {
      const box = this.svg.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width) * this.width - FRAME.left;
      const whole = this.width - FRAME.left - FRAME.right;
      seek(this.xRange[0] + (share / whole) * (this.xRange[1] - this.xRange[0]));
    };
    this.svg.classList.add("seekable");
    this.svg.addEventListener("pointerdown", (event) => {
      this.svg.setPointerCapture(event.pointerId);
      report(event);
    });
    this.svg.addEventListener("pointermove", (event) => event.buttons && report(event));
  }
}

/** Indices of a line's points: where several share a column of pixels only its extremes. */
function thinned(xs, values, toX) {
  const kept = [];
  for (let start = 0; start < xs.length; ) {
    const column = Math.round(toX(xs[start]));
    let [low, high, end] = [start, start, start];
    for (; end < xs.length && Math.round(toX(xs[end])) === column; end += 1) {
      if (values[end] < values[low] || Number.isNaN(values[low])) low = end;
      if (values[end] > values[high] || Number.isNaN(values[high])) high = end;
    }
    kept.push(...new Set([Math.min(low, high), Math.max(low, high)]));
    start = end;
  }
  return kept;
}

/** SVG path through points, interrupted at nulls. */
function pathOf(points) {
  let pen = "M";
  let path = "";
  for (const point of points) {
    if (point) path += `${pen}${point[0].toFixed(1)} ${point[1].toFixed(1)}`;
    pen = point ? "L" : "M";
  }
  return path;
}

/** A range with some room; a constant is shown in the middle. */
function roomy([low, high]) {
  const span = high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)) ? high - low : Math.abs(high) || 1;
  return [low - 0.06 * span, high + 0.06 * span];
}

function linear([low, high], [from, to]) {
  const factor = high > low ? (to - from) / (high - low) : 0;
  return (value) => from + (value - low) * factor;
}

function element(name, words, className = "") {
  return Object.assign(document.createElement(name), { textContent: words, className });
}

function svgElement(name, attributes) {
  // the page has a drawing already, which spares naming the namespace
  const created = document.createElementNS(document.querySelector("svg").namespaceURI, name);
  setAttributes(created, attributes);
  return created;
}

function svgText(words, attributes) {
  const created = svgElement("text", attributes);
  created.textContent = words;
  return created;
}

function setAttributes(target, attributes) {
  for (const [name, value] of Object.entries(attributes)) target.setAttribute(name, value);
}
