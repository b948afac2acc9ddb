const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];
const LONGEST_SHOW = 30; // seconds that a run takes to play, unless its user chooses otherwise

const find = (id) => document.getElementById(id);

/** Binds the run, its pictures and the controls. */
class Viewer {
  constructor(run) {
    this.run = run;
    this.camera = new Camera();
    this.camera.look(this.oblique());
    this.scene = new Scene(find("scene"), run, this.camera);
    this.player = new Player(run.time, () => this.show());
    this.decimals = timeDecimals(run.time);
    this.addPlots();
    this.addControls();
    this.addOrbit();
    this.addKeys();
    this.describeLegend();
    this.followSurroundings();
  }

  /** Obliquely, across the longer side of the motion. */
  oblique() {
    const [x, y] = [0, 1].map((k) => extent(everyThird(this.run.position.values, k)));
    return x[1] - x[0] >= y[1] - y[0] ? VIEWS.oblique : { ...VIEWS.oblique, azimuth: -30 };
  }

  // Plots

  addPlots() {
    const { run } = this;
    const single = run.states === 1;
    run.profile.lines.push({ label: "at this time", values: [] });
    this.profile = new Plot(find("more"), run.profile, {
      x: run.profileS,
      xName: "s, from A to B [m]",
      label: "Tension along the cable at the time shown, and its range in the whole run",
      cursor: false,
    });
    this.timePlots = single ? [] : run.panels.map((panel, i) => this.timePlot(panel, i));
    if (single) find("series").append(element("p", "A single state: nothing changes with time.", "note"));
  }

  timePlot(panel, i) {
    const host = i < this.run.panels.length - 1 ? find("series") : find("more");
    const options = { x: this.run.seriesTime, xName: "time [s]", label: `${panel.title} against time` };
    const plot = new Plot(host, panel, options);
    if (!plot.empty) plot.onSeek((time) => this.player.seek(this.run.stateAt(time)));
    return plot;
  }

  // Controls

  addControls() {
    const { run, player } = this;
    find("slider").max = run.states - 1;
    find("slider").addEventListener("input", (event) => player.seek(Number(event.target.value)));
    find("play").addEventListener("click", () => player.toggle());
    find("back").addEventListener("click", () => player.seek(player.state - 1));
    find("forward").addEventListener("click", () => player.seek(player.state + 1));
    const controls = ["slider", "play", "back", "forward", "speed"].map(find);
    for (const control of controls) control.disabled = run.states < 2;
    this.addSpeeds();
    this.addViews();
    this.addOptions();
  }

  addSpeeds() {
    const select = find("speed");
    for (const speed of SPEEDS) select.add(new Option(`${speed}\u00d7`, speed));
    const wanted = (this.run.time.at(-1) - this.run.time[0]) / LONGEST_SHOW;
    this.player.speed = SPEEDS.find((speed) => speed >= Math.max(1, wanted)) ?? SPEEDS.at(-1);
    select.value = this.player.speed;
    select.addEventListener("change", () => {
      this.player.speed = Number(select.value);
    });
  }

  addViews() {
    for (const button of document.querySelectorAll("[data-view]")) {
      const { view } = button.dataset;
      button.addEventListener("click", () => this.look(view === "oblique" ? this.oblique() : VIEWS[view]));
    }
    find("closer").addEventListener("click", () => this.magnify(1.25));
    find("farther").addEventListener("click", () => this.magnify(0.8));
  }

  addOptions() {
    this.scene.options.follow = this.scene.travels;
    for (const box of document.querySelectorAll("[data-option]")) {
      const { option } = box.dataset;
      box.checked = this.scene.options[option];
      box.addEventListener("change", () => {
        this.scene.options[option] = box.checked;
        this.camera.fitted = null;
        this.show();
      });
    }
    find("frames-option").hidden = this.run.imus.length === 0;
  }

  look(direction) {
    this.camera.look(direction);
    this.show();
  }

  magnify(factor) {
    this.camera.magnify(factor);
    this.show();
  }

