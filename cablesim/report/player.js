/** Moves through the states of a run in time with the clock. */
class Player {
  constructor(times, onChange) {
    this.times = times;
    this.onChange = onChange;
    this.state = 0;
    this.speed = 1;
    this.playing = false;
  }

  get atEnd() {
    return this.state === this.times.length - 1;
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.times.length < 2) return;
    this.playing = true;
    this.before = performance.now();
    this.seek(this.atEnd ? 0 : this.state);
    this.awaitFrame();
  }

  pause() {
    this.playing = false;
    cancelAnimationFrame(this.frame);
    this.onChange();
  }

  /** Show a state and go on from there. */
  seek(state) {
    this.state = Math.min(this.times.length - 1, Math.max(0, state));
    this.time = this.times[this.state];
    this.onChange();
  }

  awaitFrame() {
    this.frame = requestAnimationFrame((now) => this.advance(now));
  }

  advance(now) {
    this.time += (Math.max(0, now - this.before) / 1000) * this.speed;
    this.before = now;
    // only states of the result are shown, none in between
    this.state = Math.max(0, firstAbove(this.times, this.time) - 1);
    if (this.atEnd) this.playing = false;
    else this.awaitFrame();
    this.onChange();
  }
}
