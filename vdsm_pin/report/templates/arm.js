// The scene in 3D, drawn by Meshcat's viewer and the three.js that it carries.
"use strict";

const CREASE = 32; // degrees between two faces from which on their edge is drawn

class ArmView {
  constructor(pane, scene, motion) {
    this.pane = pane;
    this.motion = motion;
    this.scene = scene;
    this.three = MeshCat.THREE;
    this.viewer = new MeshCat.Viewer(pane);
    this.viewer.set_3d_pane_size = () => this.resize();
    this.viewer.gui.domElement.remove();
    for (const path of [["Grid"], ["Axes"], ["Lights"]])
      this.viewer.set_property(path, "visible", false);
    this.viewer.hide_background();

    const { Group, Matrix4 } = this.three;
    this.root = new Group();
    this.root.matrixAutoUpdate = false;
    this.root.matrix = new Matrix4().set(...scene.pose);
    this.viewer.scene.add(this.root);
    this.box = new this.three.Box3();
    this.addPaths();
    this.addArm();
    this.addObstacles();
    this.addFloor();
    this.addWitness();
    this.addCamera();
    this.look("overview");
    new ResizeObserver(() => this.resize()).observe(pane);
    this.resize();
    motion.listen((time) => this.pose(time));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.pane;
    if (!this.camera || !width || !height) return;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.viewer.renderer.setSize(width, height);
    this.viewer.set_dirty();
  }

  line(points, colour, opacity = 1) {
    const { Line, BufferGeometry, LineBasicMaterial, Vector3 } = this.three;
    const shape = new BufferGeometry().setFromPoints(points.map((p) => new Vector3(...p)));
    const ink = { color: colour, transparent: opacity < 1, opacity };
    return new Line(shape, new LineBasicMaterial(ink));
  }

  material(colour, more = {}) {
    const look = { color: colour, shininess: 40, specular: 0x222222, ...more };
    return new this.three.MeshPhongMaterial(look);
  }

  addArm() {
    const { Vector2, LatheGeometry, Mesh, SphereGeometry } = this.three;
    const r = this.scene.radius;
    const capsule = (start, end, radius) => {
      const outline = [];
      for (let k = 0; k <= 24; k++) {
        const angle = -Math.PI / 2 + (Math.PI * k) / 24;
        const up = k > 12 ? end : start;
        outline.push(new Vector2(radius * Math.cos(angle), up + radius * Math.sin(angle)));
      }
      return new LatheGeometry(outline, 32);
    };
    this.links = [];
    for (const [link, start, end, radius] of this.scene.axes) {
      const shape = capsule(start, end, radius);
      if (link < this.links.length) {
        this.links[link].add(new Mesh(shape, this.material(0x3b4048)));
        continue;
      }
      this.links.push(new Mesh(shape, this.material(this.scene.colours[link])));
      this.root.add(this.links[link]);
    }
    const dot = new SphereGeometry(1.04 * r, 24, 16);
    this.joints = this.scene.lengths.map(() => {
      const joint = new Mesh(dot, this.material(0x3b4048));
      joint.scale.set(0.62, 1.0, 1.0);
      this.root.add(joint);
      return joint;
    });
    const tip = new SphereGeometry(0.35 * r, 16, 12);
    this.tip = new Mesh(tip, this.material(0xffffff, { emissive: 0x555555 }));
    this.root.add(this.tip);
  }

  addObstacles() {
    const { BufferGeometry, BufferAttribute, Mesh, EdgesGeometry } = this.three;
    const { LineSegments, LineBasicMaterial, DoubleSide } = this.three;
    this.obstacles = this.scene.obstacles.map((solid) => {
      let shape = new BufferGeometry();
      const corners = unpack(solid.vertices, Float32Array);
      shape.setAttribute("position", new BufferAttribute(corners, 3));
      shape.setIndex(new BufferAttribute(unpack(solid.triangles, Uint32Array), 1));
      const edges = solid.creased ? new EdgesGeometry(shape, CREASE) : null;
      if (!solid.round) shape = shape.toNonIndexed();
      shape.computeVertexNormals();
      const glass = { transparent: true, opacity: 0.42, side: DoubleSide, depthWrite: false };
      const body = new Mesh(shape, this.material(0x8a94a6, glass));
      const ink = new LineBasicMaterial({ color: 0x5d6878 });
      if (edges) body.add(new LineSegments(edges, ink));
      this.root.add(body);
      return body;
    });
  }

