const DEGREE = Math.PI / 180;
const VIEWS = {
  oblique: { azimuth: -60, elevation: 20 },
  side: { azimuth: -90, elevation: 0 },
  front: { azimuth: 0, elevation: 0 },
  top: { azimuth: -90, elevation: 90 },
};

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Looks at the scene from afar, without perspective, so that one scale holds everywhere. */
class Camera {
  constructor() {
    this.size = [1, 1];
    this.margin = 50;
    this.look(VIEWS.oblique);
  }

  /** Turn to a direction [degrees] and show everything. */
  look({ azimuth, elevation }) {
    this.azimuth = azimuth;
    this.elevation = elevation;
    this.zoom = 1;
    this.shift = [0, 0];
    this.fitted = null;
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.min(90, Math.max(-90, this.elevation + elevation));
  }

  magnify(factor) {
    this.zoom = Math.min(50, Math.max(0.2, this.zoom * factor));
  }

  move(x, y) {
    this.shift = [this.shift[0] + x, this.shift[1] + y];
  }

  /** Show the scene anew at its natural size, as after a change of the canvas. */
  resize(width, height) {
    this.size = [width, height];
    this.fitted = null;
  }

  /** How a box [low, high] is seen: directions on the screen, scale [pixels/m], projection. */
  view(box) {
    const [a, e] = [this.azimuth * DEGREE, this.elevation * DEGREE];
    const right = [-Math.sin(a), Math.cos(a), 0];
    const up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
    const toEye = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    // turning keeps the scale of the last fit: a scene that breathes while it is turned is hard to read
    this.fitted ??= this.fit(box, right, up);
    const scale = this.fitted * this.zoom;
    const centre = [0, 1, 2].map((k) => (box[0][k] + box[1][k]) / 2);
    const [x, y] = [dot(centre, right), dot(centre, up)];
    const [left, top] = [this.size[0] / 2 + this.shift[0], this.size[1] / 2 + this.shift[1]];
    const project = (place) => [left + (dot(place, right) - x) * scale, top - (dot(place, up) - y) * scale];
    return { right, up, toEye, scale, project };
  }

  fit(box, right, up) {
    const half = [0, 1, 2].map((k) => (box[1][k] - box[0][k]) / 2);
    const reach = (axis) => dot(half, axis.map(Math.abs));
    const room = this.size.map((pixels) => Math.max(pixels / 2 - this.margin, 20));
    return Math.min(room[0] / Math.max(reach(right), 1e-9), room[1] / Math.max(reach(up), 1e-9));
  }
}
