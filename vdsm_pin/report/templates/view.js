// The scene in 3D, drawn by Meshcat's viewer and the three.js that it carries.
"use strict";

const CREASE = 32; // degrees between two faces from which on their edge is drawn
const GLASS = 0.42; // how opaque an obstacle is that is seen through
const GHOST = 0.5; // and an arm with errors
const GREY = 0x8a94a6;
const MARKED = { short: 0xe03131, kept: 0x2f8ae5 }; // the two that come near each other
const WHOLE = 1.6; // times the motion's size: what is larger is not shown whole
const WIDE = 2.2; // the same of what moves
const SEEN_AT = 32; // moments at which what moves has to fit, but one
const DUE = 1.5; // waypoints around its moment during which a gap is shown

class ArmView {
  constructor(pane, scene, motion) {
    this.pane = pane;
    this.motion = motion;
    this.scene = scene;
    this.three = MeshCat.THREE;
    this.viewer = new MeshCat.Viewer(pane);
    this.viewer.set_3d_pane_size = () => this.resize();
    this.viewer.gui.domElement.remove();
    this.viewer.renderer.localClippingEnabled = true;
    for (const path of [["Grid"], ["Axes"], ["Lights"]])
      this.viewer.set_property(path, "visible", false);
    this.viewer.hide_background();

    const { Group, Matrix4, Box3 } = this.three;
    this.root = new Group();
    this.root.matrixAutoUpdate = false;
    this.root.matrix = new Matrix4().set(...scene.pose);
    this.viewer.scene.add(this.root);
    this.spots = []; // what has to be seen, in the base frame, but for some room around
    this.room = scene.links ? 0 : scene.radius;
    this.arm = this.body();
    this.root.add(this.arm.group);
    this.addPaths();
    this.box = new Box3().setFromPoints(this.spots).expandByScalar(this.room);
    this.addGhosts();
    this.addObstacles();
    this.addFloor();
    for (const pin of scene.pins || []) this.addPin(pin);
    this.addLights();
    this.cameras = new Cameras(this);
    this.overlay = new Overlay(this);
    this.section = new Section(this);
    const render = this.viewer.render.bind(this.viewer);
    this.viewer.render = () => {
      render();
      this.overlay.draw();
    };
    motion.listen((time) => this.pose(time));
    this.resize();
    this.look("overview");
    new ResizeObserver(() => this.resize()).observe(pane);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.pane;
    if (!this.cameras || !width || !height) return;
    this.cameras.resize();
    this.overlay.resize();
    this.viewer.renderer.setSize(width, height);
    this.viewer.set_dirty();
  }

  // The arm, or any other robot; `more` changes the look of every part.
  body(more = {}, scene = this.scene) {
    return scene.links ? new Robot(scene, more) : new Arm(scene, more);
  }

  line(points, colour, opacity = 1) {
    const { Line, BufferGeometry, LineBasicMaterial, Vector3 } = this.three;
    const shape = new BufferGeometry().setFromPoints(points.map((p) => new Vector3(...p)));
    const ink = { color: colour, transparent: opacity < 1, opacity };
    return new Line(shape, new LineBasicMaterial(ink));
  }

  addObstacles() {
    const { Mesh, EdgesGeometry, LineSegments, LineBasicMaterial, DoubleSide } = this.three;
    this.obstacles = this.scene.obstacles.map((solid) => {
      const [shape, indexed] = solidShape(solid);
      const edges = solid.creased ? new EdgesGeometry(indexed, CREASE) : null;
      const glass = { transparent: true, opacity: GLASS, side: DoubleSide, depthWrite: false };
      const body = new Mesh(shape, phong(GREY, glass));
      const ink = new LineBasicMaterial({ color: 0x5d6878 });
      if (edges) body.add(new LineSegments(edges, ink));
      if (solid.moves) body.moves = new Moves(solid.moves);
      this.root.add(body);
      return body;
    });
    this.stretchBox();
  }

  // Let the views show what stands or moves around the motion, and what the arm carries,
  // but not all of a long pipe.
  stretchBox() {
    const { Box3 } = this.three;
    const reach = longest(this.box);
    const near = this.box.clone().expandByScalar(0.12 * reach);
    const show = ({ geometry, matrix }, whole) => {
      if (!geometry.boundingBox) geometry.computeBoundingBox();
      const part = new Box3().copy(geometry.boundingBox).applyMatrix4(matrix);
      if (longest(near.clone().union(part)) > whole * reach) part.intersect(near);
      if (part.isEmpty()) return;
      this.box.union(part);
      this.spots.push(...boxCorners(part));
    };
    const moving = this.obstacles.filter((body) => body.moves);
    for (const body of this.obstacles) if (!body.moves) show(body, WHOLE);
    for (let k = 0; k <= SEEN_AT; k++) {
      const moment = (k / SEEN_AT) * this.motion.end;
      this.moveObstacles(moment);
      this.arm.pose(...this.motion.poses(moment));
      for (const body of [...moving, ...(this.arm.carried || [])]) show(body, WIDE);
    }
  }

