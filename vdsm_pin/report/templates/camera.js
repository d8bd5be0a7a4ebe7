// Where the scene is seen from: in perspective, from the tip, or truly from one side.
"use strict";

const SIDES = {
  overview: [-0.62, -1.0, 0.5],
  side: [0, -1, 0],
  top: [0, -1e-6, 1], // a camera that looks straight down has no up
  front: [1, 0, 0],
};
const FIELD = 36; // degrees
const FIELD_AT_TIP = 70;
const FLIGHT = 700; // milliseconds
const ROOM = 1.06; // around what has to fit
const TURNS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const TURN = Math.PI / 24; // by one key
const NEARER = { "+": 0.9, "=": 0.9, "-": 1 / 0.9 };

class Cameras {
  constructor(view) {
    const { PerspectiveCamera, OrthographicCamera } = MeshCat.THREE;
    this.view = view;
    this.viewer = view.viewer;
    this.perspective = new PerspectiveCamera(FIELD, 1, 0.004, 400);
    this.flat = new OrthographicCamera(-1, 1, 1, -1, 0.004, 400);
    this.half = [1, 1]; // what the flat camera has to show, half of it
    this.name = "overview";
    this.use(this.perspective);
  }

  get camera() {
    return this.viewer.camera;
  }

  get target() {
    return this.viewer.controls.target;
  }

  use(camera) {
    if (this.camera === camera) return;
    this.viewer.controls.dispose();
    this.viewer.set_camera(camera);
    this.viewer.controls.addEventListener("start", () => (this.flying = null));
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.view.pane;
    if (!width || !height) return;
    const aspect = width / height;
    this.perspective.aspect = aspect;
    const up = Math.max(this.half[1], this.half[0] / aspect);
    [this.flat.left, this.flat.right] = [-up * aspect, up * aspect];
    [this.flat.bottom, this.flat.top] = [-up, up];
    this.camera.updateProjectionMatrix();
  }

  // Overview, side, top, front, or tip.
  look(name) {
    this.name = name;
    this.flying = null;
    this.view.hideEnd(name === "tip");
    this.perspective.fov = name === "tip" ? FIELD_AT_TIP : FIELD;
    this.use(name === "tip" || name === "overview" ? this.perspective : this.flat);
    this.viewer.controls.enabled = name !== "tip";
    if (name === "tip") this.fromTip();
    else this.fit(SIDES[name]);
  }

  // All that has to be seen from one direction, as large as it can be.
  fit(direction) {
    const { Vector3 } = MeshCat.THREE;
    const { root, room, spots } = this.view;
    const away = new Vector3(...direction).transformDirection(root.matrixWorld);
    const across = new Vector3(0, 1, 0).cross(away).normalize();
    const up = away.clone().cross(across);
    const corners = spots.map((p) => root.localToWorld(p.clone()));
    const [middle, half] = [new Vector3(), []];
    for (const axis of [across, up, away]) {
      let [low, high] = [Infinity, -Infinity];
      for (const p of corners) {
        const at = p.dot(axis);
        if (at < low) low = at;
        if (at > high) high = at;
      }
      middle.addScaledVector(axis, (low + high) / 2);
      half.push(ROOM * ((high - low) / 2 + room));
    }
    this.half = half.slice(0, 2);
    this.flat.zoom = 1;
    this.resize();
    const slope = Math.tan((FIELD * Math.PI) / 360);
    let distance = 2 * half[2];
    for (const p of corners) {
      const [x, y, z] = [across, up, away].map((axis) => p.dot(axis) - middle.dot(axis));
      const wide = Math.max((Math.abs(y) + room) / slope,
        (Math.abs(x) + room) / (slope * this.perspective.aspect));
      distance = Math.max(distance, z + room + ROOM * wide);
    }
    this.put(middle.clone().addScaledVector(away, distance), middle);
  }

