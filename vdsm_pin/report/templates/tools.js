// What helps to look into a scene: a section, the swept volume, obstacles one by one.
"use strict";

const SWEPT = 160; // moments at which the arm is drawn in the swept volume
const LOOKS = { translucent: [true, GLASS], solid: [true, 1], hidden: [false, GLASS] };

// Cuts the obstacles, not the arm, across an axis of the problem file's frame.
class Section {
  constructor(view) {
    const { LineSegments, BufferGeometry, LineBasicMaterial, Plane } = MeshCat.THREE;
    this.view = view;
    this.plane = new Plane();
    const ink = new LineBasicMaterial({ color: 0x1b1f27 });
    this.outline = new LineSegments(new BufferGeometry(), ink);
    this.outline.frustumCulled = false;
    this.outline.visible = false;
    view.root.add(this.outline);
  }

  // Where along an axis (0, 1, 2) something stands, from and to; [m].
  span(axis) {
    const matrix = this.view.root.matrix;
    const places = boxCorners(this.view.box).map((p) =>
      p.applyMatrix4(matrix).getComponent(axis));
    return [Math.min(...places), Math.max(...places)];
  }

  // Cut at `place` metres along an axis; the half beyond it stays, or the other one.
  cut(axis, place, beyond) {
    const { Vector3, Matrix4 } = MeshCat.THREE;
    this.asked = [axis, place, beyond];
    const normal = new Vector3().setComponent(axis, beyond ? 1 : -1);
    this.plane.setComponents(normal.x, normal.y, normal.z, beyond ? -place : place);
    const inBase = this.plane.clone().applyMatrix4(new Matrix4().copy(this.view.root.matrix).invert());
    this.plane.applyMatrix4(this.view.viewer.scene.matrixWorld);
    this.apply([this.plane]);
    const points = [];
    for (const body of this.view.obstacles)
      if (body.visible) crossings(body, inBase, points);
    this.outline.geometry.dispose();
    this.outline.geometry = new MeshCat.THREE.BufferGeometry().setFromPoints(points);
    this.outline.visible = true;
    this.view.viewer.set_dirty();
  }

  // Cut again where something has moved.
  follow() {
    const moved = this.view.obstacles.some((body) => body.moves);
    if (this.outline.visible && moved) this.cut(...this.asked);
  }

  off() {
    this.apply([]);
    this.outline.visible = false;
    this.view.viewer.set_dirty();
  }

  apply(planes) {
    for (const body of this.view.obstacles)
      body.traverse((part) => (part.material.clippingPlanes = planes));
  }

  // Whether the camera is beyond a place along an axis.
  cameraBeyond(axis, place) {
    const eye = this.view.cameras.camera.position.clone();
    return this.view.viewer.scene.worldToLocal(eye).getComponent(axis) > place;
  }
}

// Where a plane crosses the triangles of a body: pairs of points, added to `points`.
function crossings({ geometry: shape, matrix }, plane, points) {
  const { Vector3, Matrix4 } = MeshCat.THREE;
  plane = plane.clone().applyMatrix4(new Matrix4().copy(matrix).invert());
  const place = shape.getAttribute("position");
  const index = shape.getIndex();
  const count = index ? index.count : place.count;
  const corners = [new Vector3(), new Vector3(), new Vector3()];
  for (let k = 0; k + 2 < count; k += 3) {
    const heights = corners.map((corner, i) => {
      corner.fromBufferAttribute(place, index ? index.getX(k + i) : k + i);
      return plane.distanceToPoint(corner);
    });
    for (let i = 0; i < 3; i++) {
      const j = (i + 1) % 3;
      if (heights[i] < 0 === heights[j] < 0) continue;
      const share = heights[i] / (heights[i] - heights[j]);
      points.push(corners[i].clone().lerp(corners[j], share).applyMatrix4(matrix));
    }
  }
}

// The arm at many moments at once.
function sweptVolume(view) {
  const { InstancedMesh, Group, Object3D, Vector3 } = MeshCat.THREE;
  const { motion, scene } = view;
  if (scene.links) return view.arm.swept(motion, Math.min(SWEPT, motion.drawn.moments.length));
  const moments = Math.min(SWEPT, motion.rows.length);
  const group = new Group();
  const placer = new Object3D();
  const up = new Vector3(0, 1, 0);
  const glass = { transparent: true, opacity: 0.1, depthWrite: false };
  const bodies = scene.axes.map(([link, start, end, radius]) => {
    const shape = capsuleShape(start, end, radius, 12);
    const body = new InstancedMesh(shape, phong(scene.colours[link], glass), moments);
    body.frustumCulled = false;
    group.add(body);
    return body;
  });
  for (let m = 0; m < moments; m++) {
    const points = motion.centres(motion.momentAt(m / Math.max(1, moments - 1)))
      .map((p) => new Vector3(...p));
    scene.axes.forEach(([link], k) => {
      const axis = points[link + 1].clone().sub(points[link]).normalize();
      placer.position.copy(points[link]);
      placer.quaternion.setFromUnitVectors(up, axis);
      placer.updateMatrix();
      bodies[k].setMatrixAt(m, placer.matrix);
    });
  }
  return group;
}

// Shown, seen through or hidden.
function showObstacle(body, look) {
  const [visible, opacity] = LOOKS[look];
  body.visible = visible;
  body.material.opacity = opacity;
  body.material.transparent = opacity < 1;
  body.material.depthWrite = opacity === 1;
  body.material.needsUpdate = true;
}