  // Obstacles that move stand where they are at a moment.
  moveObstacles(time) {
    for (const body of this.obstacles) if (body.moves) body.moves.place(body, time);
  }

  addPaths() {
    const { CylinderGeometry, Mesh, MeshBasicMaterial, Vector3, Group } = this.three;
    const flat = unpack(this.scene.path || "", Float32Array);
    const corners = [];
    for (let i = 0; i < flat.length; i += 3) corners.push(new Vector3(...flat.slice(i, i + 3)));
    this.desired = new Group();
    this.rods = new Group();
    const ink = new MeshBasicMaterial({ color: 0xd9480f });
    const thin = 0.11 * this.scene.radius;
    for (let i = 0; i + 1 < corners.length && corners.length < 400; i++) {
      const side = corners[i + 1].clone().sub(corners[i]);
      const rod = new Mesh(new CylinderGeometry(thin, thin, side.length(), 8), ink);
      rod.position.copy(corners[i]).addScaledVector(side, 0.5);
      rod.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), side.normalize());
      this.rods.add(rod);
    }
    this.desired.add(this.rods, this.line(corners.map((p) => p.toArray()), 0xd9480f));
    this.root.add(this.desired);
    this.spots.push(...corners);

    const tracks = this.motion.centres(0).map(() => []);
    for (const moment of this.motion.drawn.moments) {
      const [centres, frames] = this.motion.poses(moment);
      centres.forEach((point, j) => tracks[j].push(point));
      this.arm.pose(centres, frames);
      for (const spot of this.arm.reach(centres)) this.spots.push(spot);
    }
    const colours = ["#7a7f87", ...this.scene.colours];
    this.tracks = new Group();
    tracks.forEach((points, j) => this.tracks.add(this.line(points, colours[j], 0.75)));
    this.root.add(this.tracks);
  }

  addFloor() {
    const { GridHelper, Vector3 } = this.three;
    const [low, high] = [this.box.min, this.box.max];
    const size = 2 * Math.ceil(Math.max(high.x - low.x, high.y - low.y) * 0.6);
    const floor = new GridHelper(size, 2 * size, 0x8b93a1, 0x8b93a1);
    floor.material.transparent = true;
    floor.material.opacity = 0.22;
    floor.rotateX(Math.PI / 2);
    const middle = this.box.getCenter(new Vector3());
    floor.position.set(Math.round(middle.x), Math.round(middle.y), low.z - 3 * this.scene.radius);
    this.root.add(floor);
    if (this.scene.links) return;
    const rail = [[low.x - 0.3, 0, 0], [high.x + 0.2, 0, 0]];
    this.root.add(this.line(rail, 0x8b93a1, 0.8));
  }

  // Arms with errors that are not held, beside the nominal one.
  addGhosts() {
    const look = { transparent: true, opacity: GHOST, depthWrite: false };
    this.ghosts = (this.scene.ghosts || []).map((told) => {
      const colours = this.scene.colours.map(() => MARKED.short);
      const arm = this.body(look, { ...this.scene, colours });
      arm.pose(told.centres, told.turns);
      this.root.add(arm.group);
      return { ...told, arm };
    });
  }

  // The ghost of a moment, if there is one; the others are not seen.
  showGhost(time) {
    const near = this.ghosts.filter((one) => Math.abs(one.moment - time) < DUE);
    near.sort((a, b) => Math.abs(a.moment - time) - Math.abs(b.moment - time));
    this.ghost = near[0] || null;
    for (const one of this.ghosts) one.arm.group.visible = one === this.ghost;
  }

  // A ring around a place of the desired path.
  addPin(place) {
    const { Mesh, TorusGeometry, MeshBasicMaterial } = this.three;
    const ring = new TorusGeometry(1.8 * this.scene.radius, 0.16 * this.scene.radius, 12, 48);
    const pin = new Mesh(ring, new MeshBasicMaterial({ color: MARKED.short }));
    pin.rotateY(Math.PI / 2);
    pin.position.set(...place);
    this.root.add(pin);
  }

  // Meshcat turns its scene so that z points up in a world whose y points up. Cameras
  // stay outside of the scene, in that world.
  addLights() {
    const { HemisphereLight, DirectionalLight } = this.three;
    const sky = new HemisphereLight(0xffffff, 0x8d8d99, 0.8);
    const lamp = new DirectionalLight(0xffffff, 0.45);
    lamp.position.set(-0.5, -1.0, 1.2);
    this.viewer.scene.add(sky, lamp);
    this.viewer.scene.updateMatrixWorld(true);
  }

  // What is in the way of a view from the tip: the last link and the rods of the path.
  hideEnd(hidden) {
    this.arm.hideEnd(hidden);
    this.rods.visible = !hidden;
  }

  look(name) {
    this.cameras.look(name);
  }

  eye() {
    return this.cameras.eye();
  }

  lookFrom(eye) {
    this.cameras.lookFrom(eye);
  }

  pose(time) {
    const [centres, frames] = this.motion.poses(time);
    this.centres = centres;
    this.arm.pose(centres, frames);
    this.moveObstacles(time);
    this.section.follow();
    this.tipNow = this.centres[this.centres.length - 1];
    if (this.cameras.name === "tip") this.cameras.fromTip();
    this.showGhost(time);
    this.mark(time);
    this.viewer.set_dirty();
  }

  // Show a closest approach while the arm is there.
  showWitness(approach) {
    this.shown = approach || null;
    this.mark(this.motion.time);
    this.viewer.set_dirty();
  }

  mark(time) {
    this.due = Boolean(this.shown) && Math.abs(time - this.shown.moment) < DUE;
    const { link, otherLink, obstacle, short } = this.due ? this.shown : {};
    const colour = short ? MARKED.short : MARKED.kept;
    this.arm.mark([link, otherLink].map((one) => (one || 0) - 1), colour);
    this.obstacles.forEach((body, k) => {
      const near = this.due && this.scene.obstacles[k].name === obstacle;
      body.material.color.setHex(near ? colour : GREY);
    });
  }

  // Fly to the gap that is shown.
  flyToWitness() {
    if (!this.shown || !measured(this.shown)) return;
    const { Vector3 } = this.three;
    const [a, b] = [this.shown.linkPoint, this.shown.otherPoint].map((p) =>
      this.root.localToWorld(new Vector3(...p)));
    this.cameras.flyTo(a, b, Math.max(4 * a.distanceTo(b), 9 * this.scene.radius));
  }

  toggle(what, on) {
    if (what === "tracks") this.tracks.visible = on;
    if (what === "swept" && !this.swept) this.root.add((this.swept = sweptVolume(this)));
    if (what === "swept") this.swept.visible = on;
    if (what === "numbers") this.overlay.numbers = on;
    if (what === "solids") this.arm.showSolids(on);
    this.viewer.set_dirty();
  }

  // A still picture, for paper and for files.
  picture(type = "image/png", quality = undefined) {
    this.viewer.render();
    const sheet = document.createElement("canvas");
    const drawn = this.viewer.renderer.domElement;
    [sheet.width, sheet.height] = [drawn.width, drawn.height];
    const pen = sheet.getContext("2d");
    pen.fillStyle = getComputedStyle(this.pane).getPropertyValue("--card");
    pen.fillRect(0, 0, sheet.width, sheet.height);
    for (const layer of [drawn, this.overlay.sheet])
      pen.drawImage(layer, 0, 0, sheet.width, sheet.height);
    return sheet.toDataURL(type, quality);
  }
}