  addPaths() {
    const { CylinderGeometry, Mesh, MeshBasicMaterial, Vector3, Group } = this.three;
    const flat = unpack(this.scene.path, Float32Array);
    const corners = [];
    for (let i = 0; i < flat.length; i += 3) corners.push(new Vector3(...flat.slice(i, i + 3)));
    this.desired = new Group();
    const ink = new MeshBasicMaterial({ color: 0xd9480f });
    for (let i = 0; i + 1 < corners.length && corners.length < 400; i++) {
      const side = corners[i + 1].clone().sub(corners[i]);
      const rod = new Mesh(new CylinderGeometry(0.007, 0.007, side.length(), 8), ink);
      rod.position.copy(corners[i]).addScaledVector(side, 0.5);
      rod.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), side.normalize());
      this.desired.add(rod);
    }
    this.desired.add(this.line(corners.map((p) => p.toArray()), 0xd9480f));
    this.root.add(this.desired);
    corners.forEach((corner) => this.box.expandByPoint(corner));

    const tracks = this.scene.lengths.map(() => []);
    tracks.push([]);
    for (const row of this.motion.rows)
      this.motion.centres(row).forEach((point, j) => tracks[j].push(point));
    tracks.flat().forEach((point) => this.box.expandByPoint(new Vector3(...point)));
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
    const rail = [[low.x - 0.3, 0, 0], [high.x + 0.2, 0, 0]];
    this.root.add(this.line(rail, 0x8b93a1, 0.8));
  }

  addWitness() {
    const { Mesh, SphereGeometry, MeshBasicMaterial, Group } = this.three;
    const ink = new MeshBasicMaterial({ color: 0xe03131, depthTest: false, transparent: true });
    const ball = new SphereGeometry(0.018, 16, 12);
    this.witness = new Group();
    this.ends = [new Mesh(ball, ink), new Mesh(ball, ink)];
    this.ends.forEach((end) => (end.renderOrder = 9));
    this.span = this.line([[0, 0, 0], [0, 0, 0]], 0xe03131);
    this.span.material.depthTest = false;
    this.span.material.transparent = true;
    this.span.renderOrder = 9;
    this.span.frustumCulled = false;
    this.witness.add(...this.ends, this.span);
    this.root.add(this.witness);
  }

  // Meshcat turns its scene so that z points up in a world whose y points up. The camera
  // stays outside of the scene, in that world.
  addCamera() {
    const { PerspectiveCamera, HemisphereLight, DirectionalLight } = this.three;
    this.camera = new PerspectiveCamera(36, 1, 0.02, 200);
    this.viewer.set_camera(this.camera);
    const sky = new HemisphereLight(0xffffff, 0x8d8d99, 0.8);
    const lamp = new DirectionalLight(0xffffff, 0.45);
    lamp.position.set(-0.5, -1.0, 1.2);
    this.viewer.scene.add(sky, lamp);
    this.viewer.scene.updateMatrixWorld(true);
  }

  // Point the camera: overview, side, top or front.
  look(name) {
    const { Vector3 } = this.three;
    const directions = {
      overview: [-0.62, -1.0, 0.5],
      side: [0, -1, 0],
      top: [0, -0.001, 1],
      front: [1, 0, 0],
    };
    const world = this.box.clone().applyMatrix4(this.root.matrixWorld);
    const middle = world.getCenter(new Vector3());
    const reach = world.getSize(new Vector3()).length();
    const wide = Math.max(1, 1.45 / Math.max(this.camera.aspect, 0.5));
    const away = new Vector3(...directions[name]).transformDirection(this.root.matrixWorld);
    const place = middle.clone().addScaledVector(away, 1.08 * reach * wide);
    this.lookFrom([place.toArray(), middle.toArray()]);
  }

  // Where the camera is and what it looks at, to look from there again.
  eye() {
    return [this.camera.position.toArray(), this.viewer.controls.target.toArray()];
  }

  lookFrom([place, target]) {
    this.camera.position.fromArray(place);
    this.viewer.controls.target.fromArray(target);
    this.viewer.controls.update();
    this.viewer.set_dirty();
  }

  pose(time) {
    const { Vector3 } = this.three;
    const along = new Vector3(0, 1, 0);
    const points = this.motion.centres(time).map((p) => new Vector3(...p));
    this.links.forEach((link, i) => {
      const axis = points[i + 1].clone().sub(points[i]).normalize();
      link.position.copy(points[i]);
      link.quaternion.setFromUnitVectors(along, axis);
      this.joints[i].position.copy(points[i]);
      this.joints[i].quaternion.setFromUnitVectors(new Vector3(1, 0, 0), axis);
    });
    this.tip.position.copy(points[points.length - 1]);
    this.witness.visible = Boolean(this.shown);
    const due = this.shown && Math.abs(time - this.shown.moment) < 1.5;
    for (const part of this.witness.children) part.material.opacity = due ? 1 : 0.35;
    this.tipNow = points[points.length - 1].toArray();
    this.viewer.set_dirty();
  }

  // Mark the two nearest points of one closest approach.
  showWitness(approach) {
    this.shown = approach && approach.linkPoint && approach.otherPoint ? approach : null;
    if (!this.shown) return;
    this.ends[0].position.set(...this.shown.linkPoint);
    this.ends[1].position.set(...this.shown.otherPoint);
    const [a, b] = this.ends.map((end) => end.position);
    this.span.geometry.setFromPoints([a, b]);
    this.viewer.set_dirty();
  }

  toggle(what, on) {
    if (what === "tracks") this.tracks.visible = on;
    else this.obstacles.forEach((body) => (body.visible = on));
    this.viewer.set_dirty();
  }

  // A still picture, for printing.
  picture() {
    this.viewer.render();
    return this.viewer.renderer.domElement.toDataURL("image/png");
  }
}

// Make the view, or say plainly that there is none.
function makeView(pane, scene, motion) {
  try {
    const view = new ArmView(pane, scene, motion);
    pane.querySelector("canvas").setAttribute("aria-label", "The arm in its scene, in 3D");
    return view;
  } catch (error) {
    pane.innerHTML =
      '<p class="no-view">This browser cannot draw in 3D (WebGL is off). ' +
      "Plots and tables below are complete without it.</p>";
    console.warn(error);
    return null;
  }
}