  // Turn or come nearer by one key; whether it was such a key.
  press(key) {
    if (!(key in TURNS || key in NEARER) || !this.viewer.controls.enabled) return false;
    this.flying = null;
    const { Spherical } = MeshCat.THREE;
    const away = new Spherical().setFromVector3(this.camera.position.clone().sub(this.target));
    const [across, down] = TURNS[key] || [0, 0];
    away.theta += across * TURN;
    away.phi += down * TURN;
    away.makeSafe();
    if (this.camera === this.flat) this.flat.zoom /= NEARER[key] || 1;
    else away.radius *= NEARER[key] || 1;
    this.camera.updateProjectionMatrix();
    this.put(this.target.clone().add(this.target.clone().setFromSpherical(away)), this.target);
    return true;
  }

  put(place, target) {
    this.camera.position.copy(place);
    this.target.copy(target);
    this.viewer.controls.update();
    this.viewer.set_dirty();
  }

  // Look ahead from where the tip is; the picture follows it.
  fromTip() {
    const { Vector3 } = MeshCat.THREE;
    const [joint, tip] = this.view.centres.slice(-2).map((p) =>
      this.view.root.localToWorld(new Vector3(...p)));
    const ahead = tip.clone().sub(joint).normalize();
    this.put(tip, tip.clone().add(ahead));
  }

  // Fly to where the stretch from a to b is seen across, `width` metres around it.
  flyTo(a, b, width) {
    const { Vector3 } = MeshCat.THREE;
    if (this.name === "tip") this.look("overview");
    this.use(this.perspective);
    this.name = "overview";
    const target = a.clone().add(b).multiplyScalar(0.5);
    const gap = b.clone().sub(a);
    const away = this.camera.position.clone().sub(this.target);
    if (gap.lengthSq() > 0) away.addScaledVector(gap, -away.dot(gap) / gap.lengthSq());
    if (away.lengthSq() < 1e-12) away.copy(new Vector3(1, 0, 0).cross(gap));
    const distance = width / (2 * Math.tan((FIELD * Math.PI) / 360));
    const place = target.clone().addScaledVector(away.normalize(), distance);
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (still) this.put(place, target);
    else this.fly(place, target);
  }

  fly(place, target) {
    const from = [this.camera.position.clone(), this.target.clone()];
    const begin = performance.now();
    const flight = (this.flying = {});
    const step = (now) => {
      if (this.flying !== flight) return;
      const t = Math.min(1, Math.max(0, (now - begin) / FLIGHT));
      const share = t * t * (3 - 2 * t);
      this.put(from[0].clone().lerp(place, share), from[1].clone().lerp(target, share));
      if (t < 1) requestAnimationFrame(step);
      else this.flying = null;
    };
    requestAnimationFrame(step);
  }

  // Metres that one pixel shows at the target.
  get scale() {
    const height = this.view.pane.clientHeight || 1;
    if (this.camera === this.flat)
      return (this.flat.top - this.flat.bottom) / (this.flat.zoom * height);
    const distance = this.camera.position.distanceTo(this.target);
    return (2 * distance * Math.tan((this.perspective.fov * Math.PI) / 360)) / height;
  }

  // All there is to know to look from here again.
  eye() {
    const { name, half, flat } = this;
    const [place, target] = [this.camera.position.toArray(), this.target.toArray()];
    return { name, half, zoom: flat.zoom, place, target };
  }

  lookFrom({ name, half, zoom, place, target }) {
    this.look(name);
    [this.half, this.flat.zoom] = [half, zoom];
    this.resize();
    const { Vector3 } = MeshCat.THREE;
    if (name !== "tip") this.put(new Vector3(...place), new Vector3(...target));
  }
}

function boxCorners(box) {
  const { Vector3 } = MeshCat.THREE;
  const ends = [box.min, box.max];
  const found = [];
  for (let k = 0; k < 8; k++)
    found.push(new Vector3(ends[k & 1].x, ends[(k >> 1) & 1].y, ends[k >> 2].z));
  return found;
}