  /** Turn by dragging, move with shift, zoom with the wheel once the picture has the focus. */
  addOrbit() {
    const { canvas } = this.scene;
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      if (event.shiftKey) this.camera.move(event.movementX, event.movementY);
      else this.camera.turn(-0.4 * event.movementX, 0.4 * event.movementY);
      this.show();
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (document.activeElement !== canvas) return; // the page must not stop scrolling under the pointer
        event.preventDefault();
        this.magnify(Math.exp(-0.0015 * event.deltaY));
      },
      { passive: false },
    );
  }

  // Keys

  addKeys() {
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || this.ownsKey(event)) return;
      const action = event.shiftKey ? this.turnKeys()[event.key] : this.playKeys()[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }

  /** Whether the control in focus does something with a key itself. */
  ownsKey({ target, key }) {
    if (key === " ") return target.matches("button, input[type=checkbox], select, summary");
    return target.matches("input[type=range], select");
  }

  playKeys() {
    const { player } = this;
    const jump = Math.max(1, Math.round(this.run.states / 20));
    return {
      " ": () => player.toggle(),
      ArrowLeft: () => player.seek(player.state - 1),
      ArrowRight: () => player.seek(player.state + 1),
      PageUp: () => player.seek(player.state - jump),
      PageDown: () => player.seek(player.state + jump),
      "+": () => this.magnify(1.25),
      "-": () => this.magnify(0.8),
    };
  }

  turnKeys() {
    const turn = (azimuth, elevation) => () => {
      this.camera.turn(azimuth, elevation);
      this.show();
    };
    return {
      ArrowLeft: turn(-5, 0),
      ArrowRight: turn(5, 0),
      ArrowUp: turn(0, 5),
      ArrowDown: turn(0, -5),
      "+": () => this.magnify(1.25),
    };
  }

  // Surroundings

  describeLegend() {
    const { tensionRange, imus, bodies } = this.run;
    find("tension-legend").hidden = !tensionRange;
    find("imu-legend").hidden = imus.length === 0;
    for (const item of document.querySelectorAll("[data-kind]")) {
      item.hidden = !bodies.some((body) => body.kind === item.dataset.kind);
    }
    if (!tensionRange) return;
    const [least, most] = rounded(tensionRange);
    find("least").textContent = readable(least);
    find("most").textContent = `${readable(most)} N`;
  }

  followSurroundings() {
    const plots = [...this.timePlots, this.profile];
    const watcher = new ResizeObserver((changes) => {
      for (const { target } of changes) plots.find(({ paper }) => paper === target)?.render();
      if (changes.some(({ target }) => target === this.scene.canvas)) this.scene.resize();
      this.show();
    });
    for (const sized of [this.scene.canvas, ...plots.map(({ paper }) => paper)]) watcher.observe(sized);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.scene.readColours();
      this.show();
    });
  }

  // The state shown

  show() {
    const { run, player } = this;
    const time = run.time[player.state];
    this.scene.draw(player.state);
    const index = nearest(run.seriesTime, time);
    for (const plot of this.timePlots) plot.setCursor(index);
    this.showProfile(player.state);
    find("slider").value = player.state;
    const words = `${time.toFixed(this.decimals)} s`;
    find("slider").setAttribute("aria-valuetext", words);
    find("clock").textContent = words;
    find("play").dataset.playing = player.playing;
    find("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
  }

  showProfile(state) {
    if (this.profile.empty) return;
    const nodes = this.run.shape(state).map(({ node }) => node);
    const pieces = nodes.slice(1).map((after, i) => this.run.pieceTension(state, nodes[i], after));
    this.profile.setLine(pieceCoordinates(this.run, state, nodes), pieces);
  }
}

/** A range without digits that do not count in it. */
function rounded([low, high]) {
  const step = 10 ** Math.floor(Math.log10(Math.max(high - low, Math.abs(high) * 1e-3, 1e-12) / 100));
  return [low, high].map((value) => Number((Math.round(value / step) * step).toPrecision(4)));
}

/** Decimals that tell neighbouring times apart. */
function timeDecimals(times) {
  const step = times.length > 1 ? (times.at(-1) - times[0]) / (times.length - 1) : 1;
  return Math.min(4, Math.max(1, Math.ceil(-Math.log10(step) - 1e-6)));
}

/** Material coordinates of the middles of the pieces between nodes. */
function pieceCoordinates(run, state, nodes) {
  return nodes
    .slice(1)
    .map((after, i) => (run.coordinate(state, nodes[i]) + run.coordinate(state, after)) / 2);
}

new Viewer(new Run(find("run").textContent));
