// The struct `Frame` from matrices, as docs/shaders.md tells a host to fill it. JavaScript's numbers are doubles: the
// differences are taken in them and rounded at the end.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, k) => a.map((v) => v * k);
const sum = (a, ka, b, kb) => a.map((v, i) => v * ka + b[i] * kb);

/** A perspective camera for images of [width, height]: clip_from_world, column-major. */
class View {
  constructor(m, [width, height]) {
    const row = (r) => [m[r], m[4 + r], m[8 + r], m[12 + r]];
    const [x, y, w] = [row(0), row(1), row(3)];
    // Homogeneous pixel coordinate (u, v, w) of a point X: factors . X + constant.
    const u = sum(x, width / 2, w, width / 2);
    const v = sum(w, height / 2, y, -height / 2);
    this.rows = { u, v, w };
    // Columns of the inverse of the matrix whose rows are the factors of u, v, w.
    const columns = [cross(v, w), cross(w, u), cross(u, v)];
    const [c1, c2, c3] = columns.map((c) => scaled(c, 1 / dot(w, columns[2])));
    this.eye = [0, 1, 2].map((i) => Math.fround(-(c1[i] * u[3] + c2[i] * v[3] + c3[i] * w[3])));
    const length = Math.hypot(w[0], w[1], w[2]);
    this.direction = [c3, c1, c2].map((c) => scaled(c, length));
    this.forward = scaled(w.slice(0, 3), 1 / length);
    const focal = sum(v, 1, w, -height / 2);
    this.focalPx = Math.hypot(focal[0], focal[1], focal[2]) / length;
  }

  /** As a frame with this eye is told it. */
  told(eye) {
    const row = (r) => [r[0], r[1], r[2], dot(r, this.eye) + r[3]];
    return {
      origin: [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
      direction: this.direction,
      u: row(this.rows.u),
      v: row(this.rows.v),
      w: row(this.rows.w),
      forward: this.forward,
      focal_px: this.focalPx,
      eye: this.eye.map((value, i) => value - eye[i]),
      perspective: 1,
    };
  }
}

/**
 * The members of `Frame`. Cameras are { clip_from_world: 16 numbers, jitter: [x, y] }.
 * @param frame   { camera, previous_camera, has_glossy_hit, has_roughness }
 * @param before  the frame before, or null where this one starts afresh
 * @param extent  [width, height]
 */
export function told(frame, before, extent) {
  const now = new View(frame.camera.clip_from_world, extent);
  const history = before ? 1 : 0;
  const beforeCamera = (before ?? frame).camera;
  return {
    view: now.told(now.eye),
    previous_view: new View(frame.previous_camera.clip_from_world, extent).told(now.eye),
    before_view: new View(beforeCamera.clip_from_world, extent).told(now.eye),
    jitter: frame.camera.jitter,
    before_jitter: beforeCamera.jitter,
    size: extent,
    before_size: extent,
    to_before: [1, 1],
    // No tile of a larger picture.
    origin: [0, 0],
    whole: extent,
    matte_history: history,
    glossy_history: history,
    direct_history: history,
    has_glossy_hit: frame.has_glossy_hit ? 1 : 0,
    has_roughness: frame.has_roughness ? 1 : 0,
  };
}

const unit = (a) => scaled(a, 1 / Math.sqrt(dot(a, a)));

/**
 * The members of `Prepare` that a frame tells, for vectors without jitter, and a device depth (if any) whose far end is 0.
 * `there`, which textures there are, is the denoiser's to tell.
 */
export function prepared(frame, extent) {
  const m = frame.camera.clip_from_world;
  const row = (r) => [m[r], m[4 + r], m[8 + r]];
  const forward = unit(row(3));
  const [right, up] = [0, 1].map((r) => unit(sum(row(r), 1, forward, -dot(row(r), forward))));
  const z = row(2);
  const { eye } = new View(m, extent);
  return { device_z: [...z, dot(z, eye) + m[14]], right, up, device_far: 0, motion_shift: [0, 0] };
}