// The longest side of a box.
function longest(box) {
  const { x, y, z } = box.getSize(new MeshCat.THREE.Vector3());
  return Math.max(x, y, z);
}

// Poses of an obstacle at moments, and all that lie between.
class Moves {
  constructor({ moments, places, turns }) {
    const { Vector3, Quaternion } = MeshCat.THREE;
    this.moments = unpack(moments, Float64Array);
    const [place, turn] = [places, turns].map((text) => unpack(text, Float32Array));
    const numbers = [...this.moments.keys()];
    this.places = numbers.map((k) => new Vector3().fromArray(place, 3 * k));
    this.turns = numbers.map((k) => new Quaternion().fromArray(turn, 4 * k));
  }

  place(body, time) {
    const last = this.moments.length - 1;
    const [k, share] = between(this.moments, Math.min(time, this.moments[last]));
    const after = Math.min(k + 1, last);
    body.position.copy(this.places[k]).lerp(this.places[after], share);
    body.quaternion.copy(this.turns[k]).slerp(this.turns[after], share);
    body.updateMatrix();
  }
}

// Whether both ends of a gap are known.
function measured({ linkPoint, otherPoint }) {
  return Boolean(linkPoint && otherPoint);
}

// Make the view, or say plainly that there is none.
function makeView(pane, scene, motion) {
  try {
    const view = new ArmView(pane, scene, motion);
    const canvas = pane.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label",
      "The motion in its scene, in 3D: arrow keys turn it, plus and minus come nearer and go back, ? lists the keys");
    canvas.tabIndex = 0;
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (!view.cameras.press(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
    });
    return view;
  } catch (error) {
    pane.innerHTML =
      '<p class="no-view">This browser cannot draw in 3D (WebGL is off). ' +
      "Plots and tables below are complete without it.</p>";
    console.warn(error);
    return null;
  }
}
