// An arm as solids: capsules along the axes of its links, joints between them, its tip.
"use strict";

const JOINT = 0x3b4048; // colour of joints and of what rides on a link

// A capsule along y, from `start` to `end`, `sides` corners around.
function capsuleShape(start, end, radius, sides = 32) {
  const { Vector2, LatheGeometry } = MeshCat.THREE;
  const outline = [];
  const half = Math.round(0.375 * sides);
  for (let k = 0; k <= 2 * half; k++) {
    const angle = (Math.PI * (k - half)) / (2 * half);
    const up = k > half ? end : start;
    outline.push(new Vector2(radius * Math.cos(angle), up + radius * Math.sin(angle)));
  }
  return new LatheGeometry(outline, sides);
}

function phong(colour, more = {}) {
  const look = { color: colour, shininess: 40, specular: 0x222222, ...more };
  return new MeshCat.THREE.MeshPhongMaterial(look);
}

// The triangles of a solid, its corners merged where it is round.
function solidShape(solid) {
  const { BufferGeometry, BufferAttribute } = MeshCat.THREE;
  let shape = new BufferGeometry();
  const corners = unpack(solid.vertices, Float32Array);
  shape.setAttribute("position", new BufferAttribute(corners, 3));
  shape.setIndex(new BufferAttribute(unpack(solid.triangles, Uint32Array), 1));
  const indexed = shape;
  if (!solid.round) shape = shape.toNonIndexed();
  shape.computeVertexNormals();
  return [shape, indexed];
}

class Arm {
  // `scene` is the page's; `more` changes the look of every part, of a ghost for example.
  constructor(scene, more = {}) {
    const { Mesh, SphereGeometry, Group } = MeshCat.THREE;
    const r = scene.radius;
    this.colours = scene.colours;
    this.group = new Group();
    this.links = [];
    for (const [link, start, end, radius] of scene.axes) {
      const shape = capsuleShape(start, end, radius);
      if (link < this.links.length) {
        this.links[link].add(new Mesh(shape, phong(JOINT, more)));
        continue;
      }
      this.links.push(new Mesh(shape, phong(scene.colours[link], more)));
    }
    const ball = new SphereGeometry(1.04 * r, 24, 16);
    this.joints = scene.lengths.map(() => {
      const joint = new Mesh(ball, phong(JOINT, more));
      joint.scale.set(0.62, 1.0, 1.0);
      return joint;
    });
    const white = phong(0xffffff, { emissive: 0x555555, ...more });
    this.tip = new Mesh(new SphereGeometry(0.35 * r, 16, 12), white);
    this.carried = scene.carried.map((solid) => {
      const side = { side: MeshCat.THREE.DoubleSide };
      const body = new Mesh(solidShape(solid)[0], phong(JOINT, { ...side, ...more }));
      body.name = solid.name;
      body.userData.link = solid.link; // 0 for the feed, which moves with O_1
      body.matrixAutoUpdate = false;
      return body;
    });
    this.group.add(...this.links, ...this.joints, this.tip, ...this.carried);
  }

  // Put the arm where its joint centres O_1..O_{N+1} and its links' axes are.
  pose(centres, frames) {
    const { Vector3 } = MeshCat.THREE;
    for (const body of this.carried) {
      const link = body.userData.link;
      const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = frames[link];
      const [px, py, pz] = centres[Math.max(0, link - 1)];
      body.matrix.set(xx, yx, zx, px, xy, yy, zy, py, xz, yz, zz, pz, 0, 0, 0, 1);
    }
    const along = new Vector3(0, 1, 0);
    const points = centres.map((p) => new Vector3(...p));
    this.links.forEach((link, i) => {
      const axis = points[i + 1].clone().sub(points[i]).normalize();
      link.position.copy(points[i]);
      link.quaternion.setFromUnitVectors(along, axis);
      this.joints[i].position.copy(points[i]);
      this.joints[i].quaternion.setFromUnitVectors(new Vector3(1, 0, 0), axis);
    });
    this.tip.position.copy(points[points.length - 1]);
  }

  // Joint centres; the arm is somewhat around them.
  reach(centres) {
    return centres.map((p) => new MeshCat.THREE.Vector3(...p));
  }

  // Give some links, counted from 0, another colour.
  mark(links, colour) {
    this.links.forEach((one, i) =>
      one.material.color.set(links.includes(i) ? colour : this.colours[i]));
  }

  // The last link and the tip are in the way of a view from there.
  hideEnd(hidden) {
    this.tip.visible = this.links[this.links.length - 1].visible = !hidden;
  }
}
